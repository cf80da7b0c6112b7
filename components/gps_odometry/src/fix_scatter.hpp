// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What fixes are worth, whatever they say of themselves: how they scatter from one to the next.
#pragma once

#include <array>
#include <cstddef>

namespace trigpoint::gps_odometry {

/// Between two fixes of a receiver a strapdown or a LIO knows the way to centimetres, and an error
/// that is slow in the receiver does not change. What is left of their difference is new in each of
/// them: a resolution of a metre, stamps that jitter. Plain data, of one part (horizontal or
/// vertical) of the fixes.
class FixScatter {
 public:
  /// What two fixes of a receiver say, each summed over the part's axes: the squared difference of
  /// their way from the one that is known, that one's variance, and that of both fixes by the
  /// receiver (above zero). The result is a ratio of measured to said variance, 0 or more.
  static double ratio(double apart_m2, double way_m2, double said_m2);

  /// A new fix, by its ratios with the last one and the one before. The nearer of the two counts: a
  /// single outlier, or a second receiver whose fixes come in between, is no scatter.
  void add(double ratio_with_last, double ratio_with_one_before);

  /// Factor, at least 1, by which the white variance of the newest fixes exceeds what they say. Of
  /// the lower quarter of them: three fixes of ten may be outliers, which are not scatter. 1 unless
  /// it is more than chance makes of fixes that are as good as they say.
  double factor(int axes) const;

 private:
  static constexpr std::size_t kFixes = 24;

  std::array<double, kFixes> ratios_{};
  std::size_t added_{0};
};

}  // namespace trigpoint::gps_odometry
