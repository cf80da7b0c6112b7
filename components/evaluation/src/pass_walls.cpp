// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/map_quality.hpp"

#include "facades.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::evaluation {

struct PassWalls::Impl {
  std::vector<std::map<FacadeCell, Facade>> passes;
};

PassWalls::PassWalls() : impl_(std::make_unique<Impl>()) {}

PassWalls::~PassWalls() = default;

void PassWalls::add_pass(const PointCloud& cloud) {
  impl_->passes.push_back(facades_of(cloud));
}

PassOffset PassWalls::offset(std::size_t apart) const {
  const auto& passes = impl_->passes;
  std::map<FacadeCell, double> largest_m;
  for (std::size_t i = 0; i < passes.size(); ++i) {
    for (std::size_t j = i + apart; j < passes.size(); ++j) {
      for (const auto& [cell, first] : passes[i]) {
        const auto second = passes[j].find(cell);
        const auto offset_m = second == passes[j].end()
                                  ? std::nullopt
                                  : distance_between(cell, first, second->second);
        if (offset_m) {
          double& largest = largest_m[cell];
          largest = std::max(largest, *offset_m);
        }
      }
    }
  }
  PassOffset result;
  result.passes = passes.size();
  result.walls = largest_m.size();
  if (largest_m.empty()) {
    return result;
  }
  std::vector<double> sorted_m;
  for (const auto& [cell, offset_m] : largest_m) {
    sorted_m.push_back(offset_m);
  }
  std::sort(sorted_m.begin(), sorted_m.end());
  const auto last = static_cast<double>(sorted_m.size() - 1);
  result.median_m = sorted_m[static_cast<std::size_t>(std::lround(0.5 * last))];
  result.p90_m = sorted_m[static_cast<std::size_t>(std::lround(0.9 * last))];
  return result;
}

}  // namespace trigpoint::evaluation
