// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// trigpoint live beside what writes to the bus.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/cdr.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "run_command.hpp"
#include "ws_client.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <optional>
#include <thread>

namespace trigpoint {
namespace {

using live::test::WsClient;
using nlohmann::json;
using ::testing::HasSubstr;

constexpr std::chrono::seconds kForever{60};

FusionStatus status_with(double sigma_m) {
  FusionStatus status;
  status.mode = "smooth";
  status.stamp_ns = 1'000'000'000;
  status.axes[2] = {AxisSource::kFused, sigma_m, 1.25, "a reason to be seen"};
  return status;
}

/// The command on a domain of this test, and a gate that repeats one status ten times a second.
class LiveCommand : public ::testing::Test {
 protected:
  LiveCommand()
      : command_({std::string(TRIGPOINT_BIN_DIR) + "/trigpoint", "live", "--port", "0"},
                 {{"ROS_DOMAIN_ID", tests::own_domain()}}) {
    bus::Config config;
    config.domain_id = tests::own_domain_id();
    participant_.emplace(config, "gate", bus::EventSink{});
    publisher_.emplace(*participant_, bus::topics::fusion_status);
    gate_ = std::thread([this] {
      while (!done_) {
        publisher_->publish(bus::to_message(status_with(0.125)));
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
      }
    });
  }

  ~LiveCommand() override {
    done_ = true;
    gate_.join();
  }

  /// Zero when it does not tell one.
  std::uint16_t port() const {
    const std::string before = "http://localhost:";
    const auto end = std::chrono::steady_clock::now() + kForever;
    while (std::chrono::steady_clock::now() < end) {
      const std::string output = command_.output_so_far();
      const std::size_t at = output.find(before);
      if (at != std::string::npos && output.find('\n', at) != std::string::npos) {
        return static_cast<std::uint16_t>(std::stoi(output.substr(at + before.size())));
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return 0;
  }

  /// Those of the command on a topic, once there are as many as wanted.
  std::vector<bus::DiscoveredEndpoint> readers_of(const std::string& topic, std::size_t wanted) {
    const auto end = std::chrono::steady_clock::now() + kForever;
    std::vector<bus::DiscoveredEndpoint> found;
    do {
      found = participant_->discovered();
      std::erase_if(found, [&](const auto& e) { return e.writes || e.dds_topic != "rt/" + topic; });
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    } while (found.size() != wanted && std::chrono::steady_clock::now() < end);
    return found;
  }

  tests::Command command_;

 private:
  std::optional<bus::Participant> participant_;
  std::optional<bus::Publisher<trigpoint_msgs::msg::FusionStatus>> publisher_;
  std::atomic<bool> done_{false};
  std::thread gate_;
};

/// Topic -> number and schema of what the server offers.
std::map<std::string, std::pair<int, std::string>> offered(WsClient& client) {
  std::map<std::string, std::pair<int, std::string>> channels;
  client.receive();
  const auto advertisement = client.receive();
  const json message = json::parse(advertisement ? advertisement->bytes : "{}");
  for (const json& channel : message.value("channels", json::array())) {
    channels[channel["topic"]] = {channel["id"], channel["schema"]};
  }
  return channels;
}

TEST_F(LiveCommand, passes_on_what_is_on_the_bus_byte_for_byte_and_ends_with_ctrl_c) {
  WsClient client(port(), "foxglove.sdk.v1");
  const auto channels = offered(client);
  ASSERT_TRUE(channels.contains("/fusion/status"));
  client.send_text(R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":)" +
                   std::to_string(channels.at("/fusion/status").first) + "}]}");
  const auto message = client.receive_data(60'000);
  ASSERT_TRUE(message);
  const auto expected = bus::encode_cdr(status_with(0.125));
  EXPECT_EQ(message->bytes.substr(13), std::string(expected.begin(), expected.end()));
  command_.signal(SIGINT);
  EXPECT_EQ(command_.wait(kForever).exit_code, 0);
}

TEST_F(LiveCommand, reads_clouds_only_while_somebody_looks_and_asks_no_writer_to_repeat_one) {
  WsClient client(port(), "foxglove.sdk.v1");
  const auto channels = offered(client);
  EXPECT_TRUE(readers_of("cloud_registered", 0).empty());
  client.send_text(R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":)" +
                   std::to_string(channels.at("/cloud_registered").first) + "}]}");
  const auto readers = readers_of("cloud_registered", 1);
  ASSERT_EQ(readers.size(), 1U);
  EXPECT_EQ(readers.front().reliability, bus::Reliability::kBestEffort);
  client.send_text(R"({"op":"unsubscribe","subscriptionIds":[1]})");
  EXPECT_TRUE(readers_of("cloud_registered", 0).empty());
}

/// Every string of a document that begins with '/'.
void collect_paths(const json& value, std::vector<std::string>& paths) {
  if (value.is_string() && value.get<std::string>().starts_with('/')) {
    paths.push_back(value);
  }
  for (const auto& [key, child] : value.items()) {
    if (value.is_structured()) {
      if (key.starts_with('/')) {
        paths.push_back(key);
      }
      collect_paths(child, paths);
    }
  }
}

TEST_F(LiveCommand, offers_every_topic_and_field_that_the_layout_for_foxglove_names) {
  WsClient client(port(), "foxglove.sdk.v1");
  const auto channels = offered(client);
  std::vector<std::string> paths;
  collect_paths(json::parse(tests::read_file(std::string(TRIGPOINT_SOURCE_DIR) +
                                             "/config/foxglove_layout.json")),
                paths);
  EXPECT_GE(paths.size(), 10U);
  for (const std::string& path : paths) {
    const std::size_t dot = path.find('.');
    ASSERT_TRUE(channels.contains(path.substr(0, dot))) << path;
    if (dot != std::string::npos) {
      const std::string field = path.substr(path.rfind('.') + 1);
      EXPECT_THAT(channels.at(path.substr(0, dot)).second, HasSubstr(" " + field + "\n")) << path;
    }
  }
}

// Needs chromium, node and the npm package ws in the folder that TRIGPOINT_NODE_MODULES names; says
// that it skips without.
TEST_F(LiveCommand, has_a_page_that_shows_the_gate_in_a_browser) {
  const char* modules = std::getenv("TRIGPOINT_NODE_MODULES");
  if (modules == nullptr || !std::filesystem::exists(std::string(modules) + "/ws") ||
      !std::filesystem::exists("/usr/bin/chromium")) {
    GTEST_SKIP() << "no /usr/bin/chromium, or TRIGPOINT_NODE_MODULES names no folder with the npm "
                    "package ws";
  }
  const tests::TemporaryFolder folder;
  const auto result =
      tests::run_command({"node",
                          std::string(TRIGPOINT_SOURCE_DIR) + "/tests/system/look_at_page.mjs",
                          modules,
                          "http://localhost:" + std::to_string(port()) + "/",
                          folder.path("profile"),
                          "a reason to be seen",
                          folder.path("page.png")},
                         std::chrono::seconds(90));
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("0.13 m"));
  EXPECT_THAT(result.output, HasSubstr("connected"));
}

}  // namespace
}  // namespace trigpoint
