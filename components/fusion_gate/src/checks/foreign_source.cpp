// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/foreign_source.hpp"

#include "trigpoint/base/so3.hpp"

#include "fusion/fused_odometry.hpp"

#include <algorithm>

namespace trigpoint::fusion_gate {

namespace {

constexpr Nanoseconds kBuffer_ns = 5 * kNanosecondsPerSecond;
constexpr Nanoseconds kMaxGap_ns = 600'000'000;
constexpr std::size_t kMaxPending = 32;
// UTM: 0.9996 on the central meridian to 1.0010 at a zone's edge, and -1.6e-4 a kilometre of
// height.
constexpr double kScaleSigma = 7e-4;
// The source does not drift, so a long way may be looked back on: a scale shows on long ways only.
constexpr double kWindow_m = 1000.0;
constexpr double kUsableVariance_m2 = 1e4;  // above it the source does not know its own variance

AlignmentConfig without_drift(AlignmentConfig config) {
  config.window_m = std::max(config.window_m, kWindow_m);
  config.lio_drift_m_per_sqrt_m = 0.0;  // the source is held by the same fixes
  config.lio_tilt_sigma_rad = 0.0;
  return config;
}

}  // namespace

ForeignSource::ForeignSource(const Config& config, const Eigen::Vector3d& antenna_position_base_m)
    : lever_arm_base_m_(antenna_position_base_m),
      poses_(kBuffer_ns, kMaxGap_ns),
      window_(without_drift(config.alignment), kScaleSigma) {}

std::vector<AcceptedFix> ForeignSource::on_odometry(const Odometry& odometry) {
  if (!origin_m_) {
    origin_m_ = odometry.T_frame_child.p;
  }
  Pose T_frame_antenna = from_own_origin(odometry).T_frame_child;
  if (odometry.child_frame_id != kAntennaFrame) {
    T_frame_antenna.p = T_frame_antenna * lever_arm_base_m_;
  }
  poses_.add(odometry.stamp_ns, T_frame_antenna, odometry.pose_covariance);
  return match();
}

std::vector<AcceptedFix> ForeignSource::on_fix(const AcceptedFix& fix) {
  pending_.push_back(fix);
  if (pending_.size() > kMaxPending) {
    pending_.pop_front();
  }
  return match();
}

std::vector<AcceptedFix> ForeignSource::match() {
  std::vector<AcceptedFix> ready;
  while (!pending_.empty()) {
    const PoseBuffer::Answer answer = poses_.at(pending_.front().stamp_ns);
    if (answer.coverage == PoseBuffer::Coverage::kNotYet) {
      break;
    }
    if (answer.coverage == PoseBuffer::Coverage::kCovered) {
      if (const auto fix = add_pair(pending_.front(), answer.sample)) {
        ready.push_back(*fix);
      }
    }
    pending_.pop_front();
  }
  return ready;
}

std::optional<AcceptedFix> ForeignSource::add_pair(const AcceptedFix& fix,
                                                   const PoseBuffer::Sample& at_fix) {
  const Eigen::Matrix3d own_m2 = at_fix.covariance.topLeftCorner<3, 3>();
  const bool knows_own =
      own_m2.diagonal().maxCoeff() < kUsableVariance_m2 && own_m2.diagonal().minCoeff() > 0.0;
  const Eigen::Vector3d pair_variance_m2 =
      fix.covariance_map_m2.diagonal() +
      (knows_own ? Eigen::Vector3d(own_m2.diagonal()) : Eigen::Vector3d::Zero());
  window_.add({fix.stamp_ns,
               fix.antenna_map_m,
               pair_variance_m2,
               at_fix.T_frame_child.p,
               at_fix.distance_m});
  if (!window_.admitted()) {
    return std::nullopt;
  }
  Odometry antenna;
  antenna.T_frame_child = at_fix.T_frame_child;
  antenna.pose_covariance = at_fix.covariance;
  if (!knows_own) {
    antenna.pose_covariance.topLeftCorner<3, 3>() = fix.covariance_map_m2;
  }
  const Odometry in_map = brought_into_map(antenna);
  return AcceptedFix{
      fix.stamp_ns, in_map.T_frame_child.p, in_map.pose_covariance.topLeftCorner<3, 3>()};
}

Odometry ForeignSource::from_own_origin(const Odometry& odometry) const {
  Odometry moved = odometry;
  moved.T_frame_child.p -= origin_m_.value_or(Eigen::Vector3d::Zero());
  return moved;
}

/// T_map_odom (s x, s y, z), with what the scale's uncertainty does where the source is.
Odometry ForeignSource::brought_into_map(const Odometry& from_own_origin) const {
  const AlignmentSolution& solution = *window_.solution();
  Odometry scaled = from_own_origin;
  scaled.T_frame_child.p.head<2>() *= solution.scale;
  Odometry in_map = fuse(scaled, solution.T_map_odom, solution.covariance);
  const Eigen::Quaterniond q = solution.T_map_odom.pose().q;
  const Eigen::Vector3d& p_m = from_own_origin.T_frame_child.p;
  const Eigen::Vector3d by_scale = q * Eigen::Vector3d(p_m.x(), p_m.y(), 0.0);
  Eigen::Matrix<double, 3, 4> by_transform;
  by_transform << Eigen::Vector3d::UnitZ().cross(q * scaled.T_frame_child.p),
      Eigen::Matrix3d::Identity();
  const Eigen::Vector3d cross = by_transform * solution.scale_covariance.head<4>();
  in_map.pose_covariance.topLeftCorner<3, 3>() +=
      solution.scale_covariance[4] * by_scale * by_scale.transpose() +
      cross * by_scale.transpose() + by_scale * cross.transpose();
  return in_map;
}

std::optional<Odometry> ForeignSource::in_map(const Odometry& odometry) const {
  if (!window_.admitted()) {
    return std::nullopt;
  }
  Odometry result = brought_into_map(from_own_origin(odometry));
  result.child_frame_id = odometry.child_frame_id;
  return result;
}

void ForeignSource::forget_alignment() {
  window_.clear();
}

}  // namespace trigpoint::fusion_gate
