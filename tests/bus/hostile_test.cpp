// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A stranger on the bus against the real mapper process: clouds that lie about their size, garbage,
// and fragments of a sample that would be gigabytes. It refuses them, says why, and goes on.
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "../unit/bus/samples.hpp"
#include "bus_fixture.hpp"
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

namespace trigpoint::bus {
namespace {

using testing::Collected;
using testing::kForever;
using testing::own_domain;
using testing::Readers;

using Bytes = std::vector<std::uint8_t>;

/// Resident; an idle mapper has about 40 MB.
constexpr std::uint64_t kMostMemory_kb = 200'000;

/// What unfinished samples may take beside that: rtps_limits.hpp.
constexpr std::uint64_t kIncomplete_kb = 512'000;
constexpr std::uint64_t kIncompleteSmall_kb = 64'000;

/// So that a mapper that falls for it ends, and not the computer.
constexpr char kAddressSpace[] = "--as=4000000000";

/// The mapper of the backend that this test is linked with.
std::string mapper_program() {
  const std::string bin = TRIGPOINT_BIN_DIR;
  const std::string other = bin + "/" + backend::name() + "/trigpoint_lio_mapper";
  return std::filesystem::exists(other) ? other : bin + "/trigpoint_lio_mapper";
}

class Hostile : public ::testing::Test {
 protected:
  Hostile() {
    tests::write_file(folder_.path("bus.yaml"),
                      "bus: {domain_id: " + std::to_string(own_domain().domain_id) +
                          ", network_interface: lo}\n");
    mapper_.emplace(std::vector<std::string>{
        "prlimit", kAddressSpace, mapper_program(), "--config", folder_.path("bus.yaml")});
  }

  /// kB that the mapper has used at most.
  std::uint64_t peak_memory_kb() const {
    std::ifstream status("/proc/" + std::to_string(mapper_->pid()) + "/status");
    for (std::string word; status >> word;) {
      if (std::uint64_t kb = 0; word == "VmHWM:" && status >> kb) {
        return kb;
      }
    }
    return 0;
  }

  /// The mapper knows our writer of clouds, which has no more to repair.
  bool is_heard() {
    if (!readers_.wait_for(1)) {
      return false;
    }
    clouds_.publish(to_message(PointCloudMessage{}));
    return refused_.wait_for("cloud_without_points") && clouds_.wait_for_acknowledgments(kForever);
  }

  /// Published again and again, since the first sample after a match may be lost.
  void expect_refused(const std::map<std::string, PointCloudMessage>& by_reason,
                      std::uint64_t more_memory_kb = 0) {
    ASSERT_TRUE(readers_.wait_for(1)) << mapper_->output_so_far();
    for (const auto& [reason, cloud] : by_reason) {
      for (int again = 0; again < 3; ++again) {
        clouds_.publish(to_message(cloud));
      }
      EXPECT_TRUE(refused_.wait_for(reason)) << reason << "\n" << mapper_->output_so_far();
    }
    EXPECT_TRUE(mapper_->running()) << mapper_->output_so_far();
    EXPECT_LT(peak_memory_kb(), kMostMemory_kb + more_memory_kb);
  }

  /// Reasons that the mapper has given.
  class Reasons {
   public:
    void add(const LioStatus& status) {
      const std::lock_guard lock(mutex_);
      for (const NamedCount& refused : status.scans_refused) {
        reasons_.insert(refused.name);
      }
      changed_.notify_all();
    }

    bool wait_for(const std::string& wanted) {
      std::unique_lock lock(mutex_);
      return changed_.wait_for(lock, kForever, [&] { return reasons_.contains(wanted); });
    }

   private:
    std::mutex mutex_;
    std::condition_variable changed_;
    std::set<std::string> reasons_;
  };

  const tests::TemporaryFolder folder_;
  std::optional<tests::Command> mapper_;
  Reasons refused_;
  Participant stranger_{own_domain(), "stranger"};
  Readers readers_;
  Publisher<sensor_msgs::msg::PointCloud2> clouds_{stranger_, topics::points, readers_.events()};
  Subscription<trigpoint_msgs::msg::LioStatus> status_{
      stranger_,
      topics::lio_status,
      [this](const auto& message, const MessageInfo&) { refused_.add(from_message(message)); }};
};

/// With one thing about it changed.
template <class Change>
PointCloudMessage cloud_with(Change change) {
  PointCloudMessage cloud = to_cloud_message(
      {{1.0F, 2.0F, 3.0F, 0.0F}, {3.0F, 2.0F, 1.0F, 0.0F}}, 1'000'000'000, "lidar");
  change(cloud);
  return cloud;
}

TEST_F(Hostile, clouds_that_lie_about_their_size_are_refused_with_the_reason) {
  expect_refused({
      {"bad_row_step", cloud_with([](auto& c) { c.row_step = 31; })},
      {"cloud_too_large", cloud_with([](auto& c) { c.width = 0xFFFFFFFFU; })},
      {"truncated_data", cloud_with([](auto& c) { c.row_step = 0xFFFFFFFFU; })},
      {"cloud_without_points", cloud_with([](auto& c) { c.width = 0; })},
      {"field_outside_point", cloud_with([](auto& c) { c.fields[2].offset = 0xFFFFFFFFU; })},
  });
}

TEST_F(Hostile, garbage_is_dropped) {
  Readers readers;
  SerializedPublisher garbage(stranger_,
                              std::string(topics::points.name),
                              "sensor_msgs/msg/PointCloud2",
                              topics::points.qos,
                              readers.events());
  ASSERT_TRUE(readers.wait_for(1)) << mapper_->output_so_far();
  std::mt19937 random(7);
  for (int round = 0; round < 300; ++round) {
    Bytes bytes{0, 1, 0, 0};  // little-endian CDR
    bytes.resize(4 + random() % 5000);
    std::generate(
        bytes.begin() + 4, bytes.end(), [&] { return static_cast<std::uint8_t>(random()); });
    garbage.publish(bytes);
  }
  Bytes huge_length{0, 1, 0, 0};
  huge_length.resize(64, 0xFF);  // every length is 4 GB
  garbage.publish(huge_length);
  garbage.publish(Bytes{0, 1, 0, 0});
  EXPECT_TRUE(garbage.wait_for_acknowledgments(kForever));
  expect_refused({{"big_endian", cloud_with([](auto& c) { c.is_bigendian = true; })}});
}

// ---- fragments ----------------------------------------------------------------------------------

void append_bytes(Bytes& bytes, std::initializer_list<int> values) {
  for (const int value : values) {
    bytes.push_back(static_cast<std::uint8_t>(value));
  }
}

template <class Number>
void append(Bytes& bytes, Number number) {
  for (std::size_t i = 0; i < sizeof number; ++i) {
    bytes.push_back(static_cast<std::uint8_t>(number >> (8 * i)));
  }
}

/// One RTPS datagram of the writer with that GUID: the first fragment of a sample of so many bytes
/// (RTPS 2.3, 8.3.7.3 DATA_FRAG and 9.4.5.4).
Bytes first_fragment(const std::string& guid, std::uint32_t number, std::uint32_t sample_bytes) {
  constexpr std::uint16_t kFragment_bytes = 1024;
  Bytes packet;
  append_bytes(packet, {'R', 'T', 'P', 'S', 2, 3, 1, 15});
  Bytes id;
  for (std::size_t i = 0; i + 1 < guid.size(); i += 2) {
    id.push_back(static_cast<std::uint8_t>(std::stoi(guid.substr(i, 2), nullptr, 16)));
  }
  packet.insert(packet.end(), id.begin(), id.begin() + 12);
  append_bytes(packet, {0x16, 0x01});  // DATA_FRAG, little-endian
  append<std::uint16_t>(packet, 32 + kFragment_bytes);
  append<std::uint16_t>(packet, 0);
  append<std::uint16_t>(packet, 28);  // to the payload
  append<std::uint32_t>(packet, 0);   // every reader
  packet.insert(packet.end(), id.begin() + 12, id.end());
  append<std::uint32_t>(packet, 0);
  append<std::uint32_t>(packet, number);
  append<std::uint32_t>(packet, 1);  // fragment
  append<std::uint16_t>(packet, 1);  // one of them
  append<std::uint16_t>(packet, kFragment_bytes);
  append<std::uint32_t>(packet, sample_bytes);
  append_bytes(packet, {0, 1, 0, 0});  // little-endian CDR
  packet.resize(packet.size() + kFragment_bytes - 4, 0x55);
  return packet;
}

/// To every port on which a participant of our domain may take data.
void send_to_all(const Bytes& packet) {
  const int sender = socket(AF_INET, SOCK_DGRAM, 0);
  for (int participant = 0; participant < 10; ++participant) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port = htons(
        static_cast<std::uint16_t>(7400 + 250 * own_domain().domain_id + 11 + 2 * participant));
    sendto(
        sender, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  }
  close(sender);
}

TEST_F(Hostile, fragments_of_a_sample_of_gigabytes_take_no_memory) {
  ASSERT_TRUE(readers_.wait_for(1)) << mapper_->output_so_far();
  for (std::uint32_t i = 0; i < 8; ++i) {
    send_to_all(first_fragment(clouds_.guid(), 1 + i, 0xFFFFFFF0U >> (i / 2)));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  for (int i = 0; i < 20; ++i) {  // past the numbers that were forged
    clouds_.publish(to_message(cloud_with([](auto& c) { c.width = 0; })));
  }
  expect_refused({{"big_endian", cloud_with([](auto& c) { c.is_bigendian = true; })}});
}

/// A HEARTBEAT that the writer has nothing before `first`, of a count that is older than the last.
Bytes stale_heartbeat(const std::string& guid, std::uint32_t first) {
  Bytes packet = first_fragment(guid, 1, 1);
  const Bytes writer(packet.begin() + 32, packet.begin() + 36);
  packet.resize(20);
  append_bytes(packet, {0x07, 0x03});
  append<std::uint16_t>(packet, 28);
  append<std::uint32_t>(packet, 0);
  packet.insert(packet.end(), writer.begin(), writer.end());
  for (const std::uint32_t word : {0U, first, 0U, first + 10, 0U}) {
    append<std::uint32_t>(packet, word);
  }
  return packet;
}

constexpr std::uint32_t kJustAllowed_bytes = 255'000'000;
constexpr std::uint32_t kManySamples = 60;
constexpr std::chrono::milliseconds kBetween{5};  // so that its socket has room for all

TEST_F(Hostile, fragments_of_many_samples_just_below_the_limit_take_no_more_than_a_bound) {
  ASSERT_TRUE(is_heard()) << mapper_->output_so_far();
  for (std::uint32_t i = 1; i <= kManySamples; ++i) {
    send_to_all(first_fragment(clouds_.guid(), 100 + i, kJustAllowed_bytes));
    std::this_thread::sleep_for(kBetween);
  }
  expect_refused({{"big_endian", cloud_with([](auto& c) { c.is_bigendian = true; })}},
                 kIncomplete_kb);
}

TEST_F(Hostile, samples_that_a_stale_heartbeat_takes_back_keep_their_room) {
  constexpr std::uint32_t kSamples = 20;
  ASSERT_TRUE(is_heard()) << mapper_->output_so_far();
  for (std::uint32_t i = 1; i <= kSamples; ++i) {
    send_to_all(first_fragment(clouds_.guid(), 10 + i, kJustAllowed_bytes));
    send_to_all(stale_heartbeat(clouds_.guid(), 11 + i));
    std::this_thread::sleep_for(kBetween);
  }
  for (std::uint32_t i = 0; i < 10 + kSamples; ++i) {  // past the numbers that were forged
    clouds_.publish(to_message(cloud_with([](auto& c) { c.width = 0; })));
  }
  expect_refused({{"big_endian", cloud_with([](auto& c) { c.is_bigendian = true; })}},
                 kIncomplete_kb);
}

TEST_F(Hostile, fragments_of_large_imu_samples_take_no_more_than_a_small_bound) {
  Readers readers;
  const Publisher imu(stranger_, topics::imu, readers.events());
  ASSERT_TRUE(readers.wait_for(1)) << mapper_->output_so_far();
  for (const std::uint32_t bytes : {kJustAllowed_bytes, 999'000U}) {
    for (std::uint32_t i = 1; i <= 5 * kManySamples; ++i) {
      send_to_all(first_fragment(imu.guid(), bytes / 1000 + i, bytes));
      std::this_thread::sleep_for(kBetween / 5);
    }
  }
  expect_refused({{"big_endian", cloud_with([](auto& c) { c.is_bigendian = true; })}},
                 kIncompleteSmall_kb);
}

}  // namespace
}  // namespace trigpoint::bus
