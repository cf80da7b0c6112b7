// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The parts of the Cyclone DDS backend that need no bus.
#include "cyclonedds/buffer_pool.hpp"
#include "cyclonedds/domain_config.hpp"
#include "cyclonedds/pacer.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace trigpoint::bus::cyclonedds {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(BufferPool, gives_a_large_buffer_again) {
  BufferPool pool;
  Buffer first = pool.take(2'000'000);
  const std::uint8_t* address = first.bytes.get();
  pool.give_back(std::move(first));
  EXPECT_EQ(pool.take(2'100'000).bytes.get(), address);  // the next cloud is a little larger
}

TEST(BufferPool, gives_no_buffer_that_is_too_small_or_far_too_large) {
  BufferPool pool;
  pool.give_back(pool.take(1'000'000));
  EXPECT_GE(pool.take(2'000'000).capacity, 2'000'000U);
  EXPECT_LT(pool.take(100'000).capacity, 1'000'000U);
}

TEST(BufferPool, keeps_a_bounded_number_of_bytes) {
  constexpr std::size_t kMost_bytes = 64'000'000;
  constexpr std::size_t kSize_bytes = 3'000'000;
  BufferPool pool;
  std::vector<Buffer> taken;
  for (int i = 0; i < 100; ++i) {
    taken.push_back(pool.take(kSize_bytes));
  }
  const std::size_t each_bytes = taken.front().capacity;
  for (Buffer& buffer : taken) {
    pool.give_back(std::move(buffer));
  }
  EXPECT_LE(pool.kept_bytes(), kMost_bytes);
  EXPECT_GT(pool.kept_bytes(), kMost_bytes - each_bytes);
}

TEST(Pacer, lets_its_thread_send_one_portion_a_period) {
  constexpr auto kPeriod = 10ms;
  constexpr int kPortions = 5;
  Pacer pacer(1000, kPeriod);
  const auto begin = std::chrono::steady_clock::now();
  for (int datagram = 0; datagram < 2 * kPortions; ++datagram) {
    pacer.before_sending(500);
  }
  EXPECT_GE(std::chrono::steady_clock::now() - begin, (kPortions - 1) * kPeriod);
}

TEST(Pacer, holds_back_no_other_thread) {
  Pacer pacer(1000, 1h);
  std::thread other([&] {
    for (int datagram = 0; datagram < 100; ++datagram) {
      pacer.before_sending(1000);
    }
  });
  other.join();  // not in an hour
}

TEST(Pacer, lets_a_datagram_pass_that_is_larger_than_a_portion) {
  Pacer pacer(1000, 1ms);
  pacer.before_sending(64'000);
  pacer.before_sending(64'000);
}

TEST(DomainConfig, names_the_interface_the_domain_and_the_lease) {
  Config config;
  config.domain_id = 42;
  config.network_interface = "lo";
  config.lease_s = 2.0;
  const std::string xml = domain_config(config, {4'194'304, 4'194'304});
  EXPECT_THAT(xml, HasSubstr("<NetworkInterface address=\"127.0.0.1\" multicast=\"true\"/>"));
  EXPECT_THAT(xml, HasSubstr("<ExternalDomainId>42</ExternalDomainId>"));
  EXPECT_THAT(xml, HasSubstr("<LeaseDuration>2000ms</LeaseDuration>"));
  EXPECT_THAT(xml, Not(HasSubstr("<Peers>")));
}

TEST(DomainConfig, keeps_a_fragment_within_a_datagram) {
  Config config;
  config.network_interface = "lo";
  config.datagram_bytes = 1472;
  const std::string xml = domain_config(config, {4'194'304, 4'194'304});
  EXPECT_THAT(xml, HasSubstr("<MaxMessageSize>1472B</MaxMessageSize>"));
  EXPECT_THAT(xml, HasSubstr("<FragmentSize>1344B</FragmentSize>"));  // as measured: no IP fragment
}

TEST(DomainConfig, looks_for_every_process_of_a_peer_without_port) {
  Config config;
  config.domain_id = 1;
  config.network_interface = "lo";
  config.initial_peers = {"10.0.0.2", "10.0.0.3:7777"};
  const std::string xml = domain_config(config, {4'194'304, 4'194'304});
  EXPECT_THAT(xml, HasSubstr("<Peer address=\"10.0.0.2:7660\"/>"));  // 7400 + 250 + 10
  EXPECT_THAT(xml, HasSubstr("<Peer address=\"10.0.0.2:7698\"/>"));  // the twentieth
  EXPECT_THAT(xml, HasSubstr("<Peer address=\"10.0.0.3:7777\"/>"));
}

TEST(DomainConfig, limits_bursts_of_repair_only_where_buffers_are_small) {
  Config config;
  config.network_interface = "lo";
  EXPECT_THAT(domain_config(config, {212'992, 212'992}),
              HasSubstr("<MaxRexmit>141994B</MaxRexmit>"));
  EXPECT_THAT(domain_config(config, {4'194'304, 4'194'304}), Not(HasSubstr("MaxRexmit>141994")));
}

}  // namespace
}  // namespace trigpoint::bus::cyclonedds
