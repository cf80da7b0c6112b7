// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace trigpoint {

/// printf with up to three numbers, for reasons and events; 399 characters at most.
inline std::string sentence(const char* format, double a, double b = 0.0, double c = 0.0) {
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(), format, a, b, c);
  return text.data();
}

}  // namespace trigpoint
