// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <algorithm>
#include <vector>

namespace trigpoint::simulator {

/// Mean over 2 half + 1 neighbours; near the ends the window shrinks evenly, so that straight lines
/// stay straight to the end.
template <typename T>
std::vector<T> moving_average(const std::vector<T>& values, std::size_t half) {
  std::vector<T> result(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t reach = std::min({half, i, values.size() - 1 - i});
    T sum = values[i];
    for (std::size_t k = 1; k <= reach; ++k) {
      sum += values[i - k] + values[i + k];
    }
    result[i] = sum / static_cast<double>(2 * reach + 1);
  }
  return result;
}

}  // namespace trigpoint::simulator
