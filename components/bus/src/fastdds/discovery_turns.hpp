// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <fastdds/rtps/transport/TransportDescriptorInterface.h>

#include <memory>
#include <mutex>

namespace trigpoint::bus::fastdds {

/// The same transport, which hands on what comes for discovery only while it holds `turn`.
///
/// With DDS-Security, Fast DDS 2.9 notes whom it has just discovered in one place that no lock
/// guards, and it discovers in a thread for each port and transport. Two who come within the same
/// instant are mixed up: one of them is never let in. All transports of a participant therefore
/// share one turn.
std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> one_discovery_at_a_time(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> transport,
    std::shared_ptr<std::mutex> turn);

}  // namespace trigpoint::bus::fastdds
