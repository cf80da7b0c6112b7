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
/// Points that one thread takes at a time.
constexpr std::size_t kBlock = 256;

std::size_t blocks_of(std::size_t count) {
  return (count + kBlock - 1) / kBlock;
}

}  // namespace

ScanMatcher::ScanMatcher(const PointCloud& points_base,
                         const LocalMap& map,
                         const Vector3d& lidar_position_base_m,
                         const MatchingConfig& config,
                         Workers& workers)
    : points_base_(points_base),
      map_(map),
      lidar_position_base_m_(lidar_position_base_m),
      config_(config),
      workers_(workers),
      slots_(points_base.size()),
      has_match_(points_base.size()) {
  residuals_.reserve(points_base.size());
}

bool ScanMatcher::must_match_again(const Pose& T_odom_base) const {
  return !matched_ || (T_odom_base.p - T_odom_base_matched_.p).norm() > kRematchPosition_m ||
         T_odom_base.q.angularDistance(T_odom_base_matched_.q) > kRematchRotation_rad;
}

bool ScanMatcher::match_point(const PointXyzi& point,
                              const Eigen::Matrix3d& R,
                              const Vector3d& p,
                              Residual& r) const {
  r.point_base_m = point.position().cast<double>();
  const Vector3d point_odom_m = R * r.point_base_m + p;
  if (!map_.match(point_odom_m, r.plane)) {
    return false;
  }
  const Vector3d beam_m = r.point_base_m - lidar_position_base_m_;
  r.range_m = beam_m.norm();
  r.residual_m = r.plane.normal.dot(point_odom_m) + r.plane.offset_m;
  if (r.range_m < 1e-3 || std::abs(r.residual_m) > kGatePerRootRange * std::sqrt(r.range_m)) {
    return false;
  }
  r.direction_base = beam_m / r.range_m;
  return true;
}

void ScanMatcher::match(const Pose& T_odom_base) {
  const Eigen::Matrix3d R = T_odom_base.q.toRotationMatrix();
  workers_.run(blocks_of(points_base_.size()), [&](std::size_t block) {
    const std::size_t end = std::min((block + 1) * kBlock, points_base_.size());
    for (std::size_t i = block * kBlock; i < end; ++i) {
      has_match_[i] = match_point(points_base_[i], R, T_odom_base.p, slots_[i]) ? 1 : 0;
    }
  });
  residuals_.clear();
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (has_match_[i] != 0) {
      residuals_.push_back(slots_[i]);
    }
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

PoseInformation ScanMatcher::sum_of(std::size_t block, const Pose& T_odom_base) {
  const Eigen::Matrix3d R = T_odom_base.q.toRotationMatrix();
  PoseInformation sum;
  const std::size_t end = std::min((block + 1) * kBlock, residuals_.size());
  for (std::size_t i = block * kBlock; i < end; ++i) {
    Residual& r = residuals_[i];
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
  return sum;
}

/// Block by block and the blocks in order, so that the sum has the same rounding on any number of
/// threads.
PoseInformation ScanMatcher::linearise(const Pose& T_odom_base) {
  if (must_match_again(T_odom_base)) {
    match(T_odom_base);
  }
  sums_.resize(blocks_of(residuals_.size()));
  workers_.run(sums_.size(), [&](std::size_t block) { sums_[block] = sum_of(block, T_odom_base); });
  PoseInformation sum;
  for (const PoseInformation& part : sums_) {
    sum.information += part.information;
    sum.gradient += part.gradient;
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
