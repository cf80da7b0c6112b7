// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fastdds/bulk_queue.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

namespace trigpoint::bus::fastdds {
namespace {

using eprosima::fastdds::rtps::LocatorList;
using eprosima::fastrtps::rtps::SenderResource;
using namespace std::chrono_literals;

constexpr EntityNumber kClouds = 0x00000103;
constexpr EntityNumber kImu = 0x00000203;
constexpr std::size_t kDatagram_bytes = 1000;
constexpr std::size_t kDepth = 3;

std::vector<std::uint8_t> message(std::uint8_t kind, std::size_t size) {
  std::vector<std::uint8_t> bytes{'R', 'T', 'P', 'S', 2, 3, 1, 15};
  bytes.resize(20);
  bytes.insert(bytes.end(), {kind, 1, 0, 0});
  bytes.resize(size);
  return bytes;
}

/// A fragment of a sample; `fragment` tells them apart.
std::vector<std::uint8_t> piece(EntityNumber writer, std::uint8_t number, std::uint8_t fragment) {
  auto bytes = message(Submessage::kDataFragment, kDatagram_bytes);
  bytes[20 + 14] = static_cast<std::uint8_t>(writer >> 8);
  bytes[20 + 15] = static_cast<std::uint8_t>(writer);
  bytes[20 + 20] = number;
  bytes[20 + 24] = fragment;
  return bytes;
}

std::vector<std::uint8_t> heartbeat(EntityNumber writer, std::uint8_t last) {
  auto bytes = message(Submessage::kHeartbeat, 52);
  bytes[20 + 10] = static_cast<std::uint8_t>(writer >> 8);
  bytes[20 + 11] = static_cast<std::uint8_t>(writer);
  bytes[20 + 16] = 1;  // the first
  bytes[20 + 24] = last;
  return bytes;
}

/// Keeps what is sent.
class Socket : public SenderResource {
 public:
  Socket() : SenderResource(LOCATOR_KIND_UDPv4) {
    send_lambda_ = [this](const auto* bytes, std::uint32_t size, auto*, auto*, const auto&) {
      const std::lock_guard lock(mutex_);
      sent_.emplace_back(bytes, bytes + size);
      return true;
    };
  }

  std::vector<std::vector<std::uint8_t>> sent() {
    const std::lock_guard lock(mutex_);
    return sent_;
  }

  bool has_sent(std::size_t count) {
    for (const auto end = std::chrono::steady_clock::now() + 10s; sent().size() < count;) {
      if (std::chrono::steady_clock::now() > end) {
        return false;
      }
      std::this_thread::sleep_for(1ms);
    }
    return true;
  }

 private:
  std::mutex mutex_;
  std::vector<std::vector<std::uint8_t>> sent_;
};

struct Bulk : testing::Test {
  Bulk() {
    to.push_back(eprosima::fastdds::rtps::Locator{});
    queue.add_writer(kClouds, kDepth);
  }

  ~Bulk() override { queue.stop(); }

  void write(std::uint8_t number, std::uint8_t fragments) {
    const BulkQueue::NewSample is_new;
    for (std::uint8_t i = 0; i < fragments; ++i) {
      queue.send(socket, piece(kClouds, number, i), to);
    }
  }

  Socket socket;
  LocatorList to;
  // Two datagrams a period, which is long enough to look at what happens in it.
  BulkQueue queue{Pacing{2 * kDatagram_bytes, 200ms}};
};

/// Else what is asked for in vain piles up, and what could still be repaired waits behind it.
TEST_F(Bulk, does_not_repair_what_the_writer_no_longer_keeps) {
  write(1, 2);
  ASSERT_TRUE(socket.has_sent(2));
  for (std::uint8_t fragment = 10; fragment < 15; ++fragment) {
    queue.send(socket, piece(kClouds, 1, fragment), to);
  }
  queue.send(socket, piece(kClouds, 2, 10), to);
  for (std::uint8_t number = 2; number < 2 + kDepth; ++number) {
    write(number, 1);
  }
  ASSERT_TRUE(socket.has_sent(3 + kDepth));  // repairs go first
  const auto sent = socket.sent();
  EXPECT_EQ(std::count(sent.begin(), sent.end(), piece(kClouds, 2, 10)), 1);
  for (std::uint8_t fragment = 10; fragment < 15; ++fragment) {
    EXPECT_EQ(std::count(sent.begin(), sent.end(), piece(kClouds, 1, fragment)), 0);
  }
}

TEST_F(Bulk, sends_new_clouds_in_portions_and_everything_else_at_once) {
  write(1, 5);
  ASSERT_TRUE(socket.has_sent(2));
  queue.send(socket, piece(kImu, 1, 0), to);
  ASSERT_EQ(socket.sent().size(), 3U);
  EXPECT_EQ(socket.sent().back(), piece(kImu, 1, 0));
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_TRUE(socket.has_sent(6));
  EXPECT_GT(std::chrono::steady_clock::now() - begin, 200ms);
}

TEST_F(Bulk, sends_what_is_asked_for_before_new_clouds) {
  write(1, 2);
  ASSERT_TRUE(socket.has_sent(2));
  write(2, 3);
  queue.send(socket, piece(kClouds, 1, 0), to);
  ASSERT_TRUE(socket.has_sent(3));
  EXPECT_EQ(socket.sent()[2], piece(kClouds, 1, 0));
}

TEST_F(Bulk, goes_on_with_new_clouds_when_much_is_asked_for) {
  write(1, 2);
  ASSERT_TRUE(socket.has_sent(2));
  write(2, 2);
  for (std::uint8_t i = 0; i < 10; ++i) {
    queue.send(socket, piece(kClouds, 1, i), to);
  }
  ASSERT_TRUE(socket.has_sent(4));
  EXPECT_EQ(socket.sent()[3], piece(kClouds, 2, 0));
}

TEST_F(Bulk, sends_once_what_is_asked_for_twice) {
  write(1, 2);
  ASSERT_TRUE(socket.has_sent(2));
  for (int i = 0; i < 3; ++i) {
    queue.send(socket, piece(kClouds, 1, 0), to);
  }
  ASSERT_TRUE(socket.has_sent(3));
  queue.send(socket, piece(kClouds, 1, 1), to);
  ASSERT_TRUE(socket.has_sent(4));
  EXPECT_EQ(socket.sent()[3], piece(kClouds, 1, 1));
}

TEST_F(Bulk, lets_no_heartbeat_tell_of_a_cloud_that_waits) {
  write(1, 2);
  ASSERT_TRUE(socket.has_sent(2));
  write(2, 1);
  queue.send(socket, heartbeat(kClouds, 2), to);
  EXPECT_EQ(socket.sent().back(), heartbeat(kClouds, 1));
  queue.send(socket, heartbeat(kImu, 2), to);
  EXPECT_EQ(socket.sent().back(), heartbeat(kImu, 2));
  ASSERT_TRUE(socket.has_sent(5));
  queue.send(socket, heartbeat(kClouds, 2), to);
  EXPECT_EQ(socket.sent().back(), heartbeat(kClouds, 2));
}

TEST_F(Bulk, counts_a_datagram_once_that_leaves_from_two_sockets) {
  Socket other;
  {
    const BulkQueue::NewSample is_new;
    for (std::uint8_t i = 0; i < 2; ++i) {
      queue.send(socket, piece(kClouds, 1, i), to);
      queue.send(other, piece(kClouds, 1, i), to);
    }
  }
  ASSERT_TRUE(socket.has_sent(2));
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_TRUE(other.has_sent(2));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 100ms);
}

TEST_F(Bulk, catches_up_when_it_was_held_up) {
  for (const auto catches_up : {0ms, 2000ms}) {
    Socket slow;
    BulkQueue late(Pacing{2 * kDatagram_bytes, 200ms}, catches_up);
    late.add_writer(kClouds, kDepth);
    const auto send = [&](std::uint8_t number, std::uint8_t fragments) {
      const BulkQueue::NewSample is_new;
      for (std::uint8_t i = 0; i < fragments; ++i) {
        late.send(slow, piece(kClouds, number, i), to);
      }
    };
    send(1, 2);
    ASSERT_TRUE(slow.has_sent(2));
    std::this_thread::sleep_for(700ms);  // of three periods nothing was sent
    const auto begin = std::chrono::steady_clock::now();
    send(2, 6);
    ASSERT_TRUE(slow.has_sent(8));
    const auto took = std::chrono::steady_clock::now() - begin;
    if (catches_up == 0ms) {
      EXPECT_GE(took, 350ms);  // two at once, two after one period, two after two
    } else {
      EXPECT_LT(took, 350ms);
    }
    late.stop();
  }
}

TEST_F(Bulk, of_more_clouds_than_may_wait_drops_the_oldest) {
  write(1, 2);
  ASSERT_TRUE(socket.has_sent(2));
  for (std::uint8_t number = 2; number <= 2 + kDepth; ++number) {
    write(number, 1);
  }
  ASSERT_TRUE(socket.has_sent(3));
  EXPECT_EQ(socket.sent()[2], piece(kClouds, 3, 0));
}

TEST_F(Bulk, forgets_what_waits_of_a_writer_that_goes) {
  write(1, 4);
  ASSERT_TRUE(socket.has_sent(2));
  queue.remove_writer(kClouds);
  std::this_thread::sleep_for(300ms);
  EXPECT_EQ(socket.sent().size(), 2U);
  queue.send(socket, heartbeat(kClouds, 1), to);
  EXPECT_EQ(socket.sent().back(), heartbeat(kClouds, 1));
}

}  // namespace
}  // namespace trigpoint::bus::fastdds
