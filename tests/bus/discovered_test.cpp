// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a participant knows of the writers and readers of others, over each backend.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/topics.hpp"

#include "bus_fixture.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <thread>

namespace trigpoint::bus {
namespace {

constexpr Topic<nav_msgs::msg::Odometry> kOurs{"ours", qos::kTransientLocal};
constexpr Topic<sensor_msgs::msg::Imu> kRead{"read", qos::kSensorData};

/// On a topic that `participant` does not use; waits for `wanted` of them.
std::vector<DiscoveredEndpoint> discovered(Participant& participant, std::size_t wanted) {
  const auto deadline = std::chrono::steady_clock::now() + testing::kForever;
  std::vector<DiscoveredEndpoint> all;
  do {
    all = participant.discovered();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  } while (all.size() != wanted && std::chrono::steady_clock::now() < deadline);
  return all;
}

TEST(Discovered, are_writers_and_readers_of_others_with_type_qos_and_process_until_they_go) {
  const Config config = testing::own_domain();
  Participant looking(config, "looking");
  const Publisher own(looking, topics::diagnostics);
  Participant other(config, "other");
  std::optional<Publisher<nav_msgs::msg::Odometry>> publisher;
  publisher.emplace(other, kOurs);
  const Subscription<sensor_msgs::msg::Imu> reader(
      other, kRead, [](const sensor_msgs::msg::Imu&, const MessageInfo&) {});
  std::vector<DiscoveredEndpoint> found = discovered(looking, 2);
  ASSERT_EQ(found.size(), 2U);
  std::sort(
      found.begin(), found.end(), [](const auto& a, const auto& b) { return a.writes > b.writes; });
  EXPECT_EQ(found[0].guid, publisher->guid());
  EXPECT_TRUE(found[0].writes);
  EXPECT_EQ(found[0].dds_topic, "rt/ours");
  EXPECT_EQ(found[0].dds_type, "nav_msgs::msg::dds_::Odometry_");
  EXPECT_EQ(found[0].reliability, Reliability::kReliable);
  EXPECT_EQ(found[0].durability, Durability::kTransientLocal);
  EXPECT_EQ(found[0].process, static_cast<unsigned>(getpid()));
  EXPECT_FALSE(found[1].writes);
  EXPECT_EQ(found[1].dds_topic, "rt/read");
  EXPECT_EQ(found[1].dds_type, "sensor_msgs::msg::dds_::Imu_");
  EXPECT_EQ(found[1].reliability, Reliability::kBestEffort);
  EXPECT_EQ(found[1].durability, Durability::kVolatile);
  publisher.reset();
  EXPECT_EQ(discovered(looking, 1).size(), 1U);
}

}  // namespace
}  // namespace trigpoint::bus
