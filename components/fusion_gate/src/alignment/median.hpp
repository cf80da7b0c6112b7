// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <algorithm>
#include <vector>

namespace trigpoint::fusion_gate {

/// The upper one of two in the middle. There must be a value.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// What the median of the squared lengths of residuals in two axes tells of the variance of one
/// axis, after so many parameters were solved for, per axis. There must be more residuals than
/// that.
inline double variance_of_squares(const std::vector<double>& squares, double solved_for) {
  constexpr double kMedian = 1.386;  // of chi-square with 2 degrees of freedom
  const auto n = static_cast<double>(squares.size());
  return median(squares) / kMedian * n / (n - solved_for);
}

}  // namespace trigpoint::fusion_gate
