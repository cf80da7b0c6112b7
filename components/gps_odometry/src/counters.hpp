// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace trigpoint::gps_odometry {

/// Counts by name. Small, copied with every state of the rewind buffer only where noted.
class Counters {
 public:
  void add(const std::string& name) { ++counts_[name]; }

  /// Sorted by name.
  std::vector<NamedCount> list() const {
    std::vector<NamedCount> named;
    for (const auto& [name, count] : counts_) {
      named.push_back({name, count});
    }
    return named;
  }

 private:
  std::map<std::string, std::uint64_t> counts_;
};

}  // namespace trigpoint::gps_odometry
