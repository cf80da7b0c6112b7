// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <fastdds/rtps/transport/TransportDescriptorInterface.h>

#include <memory>

namespace trigpoint::bus::fastdds {

class BulkQueue;

/// The same transport, which drops datagrams that announce a sample above kLargestMessage_bytes:
/// Fast DDS 2.9 makes room for it, and touches all of it, at the first fragment. With an interface
/// named it sends to every destination once, not from every socket (channels.hpp). With a
/// queue all goes through that.
std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> limited(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> transport,
    std::shared_ptr<BulkQueue> bulk);

}  // namespace trigpoint::bus::fastdds
