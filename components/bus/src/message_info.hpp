// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What every backend puts into a MessageInfo.
#pragma once

#include "trigpoint/base/time.hpp"

#include <chrono>
#include <cstdint>
#include <span>
#include <string>

namespace trigpoint::bus {

inline std::string hexadecimal(std::span<const std::uint8_t> bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text.push_back(kDigits[byte >> 4]);
    text.push_back(kDigits[byte & 15]);
  }
  return text;
}

inline Nanoseconds wall_clock_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

}  // namespace trigpoint::bus
