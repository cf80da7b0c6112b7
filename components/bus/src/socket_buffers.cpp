// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "socket_buffers.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>

namespace trigpoint::bus {

namespace {

std::int64_t granted_bytes(int probe, int option, std::int64_t wanted_bytes) {
  const int wanted = static_cast<int>(wanted_bytes);
  setsockopt(probe, SOL_SOCKET, option, &wanted, sizeof wanted);
  int doubled = 0;  // Linux reports twice the usable size: it adds room for its own bookkeeping
  socklen_t size = sizeof doubled;
  getsockopt(probe, SOL_SOCKET, option, &doubled, &size);
  return std::min<std::int64_t>(doubled / 2, wanted_bytes);
}

std::int64_t smaller_bytes(const SocketBuffers& granted) {
  return std::min(granted.receive_bytes, granted.send_bytes);
}

}  // namespace

SocketBuffers permitted_socket_buffers(std::int64_t wanted_bytes) {
  const int probe = socket(AF_INET, SOCK_DGRAM, 0);
  if (probe < 0) {
    return {};
  }
  const SocketBuffers granted{granted_bytes(probe, SO_RCVBUF, wanted_bytes),
                              granted_bytes(probe, SO_SNDBUF, wanted_bytes)};
  close(probe);
  return granted;
}

bool is_small(const SocketBuffers& granted) {
  return smaller_bytes(granted) < kUnpacedBufferBytes;
}

std::int64_t paced_portion_bytes(const SocketBuffers& granted) {
  constexpr std::int64_t kLeast_bytes = 65'536;
  return std::max(smaller_bytes(granted) * 2 / 3, kLeast_bytes);
}

std::optional<Pacing> pacing_of(const Config& config, const SocketBuffers& granted) {
  std::optional<Pacing> pacing;
  if (is_small(granted)) {
    pacing = Pacing{paced_portion_bytes(granted), kPacingPeriod};
  }
  const std::int64_t rate = config.bulk_bytes_per_s;
  if (rate > 0) {
    // A portion holds one datagram at least, so large datagrams make long periods.
    const std::int64_t period_ms =
        std::max<std::int64_t>(kPacingPeriod.count(), 1 + config.datagram_bytes * 1000 / rate);
    const Pacing wanted{rate * period_ms / 1000, std::chrono::milliseconds(period_ms)};
    const bool is_slower = !pacing || wanted.portion_bytes * pacing->period.count() <
                                          pacing->portion_bytes * wanted.period.count();
    pacing = is_slower ? wanted : *pacing;
  }
  return pacing;
}

std::optional<Event> socket_buffer_warning(std::int64_t wanted_bytes,
                                           const SocketBuffers& granted) {
  if (!is_small(granted)) {
    return std::nullopt;
  }
  return Event{Severity::kWarning,
               0,
               "bus_small_socket_buffers",
               "socket buffers are " + std::to_string(smaller_bytes(granted)) +
                   " bytes (asked for " + std::to_string(wanted_bytes) + ", wanted at least " +
                   std::to_string(kUnpacedBufferBytes) +
                   "); point clouds are sent paced. To raise them: sysctl -w "
                   "net.core.rmem_max=4194304 net.core.wmem_max=4194304"};
}

}  // namespace trigpoint::bus
