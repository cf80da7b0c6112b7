// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "json.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>

namespace trigpoint::evaluation::json {

std::string number(double value) {
  if (!std::isfinite(value)) {
    return "null";
  }
  std::array<char, 40> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  return {digits.data(), end};
}

std::string number(std::int64_t value) {
  return std::to_string(value);
}

std::string number(std::uint64_t value) {
  return std::to_string(value);
}

std::string text(const std::string& value) {
  std::string quoted = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      quoted += {'\\', c};
    } else if (static_cast<unsigned char>(c) < 0x20) {
      std::array<char, 8> code{};
      std::snprintf(code.data(), code.size(), "\\u%04x", static_cast<unsigned>(c));
      quoted += code.data();
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

std::string array(const std::vector<std::string>& values) {
  std::string list;
  for (const std::string& value : values) {
    list += (list.empty() ? "" : ", ") + value;
  }
  return "[" + list + "]";
}

Object& Object::add(const std::string& name, const std::string& value) {
  members_ += (members_.empty() ? "" : ", ") + text(name) + ": " + value;
  return *this;
}

}  // namespace trigpoint::evaluation::json
