// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace trigpoint::fusion_gate {

/// printf with up to two numbers, for reasons and events.
inline std::string sentence(const char* format, double a, double b = 0.0) {
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), format, a, b);
  return text.data();
}

}  // namespace trigpoint::fusion_gate
