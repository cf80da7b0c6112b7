// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How a participant reaches others: UDP, buffers, peers, interface, lease, pacing.
#pragma once

#include "trigpoint/bus/config.hpp"

#include "../socket_buffers.hpp"
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

#include <memory>

namespace trigpoint::bus::fastdds {

class BulkQueue;
struct Incoming;

/// Name of the flow controller of bulk writers; there is one only when pacing_of() says so and
/// there is no queue of ours.
inline constexpr char kPacing[] = "trigpoint_paced";

/// The queue for clouds when pacing_of() says so. Not with security, where it could not tell what a
/// datagram holds, nor with shared memory, whose datagrams do not come there.
std::shared_ptr<BulkQueue> make_bulk_queue(const Config& config, const SocketBuffers& buffers);

/// Throws std::runtime_error when the interface or a peer is not known, ConfigError when a
/// discovery server is to be asked with security.
void set_transport(eprosima::fastdds::dds::DomainParticipantQos& qos,
                   const Config& config,
                   const SocketBuffers& buffers,
                   const std::shared_ptr<BulkQueue>& bulk,
                   const Incoming& incoming);

}  // namespace trigpoint::bus::fastdds
