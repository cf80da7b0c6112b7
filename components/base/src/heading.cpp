// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/heading.hpp"

#include "trigpoint/base/sentence.hpp"
#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint {

namespace {

constexpr double kHugeVariance_rad2 = 1e6;
constexpr double kUnitTolerance = 0.05;
constexpr double kLeastNorm = 1e-6;  // drivers without attitude send zeros

}  // namespace

HeadingVerdict check_heading(const YawMeasurement& yaw, const RobotConfig& robot) {
  if (!is_usable_stamp(yaw.stamp_ns)) {
    return {
        std::nullopt,
        "yaw_stamp_out_of_range",
        sentence("Yaw refused: its stamp is %g s, expected 0 to 8e9.", to_seconds(yaw.stamp_ns))};
  }
  if (!yaw.q_world_base || yaw.q_world_base->coeffs().norm() < kLeastNorm) {
    return {
        std::nullopt, "yaw_without_orientation", "Yaw refused: the message has no orientation."};
  }
  const double norm = yaw.q_world_base->coeffs().norm();
  if (!std::isfinite(norm) || std::isnan(yaw.variance_rad2)) {
    return {std::nullopt, "yaw_not_finite", "Yaw refused: a value is not a number."};
  }
  if (std::abs(norm - 1.0) > kUnitTolerance) {
    return {std::nullopt,
            "yaw_not_unit",
            sentence("Yaw refused: its quaternion has the length %g, expected 1.", norm)};
  }
  if (yaw.variance_rad2 > kHugeVariance_rad2) {
    return {std::nullopt,
            "yaw_unknown",
            sentence("Yaw refused: its variance is %g rad^2.", yaw.variance_rad2)};
  }
  const double sigma =
      yaw.variance_rad2 > 0.0 ? std::sqrt(yaw.variance_rad2) : robot.yaw_default_sigma_rad;
  return {Heading{yaw.stamp_ns,
                  wrap_angle(yaw_of(yaw.q_world_base->normalized()) + robot.yaw_offset_rad),
                  std::max(sigma, robot.yaw_floor_sigma_rad)},
          "",
          ""};
}

}  // namespace trigpoint
