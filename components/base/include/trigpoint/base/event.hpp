// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/time.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint {

enum class Severity : std::uint8_t { kInfo, kWarning, kError };

/// What a core has to say. Cores return events; the shell that runs them logs (rate-limited by
/// `code`).
struct Event {
  Severity severity{Severity::kInfo};
  Nanoseconds stamp_ns{0};  ///< data time
  std::string code;         ///< short and stable, e.g. "fix_rejected_stale"
  std::string text;         ///< a full sentence with the numbers and what was expected
};

using Events = std::vector<Event>;

}  // namespace trigpoint
