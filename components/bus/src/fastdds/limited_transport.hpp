// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <fastdds/rtps/transport/TransportDescriptorInterface.h>

#include <functional>
#include <memory>
#include <string>

namespace trigpoint::bus {

class IncomingSamples;

}  // namespace trigpoint::bus

namespace trigpoint::bus::fastdds {

class BulkQueue;

/// What comes in: whether there is room for it, and who is told that there was none.
struct Incoming {
  std::shared_ptr<IncomingSamples> samples;
  std::function<void(const std::string& sender)> refused;
};

/// The same transport, which drops datagrams with fragments of samples for which there is no room:
/// Fast DDS 2.9 takes all of it, and touches it, at the first fragment. With an interface
/// named it sends to every destination once, not from every socket (channels.hpp). With a
/// queue all goes through that.
std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> limited(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> transport,
    std::shared_ptr<BulkQueue> bulk,
    Incoming incoming);

}  // namespace trigpoint::bus::fastdds
