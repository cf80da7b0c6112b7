// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Our messages against CDR code and message definitions of another house (read_ros2_cdr.mjs): what
// a writer of ours sends is read there equal field by field, what is written there is read here.
// Needs node and, in the folder that TRIGPOINT_NODE_MODULES names, Foxglove's packages
// (npm install --prefix FOLDER @foxglove/rosmsg @foxglove/rosmsg2-serialization
// @foxglove/rosmsg-msgs-common); says that it skips without.
#include "bus_fixture.hpp"
#include "matrix_messages.hpp"
#include "message_json.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <thread>

namespace trigpoint::bus {
namespace {

using testing::Json;
using testing::json_of;

constexpr std::array<const char*, 3> kPackages{"rosmsg",
                                               "rosmsg2-serialization",
                                               "rosmsg-msgs-common"};

/// Empty when a package is missing.
std::string node_modules() {
  const char* folder = std::getenv("TRIGPOINT_NODE_MODULES");
  const auto there = [folder](const char* package) {
    return std::filesystem::exists(std::string(folder) + "/@foxglove/" + package);
  };
  return folder != nullptr && std::all_of(kPackages.begin(), kPackages.end(), there) ? folder : "";
}

std::string hexadecimal(const SerializedMessage& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    std::array<char, 3> digits{};
    std::snprintf(digits.data(), digits.size(), "%02x", static_cast<unsigned>(byte));
    text += digits.data();
  }
  return text;
}

SerializedMessage bytes_of(const std::string& hexadecimal) {
  SerializedMessage bytes;
  for (std::size_t i = 0; i + 1 < hexadecimal.size(); i += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(hexadecimal.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

/// "sensor_msgs/Imu" and "sensor_msgs/msg/Imu" from "sensor_msgs::msg::dds_::Imu_".
template <class T>
std::string ros_type(const char* between) {
  const std::string& dds = backend::type_ops<T>().dds_name;
  const std::string middle = "::msg::dds_::";
  const std::size_t at = dds.find(middle);
  const std::size_t name = at + middle.size();
  return dds.substr(0, at) + between + dds.substr(name, dds.size() - name - 1);
}

/// The first samples after a match may be lost, so once is not enough.
void repeat_until(const std::function<void()>& publish, const std::function<bool()>& heard) {
  const auto deadline = std::chrono::steady_clock::now() + testing::kForever;
  while (!heard() && std::chrono::steady_clock::now() < deadline) {
    publish();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

/// As a recorder gets them from the middleware.
template <class T>
SerializedMessage sent_bytes(const Topic<T>& topic, const T& message) {
  const Config config = testing::own_domain();
  Participant writer(config, "writer");
  Participant reader(config, "reader");
  testing::Collected<SerializedMessage> heard;
  const SerializedSubscription subscription(
      reader,
      std::string(topic.name),
      ros_type<T>("/msg/"),
      topic.qos,
      [&](SerializedMessage& cdr, const MessageInfo&) { heard.add(cdr); });
  Publisher<T> publisher(writer, topic);
  repeat_until([&] { publisher.publish(message); }, [&] { return heard.size() > 0; });
  return heard.size() > 0 ? heard.items().front() : SerializedMessage{};
}

/// Sent by a writer of ours, received as a `T` by a reader of ours.
template <class T>
Json received(const Topic<T>& topic, const SerializedMessage& cdr) {
  const Config config = testing::own_domain();
  Participant writer(config, "writer");
  Participant reader(config, "reader");
  testing::Collected<Json> heard;
  const Subscription<T> subscription(
      reader, topic, [&](const T& m, const MessageInfo&) { heard.add(json_of(m)); });
  SerializedPublisher publisher(writer, std::string(topic.name), ros_type<T>("/msg/"), topic.qos);
  repeat_until([&] { publisher.publish(cdr); }, [&] { return heard.size() > 0; });
  return heard.size() > 0 ? heard.items().front() : Json{};
}

class Ros2Cdr : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (node_modules().empty()) {
      GTEST_SKIP() << "TRIGPOINT_NODE_MODULES names no folder that holds the npm packages "
                      "@foxglove/rosmsg, rosmsg2-serialization and rosmsg-msgs-common";
    }
  }

  /// Calls `visit(name, topic, example)` for every topic whose type is one of ROS's.
  template <class Visitor>
  static void visit_ros_topics(Visitor&& visit) {
    matrix::visit_topics([&]<class T>(const char* name, const Topic<T>& topic, const T& example) {
      if constexpr (requires { json_of(example); }) {
        visit(name, topic, example);
      }
    });
  }

  tests::CommandResult run_the_other_house() const {
    return tests::run_command({"node",
                               std::string(TRIGPOINT_SOURCE_DIR) + "/tests/bus/read_ros2_cdr.mjs",
                               node_modules(),
                               GetParam(),
                               folder_.path()});
  }

  const tests::TemporaryFolder folder_;
};

TEST_P(Ros2Cdr, of_every_topic_is_that_of_another_house_in_both_directions) {
  int topics = 0;
  visit_ros_topics([&]<class T>(const char* name, const Topic<T>& topic, const T& example) {
    const SerializedMessage sent = sent_bytes(topic, example);
    EXPECT_EQ(hexadecimal(sent).substr(0, 8), "00010000") << name << ": not little-endian XCDR1";
    tests::write_file(
        folder_.path(std::string(name) + ".json"),
        Json{{"type", ros_type<T>("/")}, {"cdr", hexadecimal(sent)}, {"value", json_of(example)}}
            .dump());
    ++topics;
  });
  EXPECT_EQ(topics, 20);
  const auto result = run_the_other_house();
  ASSERT_EQ(result.exit_code, 0) << result.output;
  visit_ros_topics([&]<class T>(const char* name, const Topic<T>& topic, const T& example) {
    const Json theirs = Json::parse(tests::read_file(folder_.path(std::string(name) + ".out")));
    EXPECT_EQ(received(topic, bytes_of(theirs["again"])), json_of(example)) << name;
    // Fields compared by name: the order of a JSON object says nothing.
    EXPECT_EQ(nlohmann::json(received(topic, bytes_of(theirs["other"]))),
              nlohmann::json(theirs["value"]))
        << name;
  });
}

/// The comparison itself: a field that was swapped on its way is named.
TEST_P(Ros2Cdr, that_differs_in_a_field_is_found) {
  auto swapped = to_message(samples::fix());
  const SerializedMessage sent = sent_bytes(topics::fix, swapped);
  std::swap(swapped.latitude(), swapped.longitude());
  tests::write_file(folder_.path("fix.json"),
                    Json{{"type", "sensor_msgs/NavSatFix"},
                         {"cdr", hexadecimal(sent)},
                         {"value", json_of(swapped)}}
                        .dump());
  const auto result = run_the_other_house();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output,
              ::testing::AllOf(::testing::HasSubstr(".latitude: 49.01 read, -8.43 written"),
                               ::testing::Not(::testing::HasSubstr("altitude"))));
}

INSTANTIATE_TEST_SUITE_P(Of,
                         Ros2Cdr,
                         ::testing::Values("ros2humble", "ros2jazzy"),
                         [](const auto& parameter) { return std::string(parameter.param); });

}  // namespace
}  // namespace trigpoint::bus
