// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/receiver_worth.hpp"

#include "alignment/median.hpp"
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace trigpoint::fusion_gate {

namespace {

constexpr double kWellBelow = 4.0;     // a ratio of variances: another kind of solution
constexpr std::size_t kOnTheWay = 10;  // fixes over the baseline

}  // namespace

void ReceiverWorth::on_alignment(double said_m2, double measured_m2) {
  kinds_.clear();
  way_.clear();
  if (measured_m2 > said_m2) {
    kinds_.push_back({said_m2, measured_m2});
  }
}

/// The finest one of which this claim is not well above. There must be one.
std::size_t ReceiverWorth::kind_of(double said_m2) const {
  std::size_t found = 0;
  while (found + 1 < kinds_.size() && said_m2 <= kWellBelow * kinds_[found + 1].said_m2) {
    ++found;
  }
  return found;
}

double ReceiverWorth::least_m2(double said_m2) const {
  return kinds_.empty() ? 0.0 : kinds_[kind_of(said_m2)].measured_m2;
}

/// Fixes close together lie in the same step of a grid: they are taken a piece of way apart.
void ReceiverWorth::add(double said_m2,
                        const Eigen::Vector2d& gps_map_m,
                        const Eigen::Vector2d& lio_odom_m,
                        double yaw_rad) {
  if (kinds_.empty() || kWellBelow * said_m2 >= kinds_[kind_of(said_m2)].said_m2) {
    way_.clear();
    return;
  }
  if (!way_.empty() && (said_m2 > kWellBelow * way_.front().said_m2 ||
                        kWellBelow * said_m2 < way_.front().said_m2)) {
    way_.clear();
  }
  const double apart_m = config_.alignment.min_baseline_m / static_cast<double>(kOnTheWay);
  if (!way_.empty() && (lio_odom_m - way_.back().lio_odom_m).norm() < apart_m) {
    return;
  }
  way_.push_back({said_m2, gps_map_m, lio_odom_m});
  if (way_.size() <= kOnTheWay) {
    return;
  }
  const std::size_t before = kind_of(said_m2);
  const double measured_m2 = measured_on_the_way_m2(yaw_rad);
  const bool as_it_says = measured_m2 <= way_.front().said_m2;
  const Kind found{way_.front().said_m2,
                   as_it_says ? 0.0 : std::min(measured_m2, kinds_[before].measured_m2)};
  kinds_.insert(kinds_.begin() + static_cast<std::ptrdiff_t>(before) + 1, found);
  way_.clear();
}

double ReceiverWorth::measured_on_the_way_m2(double yaw_rad) const {
  const Eigen::Rotation2Dd R_map_odom(yaw_rad);
  Eigen::Vector2d middle_m;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    std::vector<double> offs_m;
    for (const Seen& seen : way_) {
      offs_m.push_back((seen.gps_map_m - R_map_odom * seen.lio_odom_m)[axis]);
    }
    middle_m[axis] = median(offs_m);
  }
  std::vector<double> squares_m2;
  for (const Seen& seen : way_) {
    const Eigen::Vector2d off_m = seen.gps_map_m - R_map_odom * seen.lio_odom_m;
    squares_m2.push_back((off_m - middle_m).squaredNorm());
  }
  constexpr double kSolvedFor = 1.0;  // x and y
  return variance_of_squares(squares_m2, kSolvedFor);
}

}  // namespace trigpoint::fusion_gate
