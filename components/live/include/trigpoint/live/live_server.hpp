// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Serves channels of CDR messages to browsers: the Foxglove WebSocket protocol, and over HTTP a
// page of our own that speaks it too.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/time.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace trigpoint::live {

/// A topic as it is offered. Its number is its place in the list given to the server.
struct Channel {
  std::string topic;        ///< "/lio/odometry"
  std::string schema_name;  ///< "nav_msgs/msg/Odometry"; must be in idl/
  std::size_t depth{1000};  ///< messages of it that may wait for a slow client; the newest are kept
  bool latched{false};      ///< the newest message goes to whoever subscribes later
};

struct ServerOptions {
  std::string bind_address{"127.0.0.1"};
  std::uint16_t port{8765};  ///< 0: any free one
  std::size_t max_clients{16};
  std::size_t max_queued_bytes{64U << 20U};  ///< that wait for one client
};

struct Counters {
  std::uint64_t clients{0};      ///< WebSocket clients now
  std::uint64_t sent{0};         ///< messages of channels handed to the network
  std::uint64_t dropped{0};      ///< messages that a slow client did not get
  std::uint64_t turned_away{0};  ///< connections beyond max_clients
};

/// Has a thread of its own; every function may be called from any thread, and none waits for a
/// client.
class LiveServer {
 public:
  /// Told on the server's thread: a first client wants the channel, or the last one has left it.
  using Wanted = std::function<void(std::size_t channel, bool wanted)>;
  using Sink = std::function<void(const Event&)>;

  /// Listens from here on. Throws std::runtime_error when the address cannot be had or a schema is
  /// not known.
  LiveServer(const ServerOptions& options,
             std::vector<Channel> channels,
             Wanted wanted = {},
             Sink sink = {});
  ~LiveServer();
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  std::uint16_t port() const;

  /// `cdr` with its encapsulation header, as DDS has it.
  void publish(std::size_t channel, Nanoseconds stamp_ns, std::vector<std::uint8_t> cdr);

  /// The time that the stamps are of: the simulated clock's, or the wall's.
  void publish_time(Nanoseconds now_ns);

  Counters counters() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::live
