// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "path.hpp"

#include "trigpoint/base/so3.hpp"

#include "moving_average.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::simulator {

namespace {

constexpr double kStep_m = 0.1;
constexpr double kMargin_m = 20.0;  ///< straight on before the start and after the end
constexpr std::ptrdiff_t kMarginSteps = 200;
constexpr std::size_t kCurvatureHalfWindow =
    10;  ///< 2.1 m: rounds like a steering wheel, cuts 5 cm of a corner

}  // namespace

double radius_before_rounding_m(double radius_m) {
  // The mean of n points on a circle, an angle a apart, is nearer to its centre by
  // sin(n a / 2) / (n sin(a / 2)); the path takes two such means.
  constexpr auto kPoints = static_cast<double>(2 * kCurvatureHalfWindow + 1);
  double before_m = radius_m;
  for (int i = 0; i < 30; ++i) {
    const double half_angle = 0.5 * kStep_m / before_m;
    const double shrink = std::sin(kPoints * half_angle) / (kPoints * std::sin(half_angle));
    before_m = radius_m / (shrink * shrink);
  }
  return before_m;
}

Path::Path(const std::vector<RoutePoint>& route) {
  sample(route);
  smooth();
  measure_headings();
}

void Path::sample(const std::vector<RoutePoint>& route) {
  double next_m = 0.0;  // along the current side
  for (std::size_t i = 0; i + 1 < route.size(); ++i) {
    const Eigen::Vector2d from(route[i].east_m, route[i].north_m);
    const Eigen::Vector2d side = Eigen::Vector2d(route[i + 1].east_m, route[i + 1].north_m) - from;
    const double side_m = side.norm();
    if (route[i].stop_s > 0.0) {
      stops_.push_back({static_cast<double>(points_.size()) * kStep_m, route[i].stop_s});
    }
    for (; next_m < side_m; next_m += kStep_m) {
      points_.emplace_back(from + next_m / side_m * side);
      speeds_mps_.push_back(route[i].speed_mps);
    }
    next_m -= side_m;
  }
  length_m_ = static_cast<double>(points_.size() - 1) * kStep_m;
  const Eigen::Vector2d first_step = points_[1] - points_[0];
  const Eigen::Vector2d last_step = points_.back() - points_[points_.size() - 2];
  std::vector<Eigen::Vector2d> extended;
  for (std::ptrdiff_t i = kMarginSteps; i > 0; --i) {
    extended.emplace_back(points_.front() - static_cast<double>(i) * first_step);
  }
  extended.insert(extended.end(), points_.begin(), points_.end());
  for (std::ptrdiff_t i = 1; i <= kMarginSteps; ++i) {
    extended.emplace_back(points_.back() + static_cast<double>(i) * last_step);
  }
  points_ = std::move(extended);
}

void Path::smooth() {
  for (int pass = 0; pass < 2; ++pass) {
    points_ = moving_average(points_, kCurvatureHalfWindow);
    speeds_mps_ = moving_average(speeds_mps_, kCurvatureHalfWindow);
  }
}

void Path::measure_headings() {
  const std::size_t n = points_.size();
  headings_rad_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2d d = points_[std::min(i + 1, n - 1)] - points_[i > 0 ? i - 1 : 0];
    const double heading = std::atan2(d.y(), d.x());
    headings_rad_[i] =
        i == 0 ? heading : headings_rad_[i - 1] + wrap_angle(heading - headings_rad_[i - 1]);
  }
}

Path::Place Path::at(double s_m) const {
  const double limit_m = kMargin_m - 1.0;
  const double index = (std::clamp(s_m, -limit_m, length_m_ + limit_m) + kMargin_m) / kStep_m;
  const auto i = static_cast<std::size_t>(index);
  const double u = index - static_cast<double>(i);
  // Catmull-Rom: what the drive samples must be smoother than a polyline.
  const Eigen::Vector2d& a = points_[i - 1];
  const Eigen::Vector2d& b = points_[i];
  const Eigen::Vector2d& c = points_[i + 1];
  const Eigen::Vector2d& d = points_[i + 2];
  const Eigen::Vector2d position =
      b + 0.5 * u * (c - a + u * (2.0 * a - 5.0 * b + 4.0 * c - d + u * (3.0 * (b - c) + d - a)));
  const double heading = headings_rad_[i] + u * (headings_rad_[i + 1] - headings_rad_[i]);
  return {position, heading, (headings_rad_[i + 1] - headings_rad_[i]) / kStep_m};
}

double Path::wanted_speed_mps(double s_m) const {
  const auto last = static_cast<double>(speeds_mps_.size() - 1);
  return speeds_mps_[static_cast<std::size_t>(std::clamp(s_m / kStep_m, 0.0, last))];
}

}  // namespace trigpoint::simulator
