// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How large a socket buffer the kernel gives us, asked of the kernel itself.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/bus/config.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace trigpoint::bus {

struct SocketBuffers {
  std::int64_t receive_bytes{0};
  std::int64_t send_bytes{0};
};

/// What a UDP socket gets when it asks for `wanted_bytes`, at most that.
SocketBuffers permitted_socket_buffers(std::int64_t wanted_bytes);

/// Below this, clouds are sent in paced portions: a burst of one cloud no longer fits.
inline constexpr std::int64_t kUnpacedBufferBytes = 4'000'000;

/// Whether clouds must be paced.
bool is_small(const SocketBuffers& granted);

/// How much a participant sends of its clouds each period: what fits the smaller buffer with room
/// for everything else (71 MB/s at 212992 bytes).
std::int64_t paced_portion_bytes(const SocketBuffers& granted);
inline constexpr std::chrono::milliseconds kPacingPeriod{2};

/// At most so many bytes of clouds in each period.
struct Pacing {
  std::int64_t portion_bytes{0};
  std::chrono::milliseconds period{kPacingPeriod};
};

/// What small buffers and `config.bulk_bytes_per_s` ask for; nothing: clouds go as they come.
std::optional<Pacing> pacing_of(const Config& config, const SocketBuffers& granted);

/// The warning and its remedy, when the buffers are smaller than unpaced clouds need.
std::optional<Event> socket_buffer_warning(std::int64_t wanted_bytes, const SocketBuffers& granted);

}  // namespace trigpoint::bus
