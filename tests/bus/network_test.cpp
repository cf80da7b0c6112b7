// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What only a network can show: small socket buffers, killed processes.
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "../unit/bus/samples.hpp"
#include "bus_fixture.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <thread>

namespace trigpoint::bus {
namespace {

using namespace std::chrono_literals;
using testing::Collected;
using testing::kForever;
using testing::own_domain;
using testing::Readers;

constexpr std::int64_t kStockKernelBuffer_bytes = 212'992;

Config small_buffers() {
  Config config = own_domain();
  config.socket_buffer_bytes = kStockKernelBuffer_bytes;
  return config;
}

PointCloudMessage two_megabytes(std::uint32_t number) {
  PointCloudMessage cloud = samples::cloud();
  cloud.height = number;
  cloud.data.assign(2'000'000, static_cast<std::uint8_t>(number));
  return cloud;
}

/// Another process on our domain and backend: bus_peer.cpp says which there are.
std::vector<std::string> peer_command(const Config& config, std::vector<std::string> what) {
  what.insert(what.begin(),
              {std::string(TRIGPOINT_BIN_DIR) + "/bus_peer_" + backend::name(),
               std::to_string(config.domain_id)});
  return what;
}

TEST(KilledProcess, is_noticed_within_its_lease) {
  constexpr auto kNoticeLimit = 3s;  // lease of 2 s and a busy machine
  const Config config = own_domain();
  const tests::Command peer(peer_command(config, {"fix"}));
  Participant participant(config, "parent");
  Collected<std::string> lost;
  Collected<std::string> writers;
  Subscription<sensor_msgs::msg::NavSatFix> subscription(
      participant,
      topics::fix,
      [](const auto&, const MessageInfo&) {},
      {[&](const std::string& guid) { writers.add(guid); },
       [&](const std::string& guid) { lost.add(guid); },
       {}});
  ASSERT_TRUE(writers.wait_for(1));
  peer.signal(SIGKILL);
  const auto killed = std::chrono::steady_clock::now();
  ASSERT_TRUE(lost.wait_for(1));
  EXPECT_LE(std::chrono::steady_clock::now() - killed, kNoticeLimit);
  EXPECT_EQ(lost.items(), writers.items());
}

TEST(StoppedReader, holds_no_writer_back) {
  constexpr int kClouds = 100;
  constexpr auto kLimit = 5s;  // held back for 0.1 s each they would take 10 s
  Config config = own_domain();
  config.lease_s = 60.0;
  const tests::Command peer(peer_command(config, {"hear", "points"}));
  Participant participant(config, "parent");
  Readers readers;
  Publisher publisher(participant, topics::points, readers.events());
  ASSERT_TRUE(readers.wait_for(1));
  peer.signal(SIGSTOP);
  PointCloudMessage cloud = samples::cloud();
  cloud.data.resize(200'000);
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < kClouds; ++i) {
    EXPECT_TRUE(publisher.publish(to_message(cloud)));
  }
  EXPECT_LE(std::chrono::steady_clock::now() - begin, kLimit);
  EXPECT_EQ(publisher.matched(), 1);
}

TEST(SmallBuffers, are_told_with_their_size_and_the_remedy) {
  Collected<Event> events;
  Participant participant(small_buffers(), "small", [&](const Event& event) { events.add(event); });
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events.items()[0].code, "bus_small_socket_buffers");
  EXPECT_THAT(events.items()[0].text, ::testing::HasSubstr("212992"));
  EXPECT_THAT(events.items()[0].text, ::testing::HasSubstr("net.core.rmem_max"));
}

TEST(SmallBuffers, still_carry_every_two_megabyte_cloud_and_imu_sample) {
  constexpr std::uint32_t kClouds = 40;
  constexpr auto kCloudPeriod = 100ms;
  constexpr auto kImuPeriod = 5ms;
  Participant sensors(small_buffers(), "sensors");
  Participant mapper(small_buffers(), "mapper");
  Collected<std::uint32_t> clouds;
  std::atomic<std::uint32_t> damaged{0};
  std::atomic<int> imu_heard{0};
  Subscription<sensor_msgs::msg::PointCloud2> cloud_reader(
      mapper, topics::points, [&](const auto& cloud, const MessageInfo&) {
        damaged += cloud.data() != two_megabytes(cloud.height()).data ? 1U : 0U;
        clouds.add(cloud.height());
      });
  Subscription<sensor_msgs::msg::Imu> imu_reader(
      mapper, topics::imu, [&](const auto&, const MessageInfo&) { ++imu_heard; });
  Readers cloud_readers;
  Readers imu_readers;
  Publisher cloud_writer(sensors, topics::points, cloud_readers.events());
  Publisher imu_writer(sensors, topics::imu, imu_readers.events());
  ASSERT_TRUE(cloud_readers.wait_for(1) && imu_readers.wait_for(1));

  std::atomic<bool> ended{false};
  int imu_sent = 0;
  std::thread imu([&] {
    for (auto due = std::chrono::steady_clock::now(); !ended; due += kImuPeriod) {
      std::this_thread::sleep_until(due);
      imu_sent += imu_writer.publish(to_message(samples::imu())) ? 1 : 0;
    }
  });
  auto due = std::chrono::steady_clock::now();
  for (std::uint32_t number = 0; number < kClouds; ++number) {
    std::this_thread::sleep_until(due += kCloudPeriod);
    EXPECT_TRUE(cloud_writer.publish(to_message(two_megabytes(number))));
  }
  EXPECT_TRUE(cloud_writer.wait_for_acknowledgments(kForever));
  ended = true;
  imu.join();
  EXPECT_TRUE(imu_writer.wait_for_acknowledgments(kForever));
  EXPECT_TRUE(clouds.wait_for(kClouds)) << clouds.size() << " of " << kClouds << " clouds arrived";
  EXPECT_EQ(damaged, 0U);
  EXPECT_EQ(imu_heard, imu_sent);
}

/// `shared_memory` is the writer's only, so that its clouds go over UDP all the same.
void expect_goes_on_when_readers_leave(int leaving_readers, bool shared_memory) {
  Config config = own_domain();
  config.datagram_bytes = 1472;
  config.heartbeat_s = 0.01;
  config.bulk_bytes_per_s = 1'000'000'000;
  Config lossy = config;  // much is lost, so that repairs are under way when the reader leaves
  lossy.socket_buffer_bytes = 131'072;
  Config writing_config = config;
  writing_config.shared_memory = shared_memory;
  Participant sensors(writing_config, "sensors");
  Participant mapper(config, "mapper");
  Participant other(lossy, "other");
  Publisher clouds(sensors, topics::points);
  Collected<std::uint32_t> staying_heard;
  const Subscription<sensor_msgs::msg::PointCloud2> staying(
      mapper, topics::points, [&](const auto& cloud, const MessageInfo&) {
        staying_heard.add(cloud.height());
      });
  std::atomic<bool> ended{false};
  std::atomic<int> written{0};
  std::thread writing([&] {
    for (auto due = std::chrono::steady_clock::now(); !ended; due += 20ms) {
      std::this_thread::sleep_until(due);
      clouds.publish(to_message(two_megabytes(0)));
      ++written;
    }
  });
  for (int i = 0; i < leaving_readers; ++i) {
    {
      const Subscription<sensor_msgs::msg::PointCloud2> leaving(
          other, topics::points, [](const auto&, const MessageInfo&) {});
      std::this_thread::sleep_for(std::chrono::milliseconds(200 + 7 * i % 20));
    }
    const int before = written;
    const auto deadline = std::chrono::steady_clock::now() + kForever;
    while (written < before + 2) {
      if (std::chrono::steady_clock::now() > deadline) {
        std::cerr << "the writer hangs since reader " << i << " left, and cannot be destroyed\n";
        std::abort();
      }
      std::this_thread::sleep_for(10ms);
    }
  }
  ended = true;
  writing.join();
  EXPECT_GT(staying_heard.size(), 0U);
}

TEST(PacedWriter, goes_on_when_readers_leave_in_the_middle_of_a_cloud) {
  expect_goes_on_when_readers_leave(30, false);
}

// With shared memory, as with security, Fast DDS's own flow controller paces.
TEST(PacedWriter, goes_on_when_readers_leave_and_the_middleware_paces) {
  if (std::string(backend::name()) != "fastdds") {
    GTEST_SKIP() << "Fast DDS only";
  }
  expect_goes_on_when_readers_leave(60, true);
}

diagnostic_msgs::msg::DiagnosticArray diagnostics_of(std::size_t bytes) {
  diagnostic_msgs::msg::DiagnosticArray message;
  message.status().resize(1);
  message.status().front().message(std::string(bytes, 'x'));
  return message;
}

TEST(SmallTopics, have_small_messages_in_both_directions) {
  constexpr std::size_t kTooLarge_bytes = 1'100'000;
  constexpr std::size_t kAllowed_bytes = 900'000;
  auto without_limit = topics::diagnostics;
  without_limit.qos = without_limit.qos.with_depth(1).as_bulk();
  Collected<Event> events;
  Collected<std::size_t> heard;
  Participant here(own_domain(), "here", [&](const Event& event) { events.add(event); });
  Participant there(own_domain(), "there");
  Readers readers;
  const Subscription<diagnostic_msgs::msg::DiagnosticArray> subscription(
      there, topics::diagnostics, [&](const auto& message, const MessageInfo&) {
        heard.add(message.status().front().message().size());
      });
  Publisher limited(here, topics::diagnostics);
  EXPECT_FALSE(limited.publish(diagnostics_of(kTooLarge_bytes)));
  const auto told = events.items();
  EXPECT_TRUE(std::any_of(told.begin(), told.end(), [](const Event& event) {
    return event.code == "bus_sample_not_sent";
  }));
  Publisher unlimited(here, without_limit, readers.events());
  ASSERT_TRUE(readers.wait_for(1));
  for (const std::size_t bytes : {kAllowed_bytes, kTooLarge_bytes, kAllowed_bytes}) {
    const std::size_t before = heard.size();
    EXPECT_TRUE(unlimited.publish(diagnostics_of(bytes)));
    if (bytes == kAllowed_bytes) {
      ASSERT_TRUE(heard.wait_for(before + 1));
    }
  }
  EXPECT_THAT(heard.items(), ::testing::Each(kAllowed_bytes));
}

/// Files in /dev/shm that this process has mapped.
std::size_t shared_files() {
  const std::string maps = tests::read_file("/proc/self/maps");
  std::size_t files = 0;
  for (auto at = maps.find("/dev/shm/"); at != std::string::npos;
       at = maps.find("/dev/shm/", at + 1)) {
    ++files;
  }
  return files;
}

TEST(SharedMemory, is_used_only_when_asked_for_and_carries_clouds) {
  if (std::string(backend::name()) != "fastdds") {
    GTEST_SKIP() << "Fast DDS only";
  }
  constexpr std::uint32_t kClouds = 20;
  for (const bool wanted : {false, true}) {
    Config config = own_domain();
    config.shared_memory = wanted;
    Participant here(config, "here");
    Participant there(config, "there");
    Collected<std::uint32_t> heard;
    Readers readers;
    Subscription<sensor_msgs::msg::PointCloud2> subscription(
        there, topics::points, [&](const auto& cloud, const MessageInfo&) {
          heard.add(cloud.data().size() == 2'000'000 ? cloud.height() : 0);
        });
    Publisher publisher(here, topics::points, readers.events());
    ASSERT_TRUE(readers.wait_for(1));
    EXPECT_EQ(shared_files() > 0, wanted);
    for (std::uint32_t number = 1; number <= kClouds; ++number) {
      publisher.publish(to_message(two_megabytes(number)));
      ASSERT_TRUE(heard.wait_for(number));
    }
    EXPECT_EQ(heard.items().back(), kClouds);
  }
}

TEST(NetworkInterface, that_does_not_exist_is_refused_with_those_that_do) {
  Config config = own_domain();
  config.network_interface = "wlan77";
  try {
    Participant participant(config, "wrong");
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("wlan77"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("lo (127.0.0.1)"));
  }
}

TEST(InitialPeers, that_are_no_addresses_are_refused) {
  for (const char* peer : {"robot", "10.0.0.300", "10.0.0.2:0", "10.0.0.2:70000"}) {
    Config config = own_domain();
    config.initial_peers = {peer};
    EXPECT_THROW(Participant(config, "wrong"), std::runtime_error) << peer;
  }
}

}  // namespace
}  // namespace trigpoint::bus
