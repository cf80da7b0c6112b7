// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "limited_transport.hpp"

#include "../incoming_samples.hpp"
#include "bulk_queue.hpp"
#include "channels.hpp"
#include <fastdds/rtps/common/LocatorList.hpp>
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

class LimitedTransport : public rtps::ChainingTransport {
 public:
  LimitedTransport(const rtps::ChainingTransportDescriptor& descriptor,
                   std::shared_ptr<BulkQueue> bulk,
                   Incoming incoming)
      : ChainingTransport(descriptor),
        low_level_descriptor_(descriptor.low_level_descriptor),
        bulk_(std::move(bulk)),
        incoming_(std::move(incoming)) {}

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
    if (reach == Reach::kAll && bulk_ == nullptr) {
      return low_level->send(bytes, size, begin, end, timeout);
    }
    rtps::LocatorList served;
    for (LocatorsIterator& to = *begin; to != *end; ++to) {
      if (serves(reach, *to)) {
        served.push_back(*to);
      }
    }
    if (served.empty()) {
      return true;
    }
    if (bulk_ != nullptr) {
      return bulk_->send(*low_level, {bytes, size}, served);
    }
    rtps::Locators first(served.begin());
    rtps::Locators after(served.end());
    return low_level->send(bytes, size, &first, &after, timeout);
  }

  void receive(rtps::TransportReceiverInterface* next,
               const octet* bytes,
               std::uint32_t size,
               const Locator_t& local,
               const Locator_t& remote) override {
    const auto verdict = incoming_.samples->judge({bytes, size}, std::chrono::steady_clock::now());
    if (verdict.passes()) {
      next->OnDataReceived(bytes, size, local, remote);
    } else if (verdict.is_refused) {
      incoming_.refused(IPLocator::ip_to_string(remote));
    }
  }

 private:
  std::shared_ptr<rtps::TransportDescriptorInterface> low_level_descriptor_;
  std::shared_ptr<BulkQueue> bulk_;
  const Incoming incoming_;
  Channels channels_;
};

struct LimitedDescriptor : rtps::ChainingTransportDescriptor {
  LimitedDescriptor(std::shared_ptr<rtps::TransportDescriptorInterface> low_level,
                    std::shared_ptr<BulkQueue> bulk,
                    Incoming incoming)
      : ChainingTransportDescriptor(std::move(low_level)),
        bulk_(std::move(bulk)),
        incoming_(std::move(incoming)) {}

  rtps::TransportInterface* create_transport() const override {
    return new LimitedTransport(*this, bulk_, incoming_);  // Fast DDS owns it
  }

 private:
  std::shared_ptr<BulkQueue> bulk_;
  Incoming incoming_;
};

}  // namespace

std::shared_ptr<rtps::TransportDescriptorInterface> limited(
    std::shared_ptr<rtps::TransportDescriptorInterface> transport,
    std::shared_ptr<BulkQueue> bulk,
    Incoming incoming) {
  return std::make_shared<LimitedDescriptor>(
      std::move(transport), std::move(bulk), std::move(incoming));
}

}  // namespace trigpoint::bus::fastdds
