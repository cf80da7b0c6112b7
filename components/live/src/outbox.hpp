// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <vector>

namespace trigpoint::live {

using Bytes = std::vector<std::uint8_t>;
using Payload = std::shared_ptr<const Bytes>;

/// No subscription has this number: they have 32 bits.
inline constexpr std::uint64_t kTimeStream = std::uint64_t{1} << 32U;

/// One WebSocket message. The payload is shared between clients, the header is each client's own.
struct Frame {
  std::array<std::uint8_t, 13> header{};
  std::size_t header_bytes{0};
  Payload payload;  ///< may be null
  bool text{false};
  std::uint64_t stream{0};  ///< the client's subscription, or kTimeStream

  std::size_t bytes() const { return header_bytes + (payload ? payload->size() : 0); }
};

/// What waits for one client. Answers to it (`push_control`) are few and never dropped here; of
/// data the newest are kept: at most `depth` of a stream, and `max_bytes` of all.
class Outbox {
 public:
  explicit Outbox(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  void push_control(Frame frame);
  /// How many older messages had to go (or this one, when it alone is larger than everything that
  /// may wait).
  std::size_t push(Frame frame, std::size_t depth);
  std::optional<Frame> pop();
  /// What was subscribed and waits is no longer wanted.
  void forget(std::uint64_t stream);

  std::size_t waiting_controls() const { return controls_.size(); }

  std::size_t waiting_bytes() const { return bytes_; }

 private:
  std::deque<Frame>::iterator oldest_of(std::uint64_t stream);
  std::uint64_t heaviest() const;
  void erase(std::deque<Frame>::iterator frame);

  struct Load {
    std::size_t messages{0};
    std::size_t bytes{0};
  };

  std::size_t max_bytes_;
  std::size_t bytes_{0};  ///< of data
  std::deque<Frame> controls_;
  std::deque<Frame> data_;
  std::map<std::uint64_t, Load> loads_;  ///< by stream
};

}  // namespace trigpoint::live
