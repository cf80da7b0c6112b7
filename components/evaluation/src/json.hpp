// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// JSON (RFC 8259) in the making: values as text. Numbers have all their digits; one that is not
/// finite is null.
namespace json {

std::string number(double value);
std::string number(std::int64_t value);
std::string number(std::uint64_t value);
std::string text(const std::string& value);
std::string array(const std::vector<std::string>& values);

/// Members in the order of their adding.
class Object {
 public:
  Object& add(const std::string& name, const std::string& value);

  std::string str() const { return "{" + members_ + "}"; }

 private:
  std::string members_;
};

}  // namespace json

}  // namespace trigpoint::evaluation
