// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The server as clients meet it: Beast's own client, and that of another house from npm.
#include "trigpoint/bus/cdr.hpp"
#include "trigpoint/live/live_server.hpp"

#include "run_command.hpp"
#include "ws_client.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

namespace trigpoint::live {
namespace {

using std::chrono::steady_clock;
using test::Received;
using test::WsClient;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kProtocol = "foxglove.websocket.v1";
constexpr std::chrono::seconds kForever{20};  // only a broken server takes so long
constexpr std::size_t kHeader = 13;           // of a message of data

std::vector<Channel> channels() {
  return {{"/fusion/status", "trigpoint_msgs/msg/FusionStatus", 64, false},
          {"/cloud", "sensor_msgs/msg/PointCloud2", 2, false},
          {"/map", "sensor_msgs/msg/PointCloud2", 2, true}};
}

ServerOptions options(std::size_t max_clients = 16) {
  ServerOptions chosen;
  chosen.port = 0;
  chosen.max_clients = max_clients;
  return chosen;
}

std::string subscribe_to(int channel, int id) {
  return R"({"op":"subscribe","subscriptions":[{"id":)" + std::to_string(id) + R"(,"channelId":)" +
         std::to_string(channel) + "}]}";
}

/// What the server told about who wants what.
class Wishes {
 public:
  void tell(std::size_t channel, bool wanted) {
    const std::lock_guard lock(mutex_);
    told_.emplace_back(channel, wanted);
  }

  bool wait_for(const std::vector<std::pair<std::size_t, bool>>& expected) const {
    const auto end = steady_clock::now() + kForever;
    while (steady_clock::now() < end) {
      {
        const std::lock_guard lock(mutex_);
        if (told_ == expected) {
          return true;
        }
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::pair<std::size_t, bool>> told_;
};

/// Connected and past the greeting.
struct Greeted : WsClient {
  explicit Greeted(const LiveServer& server) : WsClient(server.port(), kProtocol) {
    receive();
    receive();
  }
};

class Server : public ::testing::Test {
 protected:
  void make(std::size_t max_clients = 16) {
    server = std::make_unique<LiveServer>(
        options(max_clients), channels(), [this](auto c, bool w) { wishes.tell(c, w); });
  }

  Wishes wishes;
  std::unique_ptr<LiveServer> server;
};

TEST_F(Server, greets_with_info_and_channels_in_both_names_of_the_protocol) {
  make();
  for (const char* name : {"foxglove.websocket.v1", "foxglove.sdk.v1"}) {
    WsClient client(server->port(), name);
    EXPECT_EQ(client.subprotocol(), name);
    EXPECT_THAT(client.receive().value_or(Received{}).bytes, HasSubstr(R"("op":"serverInfo")"));
    EXPECT_THAT(client.receive().value_or(Received{}).bytes, HasSubstr(R"("op":"advertise")"));
  }
}

TEST_F(Server, refuses_another_protocol) {
  make();
  EXPECT_THROW(WsClient(server->port(), "chat"), std::exception);
  EXPECT_THROW(WsClient(server->port(), ""), std::exception);
}

TEST_F(Server, passes_bytes_on_as_they_are_to_who_subscribed) {
  make();
  Greeted client(*server);
  client.send_text(subscribe_to(1, 42));
  ASSERT_TRUE(wishes.wait_for({{1, true}}));
  server->publish(0, 1, {9, 9, 9});
  server->publish(1, 0x0102, {0, 1, 0, 0, 77});
  const auto message = client.receive_data();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->bytes,
            std::string("\x01\x2a\0\0\0\x02\x01\0\0\0\0\0\0", kHeader) +
                std::string("\0\x01\0\0\x4d", 5));
}

TEST_F(Server, tells_when_the_first_comes_and_the_last_goes) {
  make();
  auto first = std::make_unique<Greeted>(*server);
  first->send_text(subscribe_to(1, 1));
  ASSERT_TRUE(wishes.wait_for({{1, true}}));
  Greeted second(*server);
  second.send_text(subscribe_to(1, 1));
  second.send_text(subscribe_to(0, 2));
  ASSERT_TRUE(wishes.wait_for({{1, true}, {0, true}}));
  first.reset();  // the second still wants channel 1
  second.send_text(R"({"op":"unsubscribe","subscriptionIds":[2]})");
  ASSERT_TRUE(wishes.wait_for({{1, true}, {0, true}, {0, false}}));
  second.send_text(R"({"op":"unsubscribe","subscriptionIds":[1]})");
  EXPECT_TRUE(wishes.wait_for({{1, true}, {0, true}, {0, false}, {1, false}}));
}

TEST_F(Server, gives_a_latecomer_the_newest_message_of_a_latched_channel) {
  make();
  Greeted early(*server);
  early.send_text(subscribe_to(2, 1));
  ASSERT_TRUE(wishes.wait_for({{2, true}}));
  server->publish(2, 1, {1});
  server->publish(2, 2, {2});
  ASSERT_TRUE(early.receive_data());
  ASSERT_TRUE(early.receive_data());
  Greeted late(*server);
  late.send_text(subscribe_to(2, 5));
  const auto message = late.receive_data();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->bytes.substr(kHeader), "\x02");
}

TEST_F(Server, lets_a_slow_client_lose_messages_and_nobody_wait_for_it) {
  make();
  Greeted slow(*server);
  Greeted quick(*server);
  slow.send_text(subscribe_to(1, 1));
  slow.send_text(subscribe_to(0, 2));
  quick.send_text(subscribe_to(0, 3));
  ASSERT_TRUE(wishes.wait_for({{1, true}, {0, true}}));
  quick.send_text(
      R"({"op":"unsubscribe","subscriptionIds":[99]})");  // its answer: all before is done
  ASSERT_TRUE(quick.receive());
  constexpr int kClouds = 60;
  constexpr std::size_t kCloud_bytes = 2'000'000;
  std::chrono::nanoseconds longest{0};
  for (int i = 0; i < kClouds; ++i) {
    std::vector<std::uint8_t> cloud(kCloud_bytes, static_cast<std::uint8_t>(i));
    const auto begin = steady_clock::now();
    server->publish(1, i, std::move(cloud));
    server->publish(0, i, {static_cast<std::uint8_t>(i)});
    longest = std::max<std::chrono::nanoseconds>(longest, steady_clock::now() - begin);
    const auto status = quick.receive_data();
    ASSERT_TRUE(status) << "another client did not get message " << i;
    EXPECT_EQ(status->bytes.at(kHeader), static_cast<char>(i));
  }
  EXPECT_LT(longest, std::chrono::seconds(1)) << "publishing waited for a client";
  EXPECT_GT(server->counters().dropped, kClouds / 2U);
  int clouds = 0;
  int statuses = 0;
  char newest_cloud = -1;
  while (newest_cloud != kClouds - 1 || statuses < kClouds) {
    const auto message = slow.receive_data();
    ASSERT_TRUE(message) << "the newest did not come: " << clouds << " clouds, " << statuses;
    const bool is_cloud = message->bytes.size() > kHeader + 1;
    ++(is_cloud ? clouds : statuses);
    newest_cloud = is_cloud ? message->bytes.at(kHeader) : newest_cloud;
  }
  EXPECT_LT(clouds, kClouds / 2);
  EXPECT_EQ(statuses, kClouds) << "small messages were lost for the sake of clouds";
}

TEST_F(Server, answers_garbage_with_a_warning_and_ends_a_flood_of_it) {
  make();
  Greeted client(*server);
  client.send_text("{]");
  EXPECT_THAT(client.receive().value_or(Received{}).bytes, HasSubstr(R"("op":"status")"));
  client.send_text(subscribe_to(77, 1));
  EXPECT_THAT(client.receive().value_or(Received{}).bytes, HasSubstr("no channel 77"));
  client.send_text(subscribe_to(1, 1));
  client.send_text(subscribe_to(1, 2));
  EXPECT_THAT(client.receive().value_or(Received{}).bytes, HasSubstr("in use"));
  for (int i = 0; i < 300; ++i) {
    client.send_text("x");
  }
  int answers = 0;
  while (client.receive()) {
    ++answers;
  }
  EXPECT_LT(answers, 150);
}

TEST_F(Server, ends_a_connection_that_sends_a_huge_message) {
  make();
  Greeted client(*server);
  client.send_text(std::string(10'000'000, 'x'));
  EXPECT_FALSE(client.receive());
  Greeted another(*server);
  another.send_text(subscribe_to(0, 1));
  EXPECT_TRUE(wishes.wait_for({{0, true}}));
}

TEST_F(Server, lets_only_so_many_in) {
  make(2);
  auto first = std::make_unique<Greeted>(*server);
  const Greeted second(*server);
  EXPECT_THROW(Greeted{*server}, std::exception);
  EXPECT_EQ(server->counters().turned_away, 1U);
  first.reset();
  const auto end = steady_clock::now() + kForever;
  while (server->counters().clients > 1 && steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_NO_THROW(Greeted{*server});
}

TEST_F(Server, ends_while_clients_are_connected_and_wait_for_data) {
  make();
  Greeted client(*server);
  client.send_text(subscribe_to(1, 1));
  ASSERT_TRUE(wishes.wait_for({{1, true}}));
  for (int i = 0; i < 20; ++i) {
    server->publish(1, i, std::vector<std::uint8_t>(2'000'000));
  }
  server.reset();
  while (client.receive()) {
  }
}

TEST_F(Server, has_a_page_that_needs_no_other_file) {
  make();
  const std::string page = test::http(server->port(), "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_THAT(page, StartsWith("HTTP/1.1 200 OK"));
  EXPECT_THAT(page, HasSubstr("\r\nContent-Security-Policy: default-src 'none'"));
  EXPECT_THAT(page, HasSubstr("class CdrReader"));
  for (const char* outside :
       {"<script src", "https://", "url(", "<link rel=\"stylesheet\"", "import("}) {
    EXPECT_THAT(page, Not(HasSubstr(outside)));
  }
}

TEST_F(Server, leaves_what_is_behind_a_question_mark_to_the_page) {
  make();
  EXPECT_THAT(test::http(server->port(), "GET /?view=top HTTP/1.1\r\n\r\n"), HasSubstr(" 200 "));
  EXPECT_THAT(test::http(server->port(), "GET /x?/ HTTP/1.1\r\n\r\n"), HasSubstr(" 404 "));
}

TEST_F(Server, refuses_other_requests) {
  make();
  EXPECT_THAT(test::http(server->port(), "GET /../etc/passwd HTTP/1.1\r\n\r\n"),
              HasSubstr(" 404 "));
  EXPECT_THAT(test::http(server->port(), "DELETE / HTTP/1.1\r\n\r\n"), HasSubstr(" 405 "));
  EXPECT_EQ(test::http(server->port(), "no HTTP at all\r\n\r\n"), "");
  EXPECT_EQ(test::http(server->port(), "GET /" + std::string(100'000, 'a')), "");
}

TEST_F(Server, says_what_to_do_when_it_cannot_listen) {
  make();
  ServerOptions taken = options();
  taken.port = server->port();
  try {
    const LiveServer second(taken, channels());
    FAIL() << "two servers on one port";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("--port"));
  }
  taken.bind_address = "localhost.example";
  EXPECT_THROW(LiveServer(taken, channels()), std::runtime_error);
}

// Needs node and, in the folder that TRIGPOINT_NODE_MODULES names, the packages ws,
// @foxglove/rosmsg and
// @foxglove/rosmsg2-serialization (npm install --prefix FOLDER ...); says that it skips without.
TEST_F(Server, is_understood_by_a_client_of_another_house_and_by_its_own_page) {
  const char* modules = std::getenv("TRIGPOINT_NODE_MODULES");
  if (modules == nullptr ||
      !std::filesystem::exists(std::string(modules) + "/@foxglove/rosmsg2-serialization")) {
    GTEST_SKIP() << "TRIGPOINT_NODE_MODULES names no folder that holds the npm packages ws, "
                    "@foxglove/rosmsg and @foxglove/rosmsg2-serialization";
  }
  make();
  FusionStatus status;
  status.stamp_ns = 1'700'000'000'250'000'000;
  status.mode = "smooth";
  status.axes[1] = {AxisSource::kFused, 0.25, 0.5, "sigma 0.25 m <= threshold 0.50 m"};
  status.aligned = true;
  status.T_map_odom.yaw_rad = -1.5;
  status.fixes_used = 7;
  status.verdicts = {{"odd", 3}, {"number of letters", 5}};
  tests::Command client({"node",
                         std::string(TRIGPOINT_SOURCE_DIR) + "/tests/unit/live/foxglove_client.mjs",
                         modules,
                         "ws://127.0.0.1:" + std::to_string(server->port()),
                         "foxglove.sdk.v1",
                         "/fusion/status",
                         "1",
                         std::string(TRIGPOINT_SOURCE_DIR) + "/components/live/page/cdr.js"});
  ASSERT_TRUE(wishes.wait_for({{0, true}}));
  server->publish(0, 123, bus::encode_cdr(status));
  const auto result = client.wait(kForever);
  EXPECT_EQ(result.exit_code, 0);
  for (const char* part :
       {"subprotocol foxglove.sdk.v1\n",
        "channel /map sensor_msgs/msg/PointCloud2 cdr ros2msg\n",
        "message 7 123 ",
        R"("stamp":{"sec":1700000000,"nanosec":250000000},"mode":"smooth")",
        R"("sigma_m":0.25,"threshold_m":0.5,"reason":"sigma 0.25 m <= threshold)",
        R"("yaw_rad":-1.5)",
        R"("fixes_used":7)",
        R"({"name":"number of letters","count":5})",
        "the page reads the same\n"}) {
    EXPECT_THAT(result.output, HasSubstr(part));
  }
}

}  // namespace
}  // namespace trigpoint::live
