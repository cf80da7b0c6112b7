// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "limited_transport.hpp"

#include "../rtps_limits.hpp"
#include "channels.hpp"
#include <fastdds/rtps/common/LocatorList.hpp>
#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/TransportReceiverInterface.h>

#include <utility>

namespace trigpoint::bus::fastdds {

namespace {

namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::LocatorsIterator;
using eprosima::fastrtps::rtps::octet;
using eprosima::fastrtps::rtps::SenderResource;

class LimitedTransport : public rtps::ChainingTransport {
 public:
  explicit LimitedTransport(const rtps::ChainingTransportDescriptor& descriptor)
      : ChainingTransport(descriptor), low_level_descriptor_(descriptor.low_level_descriptor) {}

  rtps::TransportDescriptorInterface* get_configuration() override {
    return low_level_descriptor_.get();
  }

  bool send(SenderResource* low_level,
            const octet* bytes,
            std::uint32_t size,
            LocatorsIterator* begin,
            LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& timeout) override {
    const Reach reach = channels_.reach_of(*low_level);
    if (reach == Reach::kAll) {
      return low_level->send(bytes, size, begin, end, timeout);
    }
    rtps::LocatorList served;
    for (LocatorsIterator& to = *begin; to != *end; ++to) {
      if (serves(reach, *to)) {
        served.push_back(*to);
      }
    }
    rtps::Locators first(served.begin());
    rtps::Locators after(served.end());
    return served.empty() || low_level->send(bytes, size, &first, &after, timeout);
  }

  void receive(rtps::TransportReceiverInterface* next,
               const octet* bytes,
               std::uint32_t size,
               const Locator_t& local,
               const Locator_t& remote) override {
    if (!announces_more_than({bytes, size}, kLargestMessage_bytes)) {
      next->OnDataReceived(bytes, size, local, remote);
    }
  }

 private:
  std::shared_ptr<rtps::TransportDescriptorInterface> low_level_descriptor_;
  Channels channels_;
};

struct LimitedDescriptor : rtps::ChainingTransportDescriptor {
  using ChainingTransportDescriptor::ChainingTransportDescriptor;

  rtps::TransportInterface* create_transport() const override {
    return new LimitedTransport(*this);  // Fast DDS owns it
  }
};

}  // namespace

std::shared_ptr<rtps::TransportDescriptorInterface> limited(
    std::shared_ptr<rtps::TransportDescriptorInterface> transport) {
  return std::make_shared<LimitedDescriptor>(std::move(transport));
}

}  // namespace trigpoint::bus::fastdds
