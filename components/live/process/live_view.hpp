// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/live/live_server.hpp"

#include <functional>
#include <string>

namespace trigpoint::live {

struct LiveViewOptions {
  RobotConfig robot;
  bus::Config bus;
  ServerOptions server;
  std::function<void(const Event&)> on_event;
  std::function<void(std::uint16_t port)> on_listening;
};

/// Shows what is on the bus until SIGINT or SIGTERM. A topic is read from the bus only while a
/// browser wants it. Throws std::runtime_error when the bus cannot be joined or the address not be
/// had.
Counters run_live_view(const LiveViewOptions& options);

}  // namespace trigpoint::live
