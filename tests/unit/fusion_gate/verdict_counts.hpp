// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/fusion_gate/fusion_gate.hpp"

#include <cstdint>
#include <string>

namespace trigpoint::fusion_gate {

inline std::uint64_t count_of(const FusionStatus& status, const std::string& code) {
  for (const NamedCount& entry : status.verdicts) {
    if (entry.name == code) {
      return entry.count;
    }
  }
  return 0;
}

}  // namespace trigpoint::fusion_gate
