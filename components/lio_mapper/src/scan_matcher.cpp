// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "scan_matcher.hpp"

#include <Eigen/Eigenvalues>

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

/// E[n n^T] of a normal whose direction has variance tilt2 exceeds the true one by this.
void add_noise(const Vector3d& normal, double weighted_tilt2, Eigen::Matrix3d& noise) {
  noise -= weighted_tilt2 * normal * normal.transpose();
  noise.diagonal().array() += weighted_tilt2;
}

/// Normals are measured too. Along a tunnel none has a true component, but their noise has one, and
/// its squares add up to information that is none: least squares with noisy regressors, which holds
/// the estimate back at the prediction and makes it look certain [W. A. Fuller, Measurement Error
/// Models, 1987, ch. 1]. Along each principal axis of the position's information A, with N of it
/// noise and f = 1 - N / A: the solution g / (A - N) has the variance A / (A - N)^2, which is that
/// of the information f^2 A with the gradient f g.
template <int Size>
void take_out_noise(Information<Size>& sum) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(
      sum.information.template topLeftCorner<3, 3>());
  Eigen::Matrix3d keep = Eigen::Matrix3d::Zero();
  for (int i = 0; i < 3; ++i) {
    const Vector3d axis = axes.eigenvectors().col(i);
    const double noise = axis.dot(sum.noise * axis);
    const double share = std::max(0.0, 1.0 - noise / (axes.eigenvalues()[i] + 1e-12));
    keep += share * axis * axis.transpose();
  }
  typename Information<Size>::Matrix by = Information<Size>::Matrix::Identity();
  by.template topLeftCorner<3, 3>() = keep;
  sum.information = (by * sum.information * by).eval();
  sum.gradient = (by * sum.gradient).eval();
}

std::size_t blocks_of(std::size_t count) {
  return (count + kBlock - 1) / kBlock;
}

}  // namespace

ScanMatcher::ScanMatcher(const PointCloud& points_base,
                         const LocalMap& map,
                         const Pose& T_base_lidar,
                         const MatchingConfig& config,
                         Workers& workers)
    : points_base_(points_base),
      map_(map),
      T_base_lidar_(T_base_lidar),
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
  const Vector3d beam_m = r.point_base_m - T_base_lidar_.p;
  r.range_m = beam_m.norm();
  r.residual_m = r.plane.normal.dot(point_odom_m) + r.plane.offset_m;
  if (r.range_m < 1e-3 || std::abs(r.residual_m) > kGatePerRootRange * std::sqrt(r.range_m)) {
    return false;
  }
  r.direction_base = beam_m / r.range_m;
  r.origin = nullptr;
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

double ScanMatcher::weight_of(const Residual& r, double cos_incidence) const {
  const double variance = variance_m2(r, cos_incidence);
  const double ratio = std::abs(r.residual_m) / (config_.robust_width * std::sqrt(variance));
  const double cos2 = cos_incidence * cos_incidence;
  const double surface = cos2 / (cos2 + config_.grazing_cos * config_.grazing_cos + 1e-12);
  return surface * (ratio > 1.0 ? 1.0 / ratio : 1.0) / variance;
}

void ScanMatcher::add(Residual& r, const Viewpoint& view, PoseInformation& sum) const {
  const Vector3d normal_base = view.R_odom_base.transpose() * r.plane.normal;
  r.residual_m =
      normal_base.dot(r.point_base_m) + r.plane.normal.dot(view.T_odom_base.p) + r.plane.offset_m;
  const double weight = weight_of(r, normal_base.dot(r.direction_base));
  // d(n . R exp(e) p) / de = (p x R^T n)^T
  Vector6d h;
  h << r.plane.normal, r.point_base_m.cross(normal_base);
  sum.information.selfadjointView<Eigen::Lower>().rankUpdate(h, weight);
  sum.gradient += weight * r.residual_m * h;
  add_noise(r.plane.normal, weight * r.plane.tilt2_rad2, sum.noise);
}

void ScanMatcher::add(Residual& r, const Viewpoint& view, PoseAndExtrinsicInformation& sum) const {
  const Vector3d point_base_m = view.T_base_base * r.point_base_m;
  const Vector3d point_odom_m = view.R_odom_base * point_base_m + view.T_odom_base.p;
  Vector3d normal = r.plane.normal;
  // The point of the plane below the measured one.
  Vector3d foot_odom_m = point_odom_m - (normal.dot(point_odom_m) + r.plane.offset_m) * normal;
  PoseAndExtrinsicInformation::Vector h = PoseAndExtrinsicInformation::Vector::Zero();
  if (r.origin != nullptr) {
    // Seen again from where it was made, through the present extrinsic.
    const Pose& T_odom_then = r.origin->T_odom_base;
    const Pose T_odom_lidar_then = T_odom_then * r.origin->T_base_lidar;
    const Pose T_odom_lidar = T_odom_then * view.T_base_lidar;
    const Vector3d foot_lidar_m = T_odom_lidar_then.inverse() * foot_odom_m;
    normal = T_odom_lidar.q * (T_odom_lidar_then.q.conjugate() * normal);
    foot_odom_m = T_odom_lidar * foot_lidar_m;
    const Vector3d normal_base = view.R_odom_base.transpose() * normal;
    const Vector3d point_lidar_m = T_base_lidar_.inverse() * r.point_base_m;
    const Vector3d normal_lidar = T_odom_lidar.q.conjugate() * normal;
    // The last term: the plane turns.
    h.segment<3>(error::kExtrinsicRotation) =
        point_lidar_m.cross(view.T_base_lidar.q.conjugate() * normal_base) -
        foot_lidar_m.cross(normal_lidar) +
        normal_lidar.cross(T_odom_lidar.q.conjugate() * (point_odom_m - foot_odom_m));
    h.segment<3>(error::kExtrinsicPosition) = normal_base - T_odom_then.q.conjugate() * normal;
  }
  const Vector3d normal_base = view.R_odom_base.transpose() * normal;
  r.residual_m = normal.dot(point_odom_m - foot_odom_m);
  const double weight = weight_of(r, normal_base.dot(r.direction_base));
  h.segment<3>(error::kPosition) = normal;
  h.segment<3>(error::kRotation) = point_base_m.cross(normal_base);
  sum.information.selfadjointView<Eigen::Lower>().rankUpdate(h, weight);
  sum.gradient += weight * r.residual_m * h;
  add_noise(normal, weight * r.plane.tilt2_rad2, sum.noise);
}

/// Block by block and the blocks in order, so that the sum has the same rounding on any number of
/// threads.
template <int Size>
Information<Size> ScanMatcher::sum_of_all(const Viewpoint& view,
                                          std::vector<Information<Size>>& sums) {
  sums.assign(blocks_of(residuals_.size()), {});
  workers_.run(sums.size(), [&](std::size_t block) {
    const std::size_t end = std::min((block + 1) * kBlock, residuals_.size());
    for (std::size_t i = block * kBlock; i < end; ++i) {
      add(residuals_[i], view, sums[block]);
    }
  });
  Information<Size> sum;
  for (const Information<Size>& part : sums) {
    sum.information += part.information;
    sum.gradient += part.gradient;
    sum.noise += part.noise;
  }
  sum.count = residuals_.size();
  const double scale =
      std::min(1.0,
               config_.independent_residuals /
                   static_cast<double>(std::max<std::size_t>(residuals_.size(), 1)));
  sum.information = (scale * typename Information<Size>::Matrix(
                                 sum.information.template selfadjointView<Eigen::Lower>()))
                        .eval();
  sum.gradient *= scale;
  sum.noise *= scale;
  take_out_noise(sum);
  return sum;
}

PoseInformation ScanMatcher::linearise(const Pose& T_odom_base) {
  if (must_match_again(T_odom_base)) {
    match(T_odom_base);
  }
  return sum_of_all(Viewpoint{T_odom_base, T_odom_base.q.toRotationMatrix(), T_base_lidar_, Pose{}},
                    sums_);
}

PoseAndExtrinsicInformation ScanMatcher::linearise(const Pose& T_odom_base,
                                                   const Pose& T_base_lidar,
                                                   const MapOrigins& origins) {
  if (must_match_again(T_odom_base)) {
    match(T_odom_base);
    for (Residual& r : residuals_) {
      r.origin = origins.find(T_odom_base * r.point_base_m);
    }
  }
  return sum_of_all(Viewpoint{T_odom_base,
                              T_odom_base.q.toRotationMatrix(),
                              T_base_lidar,
                              T_base_lidar * T_base_lidar_.inverse()},
                    sums_with_extrinsic_);
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
