// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "protocol.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace trigpoint::live {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(Subprotocol, is_the_first_that_both_sides_speak) {
  EXPECT_EQ(choose_subprotocol("foxglove.websocket.v1"), "foxglove.websocket.v1");
  EXPECT_EQ(choose_subprotocol("x, foxglove.sdk.v1 ,foxglove.websocket.v1"), "foxglove.sdk.v1");
  EXPECT_EQ(choose_subprotocol(""), std::nullopt);
  EXPECT_EQ(choose_subprotocol("foxglove.websocket.v2,,"), std::nullopt);
}

TEST(ClientMessage, subscribes_and_unsubscribes) {
  const auto subscribe = parse_client_message(
      R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":4294967295,"channelId":5}]})");
  EXPECT_THAT(subscribe.complaint, IsEmpty());
  ASSERT_THAT(subscribe.subscribe, SizeIs(2));
  EXPECT_EQ(subscribe.subscribe[0].channel, 3U);
  EXPECT_EQ(subscribe.subscribe[1].id, 4294967295U);
  const auto unsubscribe = parse_client_message(R"({"op":"unsubscribe","subscriptionIds":[7,8]})");
  EXPECT_EQ(unsubscribe.unsubscribe, (std::vector<std::uint32_t>{7, 8}));
}

TEST(ClientMessage, of_a_newer_client_that_introduces_itself_is_no_mistake) {
  EXPECT_THAT(parse_client_message(R"({"op":"clientInfo","name":"x"})").complaint, IsEmpty());
}

TEST(ClientMessage, that_makes_no_sense_is_a_complaint) {
  for (const char* text :
       {"",
        "{",
        "[]",
        "null",
        "7",
        R"({"op":7})",
        R"({"op":"advertise","channels":[]})",
        R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":0}]})",
        R"({"op":"subscribe","subscriptions":[{"id":1.5,"channelId":0}]})",
        R"({"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":0}]})",
        R"({"op":"subscribe","subscriptions":[3]})",
        R"({"op":"unsubscribe","subscriptionIds":["a"]})",
        "\"\xff\xfe\""}) {
    const ClientMessage message = parse_client_message(text);
    EXPECT_FALSE(message.complaint.empty()) << text;
    EXPECT_THAT(message.subscribe, IsEmpty()) << text;
  }
}

TEST(ClientMessage, of_any_bytes_does_no_harm) {
  std::mt19937 random(5);
  const std::string whole = R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":3}]})";
  for (int round = 0; round < 5000; ++round) {
    std::string text = whole;
    for (int i = 0; i < 4; ++i) {
      text[random() % text.size()] = static_cast<char>(random() % 256);
    }
    text.resize(random() % (text.size() + 1));
    parse_client_message(text);
  }
  parse_client_message(std::string(64 * 1024, '['));
}

TEST(Frames, carry_their_numbers_little_endian) {
  const Frame data = data_frame(0x04030201, 0x0c0b0a0908070605, nullptr);
  EXPECT_EQ(data.header_bytes, 13U);
  EXPECT_THAT(data.header, ::testing::ElementsAre(1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12));
  const Frame time = time_frame(0x0807060504030201);
  EXPECT_EQ(time.header_bytes, 9U);
  EXPECT_EQ(time.header[0], 2);
  EXPECT_EQ(time.header[1], 1);
  EXPECT_EQ(time.header[8], 8);
}

TEST(Advertisement, names_encoding_and_schema_of_every_channel) {
  const std::string text = advertise_json({{"/imu/data", "sensor_msgs/msg/Imu"}});
  EXPECT_THAT(text, HasSubstr(R"("encoding":"cdr")"));
  EXPECT_THAT(text, HasSubstr(R"("schemaEncoding":"ros2msg")"));
  EXPECT_THAT(text, HasSubstr(R"("schemaName":"sensor_msgs/msg/Imu")"));
  EXPECT_THROW(advertise_json({{"/x", "sensor_msgs/msg/Image"}}), std::runtime_error);
}

}  // namespace
}  // namespace trigpoint::live
