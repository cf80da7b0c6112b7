// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::supervisor {

struct ChildSettings {
  std::vector<std::string> command;
  std::string notify_address;
  double watchdog_s{0.0};  ///< for WATCHDOG_USEC; 0: none
  std::string log_file;    ///< its output is appended; empty: ours
};

/// Starts it; it gets SIGTERM when this process dies. Throws std::runtime_error.
pid_t start_child(const ChildSettings& settings);

/// Its wait status once it has ended.
std::optional<int> reap(pid_t child);

}  // namespace trigpoint::supervisor
