// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What comes for discovery is handed on one at a time, over all transports, and data is not held
// up.
#include "fastdds/discovery_turns.hpp"

#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/TransportReceiverInterface.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <thread>

namespace trigpoint::bus::fastdds {
namespace {

namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::octet;
using namespace std::chrono_literals;

constexpr std::uint32_t kMulticastDiscovery = 7400 + 250 * 7;
constexpr std::uint32_t kDiscovery = kMulticastDiscovery + 10 + 2 * 3;
constexpr std::uint32_t kData = kDiscovery + 1;

/// Stays in a datagram until another is in one too, or for so long.
class Meeting : public rtps::TransportReceiverInterface {
 public:
  explicit Meeting(std::chrono::milliseconds patience) : patience_(patience) {}

  void OnDataReceived(const octet*, std::uint32_t, const Locator_t&, const Locator_t&) override {
    std::unique_lock lock(mutex_);
    ++inside_;
    most_inside_ = std::max(most_inside_, inside_);
    changed_.notify_all();
    changed_.wait_for(lock, patience_, [this] { return most_inside_ > 1; });
    --inside_;
    ++handed_on_;
  }

  int most_inside() const { return most_inside_; }

  int handed_on() const { return handed_on_; }

 private:
  const std::chrono::milliseconds patience_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int inside_{0};
  int most_inside_{0};
  int handed_on_{0};
};

struct Transport {
  explicit Transport(const std::shared_ptr<std::mutex>& turn)
      : descriptor(
            one_discovery_at_a_time(std::make_shared<rtps::UDPv4TransportDescriptor>(), turn)),
        transport(descriptor->create_transport()) {}

  void receive(Meeting& meeting, std::uint32_t port) const {
    const Locator_t local(port);
    dynamic_cast<rtps::ChainingTransport&>(*transport)
        .receive(&meeting, nullptr, 0, local, Locator_t());
  }

  std::shared_ptr<rtps::TransportDescriptorInterface> descriptor;
  std::unique_ptr<rtps::TransportInterface> transport;
};

class DiscoveryTurns : public ::testing::Test {
 protected:
  void receive_at_once(Meeting& meeting, std::uint32_t port, std::uint32_t other_port) const {
    std::thread other([&] { other_.receive(meeting, other_port); });
    one_.receive(meeting, port);
    other.join();
  }

 private:
  const std::shared_ptr<std::mutex> turn_ = std::make_shared<std::mutex>();
  const Transport one_{turn_};
  const Transport other_{turn_};
};

TEST_F(DiscoveryTurns, are_taken_by_ports_of_discovery_of_all_transports) {
  Meeting meeting(200ms);
  receive_at_once(meeting, kDiscovery, kMulticastDiscovery);
  EXPECT_EQ(meeting.handed_on(), 2);
  EXPECT_EQ(meeting.most_inside(), 1);
}

TEST_F(DiscoveryTurns, do_not_hold_up_data) {
  Meeting meeting(30s);
  receive_at_once(meeting, kDiscovery, kData);
  EXPECT_EQ(meeting.most_inside(), 2);
}

}  // namespace
}  // namespace trigpoint::bus::fastdds
