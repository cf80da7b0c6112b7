// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "heading.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace trigpoint::gps_odometry {

namespace {

using Complex = std::complex<double>;

// A way whose legs disagree about the heading (reversing, sliding, noise) is not believed.
constexpr double kLeastAgreement = 0.9;
// A gyro without bias estimate drifts; older legs say less than they seem to.
constexpr Nanoseconds kLongestWay_ns = 60 * kNanosecondsPerSecond;
// Mounting and slip: course over ground is not heading.
constexpr double kCourseSigma_rad = 0.035;

// A heading that was heard is given up only on good evidence.
constexpr double kProofBaseline = 4.0;
constexpr double kContradiction_rad = 0.35;
constexpr double kContradiction_sigmas = 3.0;
constexpr Nanoseconds kHeadingDistrust_ns = 60 * kNanosecondsPerSecond;
constexpr double kLongestStep_s = 2.5;

Complex complex_of(const Eigen::Vector2d& v) {
  return {v.x(), v.y()};
}

}  // namespace

void HeadingSearch::keep(const CoursePoint& point) {
  if (size_ == kPoints) {
    std::move(points_.begin() + 1, points_.end(), points_.begin());
    --size_;
  }
  points_[static_cast<std::size_t>(size_++)] = point;
}

std::optional<HeadingEstimate> HeadingSearch::add(const CoursePoint& point, const Config& config) {
  while (size_ > 0 && point.stamp_ns - points_[0].stamp_ns > kLongestWay_ns) {
    std::move(points_.begin() + 1, points_.begin() + size_, points_.begin());
    --size_;
  }
  if (size_ == 0) {
    keep(point);
    return std::nullopt;
  }
  const CoursePoint last = points_[static_cast<std::size_t>(size_ - 1)];
  const double leg_m = (point.antenna_map_m - last.antenna_map_m).norm();
  if (leg_m < std::max(0.2 * config.heading_baseline_m, 2.0 * point.sigma_m)) {
    return std::nullopt;
  }
  keep(point);

  // Sum over legs of displacement in map times conjugate of the forward direction in the level
  // frame: its angle is the heading offset, its length the distance on which the legs agree.
  Complex sum{0.0, 0.0};
  double way_m = 0.0;
  double variance_m2 = 0.0;
  for (int i = 1; i < size_; ++i) {
    const CoursePoint& from = points_[static_cast<std::size_t>(i - 1)];
    const CoursePoint& to = points_[static_cast<std::size_t>(i)];
    const Complex step = complex_of(to.antenna_map_m - from.antenna_map_m);
    const double mean_yaw =
        from.yaw_relative_rad + 0.5 * wrap_angle(to.yaw_relative_rad - from.yaw_relative_rad);
    const Complex expected = std::abs(step) * std::polar(1.0, mean_yaw) +
                             complex_of(to.lever_relative_m - from.lever_relative_m);
    sum += step * std::conj(expected / std::max(std::abs(expected), 1e-9));
    way_m += std::abs(step);
    variance_m2 = std::max({variance_m2, from.sigma_m * from.sigma_m, to.sigma_m * to.sigma_m});
  }
  const double baseline_m = std::abs(sum);
  const double duration_s = to_seconds(point.stamp_ns - points_[0].stamp_ns);
  if (baseline_m < config.heading_baseline_m || baseline_m < kLeastAgreement * way_m ||
      baseline_m < config.heading_speed_mps * duration_s) {
    return std::nullopt;
  }
  HeadingEstimate estimate;
  estimate.yaw_map_relative_rad = std::arg(sum);
  estimate.sigma_rad = std::hypot(std::sqrt(2.0 * variance_m2) / baseline_m, kCourseSigma_rad);
  if (estimate.sigma_rad > config.heading_sigma_rad) {
    return std::nullopt;
  }
  const double leg_s = to_seconds(point.stamp_ns - last.stamp_ns);
  estimate.speed_mps = leg_m / leg_s;
  estimate.speed_sigma_mps = std::sqrt(2.0 * variance_m2) / leg_s + 0.5;
  return estimate;
}

void HeadingSearch::change_frame(const Eigen::Matrix2d& R_new_old,
                                 const Eigen::Vector2d& t_new_old) {
  for (int i = 0; i < size_; ++i) {
    Eigen::Vector2d& antenna = points_[static_cast<std::size_t>(i)].antenna_map_m;
    antenna = R_new_old * antenna + t_new_old;
  }
}

std::optional<HeadingEstimate> heard_heading(const AidingState& aiding,
                                             const Eigen::Vector2d& step_map_m,
                                             double elapsed_s,
                                             double sigma_m) {
  if (!aiding.has_prior || !(elapsed_s > 0.0) || elapsed_s > kLongestStep_s) {
    return std::nullopt;
  }
  HeadingEstimate heading;
  heading.heard = true;
  heading.yaw_map_relative_rad = aiding.prior_yaw_map_relative_rad;
  heading.sigma_rad = aiding.prior_sigma_rad;
  heading.velocity_map_mps = step_map_m / elapsed_s;
  heading.speed_mps = heading.velocity_map_mps.norm();
  heading.speed_sigma_mps = std::numbers::sqrt2 * sigma_m / elapsed_s + 0.5;
  return heading;
}

std::optional<HeadingEstimate> contradiction(HeadingSearch& search,
                                             AidingState& aiding,
                                             const CoursePoint& point,
                                             double yaw_sigma_rad,
                                             const Config& config) {
  Config longer = config;
  longer.heading_baseline_m *= kProofBaseline;
  const auto motion = search.add(point, longer);
  if (!motion) {
    return std::nullopt;
  }
  aiding.heading_unproven = false;
  const double limit = std::max(
      kContradiction_rad, kContradiction_sigmas * std::hypot(motion->sigma_rad, yaw_sigma_rad));
  if (std::abs(wrap_angle(motion->yaw_map_relative_rad)) < limit) {
    return std::nullopt;
  }
  aiding.yaw_distrusted_until_ns = point.stamp_ns + kHeadingDistrust_ns;
  return motion;
}

}  // namespace trigpoint::gps_odometry
