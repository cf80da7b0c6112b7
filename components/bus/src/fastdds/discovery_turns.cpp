// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "discovery_turns.hpp"

#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/TransportReceiverInterface.h>
#include <fastrtps/utils/IPLocator.h>

#include <chrono>
#include <utility>

namespace trigpoint::bus::fastdds {

namespace {

namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::LocatorsIterator;
using eprosima::fastrtps::rtps::octet;
using eprosima::fastrtps::rtps::SenderResource;

/// Of RTPS's ports those with even numbers are for discovery, those with odd ones for data
/// (DDSI-RTPS 2.3, 9.6.1: d0 = 0 and d1 = 10, d2 = 1 and d3 = 11, all gains even).
bool is_for_discovery(const Locator_t& local) {
  return IPLocator::getPhysicalPort(local) % 2 == 0;
}

class TurnsTransport : public rtps::ChainingTransport {
 public:
  TurnsTransport(const rtps::ChainingTransportDescriptor& descriptor,
                 std::shared_ptr<std::mutex> turn)
      : ChainingTransport(descriptor), turn_(std::move(turn)) {}

  rtps::TransportDescriptorInterface* get_configuration() override {
    return low_level_transport_->get_configuration();
  }

  bool send(SenderResource* low_level,
            const octet* bytes,
            std::uint32_t size,
            LocatorsIterator* begin,
            LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& timeout) override {
    return low_level->send(bytes, size, begin, end, timeout);
  }

  void receive(rtps::TransportReceiverInterface* next,
               const octet* bytes,
               std::uint32_t size,
               const Locator_t& local,
               const Locator_t& remote) override {
    std::unique_lock lock(*turn_, std::defer_lock);
    if (is_for_discovery(local)) {
      lock.lock();
    }
    next->OnDataReceived(bytes, size, local, remote);
  }

 private:
  const std::shared_ptr<std::mutex> turn_;
};

struct TurnsDescriptor : rtps::ChainingTransportDescriptor {
  TurnsDescriptor(std::shared_ptr<rtps::TransportDescriptorInterface> low_level,
                  std::shared_ptr<std::mutex> turn)
      : ChainingTransportDescriptor(std::move(low_level)), turn_(std::move(turn)) {}

  rtps::TransportInterface* create_transport() const override {
    return new TurnsTransport(*this, turn_);  // Fast DDS owns it
  }

 private:
  std::shared_ptr<std::mutex> turn_;
};

}  // namespace

std::shared_ptr<rtps::TransportDescriptorInterface> one_discovery_at_a_time(
    std::shared_ptr<rtps::TransportDescriptorInterface> transport,
    std::shared_ptr<std::mutex> turn) {
  return std::make_shared<TurnsDescriptor>(std::move(transport), std::move(turn));
}

}  // namespace trigpoint::bus::fastdds
