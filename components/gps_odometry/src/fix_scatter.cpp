// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fix_scatter.hpp"

#include <algorithm>

namespace trigpoint::gps_odometry {

namespace {

constexpr std::size_t kLeastFixes = 8;
// The value that a quarter of all samples stay below, of the smaller of two squared differences of
// a white sequence over twice its variance (its last one and the one before; by simulation).
constexpr double kLowerQuarter1 = 0.0291;  // 1 axis
constexpr double kLowerQuarter2 = 0.1471;  // 2 axes
// What one of a thousand sets of 24 fixes that scatter as they say comes to by chance, and one of 8
// at three times as much (by simulation).
constexpr double kChance1 = 8.0;
constexpr double kChance2 = 3.5;

}  // namespace

double FixScatter::ratio(double apart_m2, double way_m2, double said_m2) {
  return std::max(0.0, apart_m2 - way_m2) / said_m2;
}

void FixScatter::add(double ratio_with_last, double ratio_with_one_before) {
  ratios_[added_ % kFixes] = std::min(ratio_with_last, ratio_with_one_before);
  ++added_;
}

double FixScatter::factor(int axes) const {
  const std::size_t count = std::min(added_, kFixes);
  if (count < kLeastFixes) {
    return 1.0;
  }
  std::array<double, kFixes> sorted = ratios_;
  const auto quarter = sorted.begin() + static_cast<std::ptrdiff_t>(count / 4);
  std::nth_element(sorted.begin(), quarter, sorted.begin() + static_cast<std::ptrdiff_t>(count));
  const double measured = *quarter / (axes == 1 ? kLowerQuarter1 : kLowerQuarter2);
  const double chance =
      (axes == 1 ? kChance1 : kChance2) * static_cast<double>(kFixes) / static_cast<double>(count);
  return measured > chance ? measured : 1.0;
}

}  // namespace trigpoint::gps_odometry
