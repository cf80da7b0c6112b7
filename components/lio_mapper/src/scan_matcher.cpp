// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "scan_matcher.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

using Eigen::Vector3d;

namespace {

/// A pose that moved less sees the same planes.
constexpr double kRematchPosition_m = 0.02;
constexpr double kRematchRotation_rad = 2e-3;
/// FAST-LIO2's acceptance 1 - 0.9 |r| / sqrt(range) > 0.9: near points must fit more closely.
constexpr double kGatePerRootRange = 1.0 / 9.0;
/// Planes of few points look thinner than they are.
constexpr double kLeastVariance_m2 = 0.01 * 0.01;

}  // namespace

ScanMatcher::ScanMatcher(const PointCloud& points_base,
                         const LocalMap& map,
                         const Vector3d& lidar_position_base_m,
                         const MatchingConfig& config)
    : points_base_(points_base),
      map_(map),
      lidar_position_base_m_(lidar_position_base_m),
      config_(config) {
  residuals_.reserve(points_base.size());
}

bool ScanMatcher::must_match_again(const Pose& T_odom_base) const {
  return !matched_ || (T_odom_base.p - T_odom_base_matched_.p).norm() > kRematchPosition_m ||
         T_odom_base.q.angularDistance(T_odom_base_matched_.q) > kRematchRotation_rad;
}

void ScanMatcher::match(const Pose& T_odom_base) {
  const Eigen::Matrix3d R = T_odom_base.q.toRotationMatrix();
  residuals_.clear();
  for (const PointXyzi& point : points_base_) {
    Residual r;
    r.point_base_m = point.position().cast<double>();
    const Vector3d point_odom_m = R * r.point_base_m + T_odom_base.p;
    if (!map_.match(point_odom_m, r.plane)) {
      continue;
    }
    const Vector3d beam_m = r.point_base_m - lidar_position_base_m_;
    r.range_m = beam_m.norm();
    r.residual_m = r.plane.normal.dot(point_odom_m) + r.plane.offset_m;
    if (r.range_m < 1e-3 || std::abs(r.residual_m) > kGatePerRootRange * std::sqrt(r.range_m)) {
      continue;
    }
    r.direction_base = beam_m / r.range_m;
    residuals_.push_back(r);
  }
  matched_ = true;
  T_odom_base_matched_ = T_odom_base;
}

double ScanMatcher::variance_m2(const Residual& r, double cos_incidence) const {
  const double cos2 = cos_incidence * cos_incidence;
  const double range2 = config_.range_sigma_m * config_.range_sigma_m * cos2;
  const double sideways_m = config_.angle_sigma_rad * r.range_m;
  return kLeastVariance_m2 + range2 + sideways_m * sideways_m * (1.0 - cos2) +
         r.plane.thickness2_m2;
}

PoseInformation ScanMatcher::linearise(const Pose& T_odom_base) {
  if (must_match_again(T_odom_base)) {
    match(T_odom_base);
  }
  const Eigen::Matrix3d R = T_odom_base.q.toRotationMatrix();
  PoseInformation sum;
  for (Residual& r : residuals_) {
    const Vector3d normal_base = R.transpose() * r.plane.normal;
    r.residual_m =
        normal_base.dot(r.point_base_m) + r.plane.normal.dot(T_odom_base.p) + r.plane.offset_m;
    const double variance = variance_m2(r, normal_base.dot(r.direction_base));
    const double ratio = std::abs(r.residual_m) / (config_.robust_width * std::sqrt(variance));
    const double weight = (ratio > 1.0 ? 1.0 / ratio : 1.0) / variance;
    // d(n . R exp(e) p) / de = (p x R^T n)^T
    Vector6d h;
    h << r.plane.normal, r.point_base_m.cross(normal_base);
    sum.information.selfadjointView<Eigen::Lower>().rankUpdate(h, weight);
    sum.gradient += weight * r.residual_m * h;
  }
  sum.count = residuals_.size();
  const double scale =
      std::min(1.0,
               config_.independent_residuals /
                   static_cast<double>(std::max<std::size_t>(residuals_.size(), 1)));
  sum.information = scale * Matrix6d(sum.information.selfadjointView<Eigen::Lower>());
  sum.gradient *= scale;
  return sum;
}

double ScanMatcher::share_within(double distance_m) const {
  const auto near = std::count_if(residuals_.begin(), residuals_.end(), [&](const Residual& r) {
    return std::abs(r.residual_m) < distance_m;
  });
  return points_base_.empty()
             ? 0.0
             : static_cast<double>(near) / static_cast<double>(points_base_.size());
}

}  // namespace trigpoint::lio_mapper
