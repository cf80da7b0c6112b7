// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"

#include <cstdint>
#include <functional>
#include <map>
#include <string>

namespace trigpoint::cli {

/// Hands on the first warning or error of each code and counts the others, which summary() tells at
/// the end; what merely informs passes. For one thread.
class ToldOnce {
 public:
  explicit ToldOnce(std::function<void(const Event&)> tell) : tell_(std::move(tell)) {}

  void operator()(const Event& event);

  /// "points_without_time: 119 more like this", one line for each code that came more than once.
  std::string summary() const;

 private:
  std::function<void(const Event&)> tell_;
  std::map<std::string, std::uint64_t> seen_;
};

}  // namespace trigpoint::cli
