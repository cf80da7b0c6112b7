// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/config.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/bus/qos.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

namespace trigpoint::bus {
namespace {

TEST(Domain, is_that_of_the_environment_unless_configured) {
  setenv("ROS_DOMAIN_ID", "42", 1);
  Config config;
  EXPECT_EQ(domain_of(config), 42);
  config.domain_id = 7;
  EXPECT_EQ(domain_of(config), 7);
  unsetenv("ROS_DOMAIN_ID");
  EXPECT_EQ(domain_of(Config{}), 0);
}

TEST(Domain, that_is_no_number_is_refused_with_its_text) {
  for (const char* text : {"abc", "12x", "-1", "233", "99999999999999999999"}) {
    setenv("ROS_DOMAIN_ID", text, 1);
    try {
      domain_of(Config{});
      ADD_FAILURE() << text << " was accepted";
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr(text));
    }
  }
  unsetenv("ROS_DOMAIN_ID");
}

TEST(BusConfig, reads_every_field) {
  Config config;
  load_config_text(
      "domain_id: 3\nnetwork_interface: lo\ninitial_peers: [10.0.0.2]\n"
      "socket_buffer_bytes: 212992\ndatagram_bytes: 1472\nheartbeat_s: 0.05\nlease_s: 5\n"
      "discovery_server: \"10.0.0.1:11811\"\nbulk_bytes_per_s: 5000000\nsecurity_folder: keys\n"
      "shared_memory: true\n",
      "test",
      [&](ConfigFields& fields) { describe(config, fields); });
  EXPECT_EQ(config.domain_id, 3);
  EXPECT_EQ(config.network_interface, "lo");
  EXPECT_THAT(config.initial_peers, ::testing::ElementsAre("10.0.0.2"));
  EXPECT_EQ(config.socket_buffer_bytes, 212992);
  EXPECT_EQ(config.datagram_bytes, 1472);
  EXPECT_EQ(config.heartbeat_s, 0.05);
  EXPECT_EQ(config.lease_s, 5.0);
  EXPECT_EQ(config.discovery_server, "10.0.0.1:11811");
  EXPECT_EQ(config.bulk_bytes_per_s, 5'000'000);
  EXPECT_EQ(config.security_folder, "keys");
  EXPECT_FALSE(Config{}.shared_memory);
  EXPECT_TRUE(config.shared_memory);
}

TEST(TopicName, is_the_ros_name_behind_rt) {
  EXPECT_EQ(Topic<int>{"lio/odometry"}.dds_name(), "rt/lio/odometry");
  EXPECT_EQ(Topic<int>{"/imu/data"}.dds_name(), "rt/imu/data");
  EXPECT_EQ(Topic<int>{"points"}.renamed("velodyne").dds_name(), "rt/velodyne");
}

}  // namespace
}  // namespace trigpoint::bus
