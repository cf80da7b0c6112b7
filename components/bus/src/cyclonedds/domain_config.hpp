// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How a participant reaches others, in Cyclone's own words: buffers, peers, interface, lease.
#pragma once

#include "trigpoint/bus/config.hpp"

#include "../rtps_limits.hpp"
#include "../socket_buffers.hpp"

#include <chrono>
#include <string>

namespace trigpoint::bus::cyclonedds {

/// For the last samples of a writer that goes; longer would add up where readers are dead.
inline constexpr std::chrono::milliseconds kLinger{100};

/// The configuration for dds_create_domain: ours, then that of CYCLONEDDS_URI, which may override
/// it. Throws std::runtime_error when the interface or a peer is not known.
std::string domain_config(const Config& config, const SocketBuffers& buffers);

}  // namespace trigpoint::bus::cyclonedds
