// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How a participant reaches others: UDP, buffers, peers, interface, lease, pacing.
#pragma once

#include "trigpoint/bus/config.hpp"

#include "../socket_buffers.hpp"
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

namespace trigpoint::bus::fastdds {

/// Name of the flow controller of bulk writers; there is one only when pacing_of() says so.
inline constexpr char kPacing[] = "trigpoint_paced";

/// Throws std::runtime_error when the interface or a peer is not known, ConfigError when a
/// discovery server is to be asked with security.
void set_transport(eprosima::fastdds::dds::DomainParticipantQos& qos,
                   const Config& config,
                   const SocketBuffers& buffers);

}  // namespace trigpoint::bus::fastdds
