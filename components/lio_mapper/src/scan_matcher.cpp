// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "scan_matcher.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <utility>

namespace trigpoint::lio_mapper {

using Eigen::Vector3d;

namespace {

/// Of the promised pull; where less comes, no step does.
constexpr double kLeastPull = 1e-3;

/// A point that moved less sees the same plane.
constexpr double kRematch_m = 0.05;
/// What matches were found to be worth holds this near: points at ten metres keep their planes.
constexpr double kJudgedWithin_m = kRematch_m;
constexpr double kJudgedWithin_rad = kRematch_m / 10.0;
constexpr double kLeastRange_m = 1e-3;
/// FAST-LIO2's acceptance 1 - 0.9 |r| / sqrt(range) > 0.9: near points must fit more closely.
constexpr double kGatePerRootRange = 1.0 / 9.0;
/// Planes of few points look thinner than they are.
constexpr double kLeastVariance_m2 = 0.01 * 0.01;

/// E[n n^T] of a normal whose direction has variance tilt2 exceeds the true one by this.
void add_noise(const Vector3d& normal, double weighted_tilt2, Eigen::Matrix3d& noise) {
  noise -= weighted_tilt2 * normal * normal.transpose();
  noise.diagonal().array() += weighted_tilt2;
}

/// Of the residuals' variance that which is the map's: points on one plane share it, so that it
/// does not scatter between them.
double share_of_map(const PoseInformation& sum) {
  return (kLeastVariance_m2 * sum.weight_per_m2 + sum.weighted_thickness2) /
         (sum.weighted_variance + 1e-12);
}

/// The plane's normal stands in the columns of the position. All of the matrix is summed: half of
/// it takes longer.
void add_row(const Vector6d& h,
             double weight,
             double residual_m,
             const PlaneMatch& plane,
             PoseInformation& sum) {
  sum.information.noalias() += (weight * h) * h.transpose();
  sum.gradient += weight * residual_m * h;
  sum.weight_per_m2 += weight;
  sum.weighted_thickness2 += weight * plane.thickness2_m2;
  ++sum.count;
  add_noise(h.segment<3>(error::kPosition), weight * plane.tilt2_rad2, sum.noise);
}

/// Where the residuals at the optimum scatter more than their variances say, as those of crowns do,
/// their estimate is as much less certain: with A = L L^T and B = sum w^2 r^2 h h^T its covariance
/// is A^-1 B A^-1 [H. White, "A heteroskedasticity-consistent covariance matrix estimator", 1980],
/// and the eigenvalues of L^-1 B L^-T are how many times the stated variance that is, direction by
/// direction. Each such direction keeps its estimate and loses that share of its information, or
/// gains it where they scatter less, down to the share `least` of the stated variance.
void allow_for_scatter(const Matrix6d& scatter,
                       const Eigen::LLT<Matrix6d>& root,
                       const Vector6d& step,
                       double least,
                       PoseInformation& sum) {
  // What no residual sees scatters as the root says, neither more nor less.
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(
      whitened(root, scatter + kUnseen * Matrix6d::Identity()));
  const Matrix6d directions = root.matrixL() * eigen.eigenvectors();
  sum.information = directions * eigen.eigenvalues().cwiseMax(least).cwiseInverse().asDiagonal() *
                    directions.transpose();
  sum.gradient = -(sum.information * step).eval();
}

}  // namespace

ScanMatcher::ScanMatcher(const PointCloud& points_base,
                         const LocalMap& map,
                         const Pose& T_base_lidar,
                         const MatchingConfig& config,
                         Workers& workers)
    : points_base_(points_base),
      map_(map),
      config_(config),
      workers_(workers),
      residuals_(points_base.size()),
      found_(points_base.size(), Found::kNotAsked) {
  for (std::size_t i = 0; i < points_base.size(); ++i) {
    Residual& r = residuals_[i];
    r.point_base_m = points_base[i].position().cast<double>();
    const Vector3d beam_m = r.point_base_m - T_base_lidar.p;
    r.range_m = beam_m.norm();
    r.direction_base = beam_m / std::max(r.range_m, kLeastRange_m);
  }
  patches_.resize(number_cubes(config_.patch_m, &Residual::patch));
}

/// With a residual in them.
std::size_t ScanMatcher::count_patches() {
  std::fill(patches_.begin(), patches_.end(), std::uint8_t{0});
  std::size_t count = 0;
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    std::uint8_t& seen = patches_[residuals_[i].patch];
    if (found_[i] == Found::kPlane && seen == 0) {
      seen = 1;
      ++count;
    }
  }
  return count;
}

ScanMatcher::Found ScanMatcher::look_up(Ask ask, Residual& r) const {
  if (!(map_.*ask)(r.looked_up_at_odom_m, r.plane)) {
    return Found::kNothing;
  }
  r.residual_m = r.plane.normal.dot(r.looked_up_at_odom_m) + r.plane.offset_m;
  const bool fits = r.range_m >= kLeastRange_m &&
                    std::abs(r.residual_m) <= kGatePerRootRange * std::sqrt(r.range_m);
  return fits ? Found::kPlane : Found::kMisfit;
}

/// A window over foliage has a plane too, through crowns and gaps; what its points scatter by is
/// more than measuring and averaging leave of a surface.
bool ScanMatcher::needs_nearest(Found found, const Residual& r) const {
  const bool is_rough = r.plane.thickness2_m2 > kLeastVariance_m2;
  return found == Found::kNothing ||
         (found == Found::kPlane && !r.is_of_nearest && is_rough && map_.has_nearest());
}

/// A point that moved little since it was looked up keeps what was found.
void ScanMatcher::refresh(std::size_t i, const Viewpoint& view) {
  Residual& r = residuals_[i];
  const Vector3d point_odom_m = view.R_odom_base * r.point_base_m + view.T_odom_base.p;
  const bool kept = found_[i] != Found::kNotAsked &&
                    (point_odom_m - r.looked_up_at_odom_m).squaredNorm() < kRematch_m * kRematch_m;
  if (!kept) {
    r.looked_up_at_odom_m = point_odom_m;
    found_[i] = look_up(&LocalMap::match_surface, r);
    r.is_of_nearest = false;
  }
  const bool ask_nearest = also_nearest_ && needs_nearest(found_[i], r);
  if (ask_nearest) {
    r.is_of_nearest = look_up(&LocalMap::match_nearest, r) == Found::kPlane;
    found_[i] = r.is_of_nearest ? Found::kPlane : Found::kNoNearest;
  }
}

double ScanMatcher::variance_m2(const Residual& r, double cos_incidence) const {
  const double cos2 = cos_incidence * cos_incidence;
  const double range2 = config_.range_sigma_m * config_.range_sigma_m * cos2;
  const double sideways_m = config_.angle_sigma_rad * r.range_m;
  return kLeastVariance_m2 + range2 + sideways_m * sideways_m * (1.0 - cos2) +
         r.plane.thickness2_m2;
}

void ScanMatcher::weigh(Residual& r, double cos_incidence) const {
  r.variance_m2 = variance_m2(r, cos_incidence);
  const double variance = r.variance_m2;
  const double ratio = std::abs(r.residual_m) / (config_.robust_width * std::sqrt(variance));
  const double cos2 = cos_incidence * cos_incidence;
  const double surface = cos2 / (cos2 + config_.grazing_cos * config_.grazing_cos + 1e-12);
  r.weight = surface * (ratio > 1.0 ? 1.0 / ratio : 1.0) / variance;
}

Vector6d ScanMatcher::row_of(Residual& r, const Viewpoint& view) const {
  const Vector3d normal_base = view.R_odom_base.transpose() * r.plane.normal;
  r.residual_m =
      normal_base.dot(r.point_base_m) + r.plane.normal.dot(view.T_odom_base.p) + r.plane.offset_m;
  weigh(r, normal_base.dot(r.direction_base));
  // d(n . R exp(e) p) / de = (p x R^T n)^T
  Vector6d h;
  h << r.plane.normal, r.point_base_m.cross(normal_base);
  return h;
}

/// sum w^2 r^2 h h^T with the residuals r after `step` from where they were linearised.
Matrix6d ScanMatcher::scatter_after(const Vector6d& step) {
  scratch_.sums.assign(blocks(), {});
  in_blocks([&](std::size_t block, std::size_t i) {
    if (found_[i] == Found::kPlane) {
      const Vector6d& h = scratch_.rows[i];
      const double part = residuals_[i].weight * (residuals_[i].residual_m + h.dot(step));
      scratch_.sums[block].information.noalias() += (part * part * h) * h.transpose();
    }
  });
  Matrix6d sum = Matrix6d::Zero();
  for (const PoseInformation& part : scratch_.sums) {
    sum += part.information;
  }
  return sum;
}

PoseInformation ScanMatcher::sum_of_all(const Viewpoint& view) {
  scratch_.sums.assign(blocks(), {});
  scratch_.rows.resize(residuals_.size());
  in_blocks([&](std::size_t block, std::size_t i) {
    refresh(i, view);
    if (found_[i] == Found::kPlane) {
      Residual& r = residuals_[i];
      scratch_.rows[i] = row_of(r, view);
      add_row(scratch_.rows[i], r.weight, r.residual_m, r.plane, scratch_.sums[block]);
      scratch_.sums[block].weighted_variance += r.weight * r.variance_m2;
    }
  });
  PoseInformation sum;
  for (const PoseInformation& part : scratch_.sums) {
    sum.information += part.information;
    sum.gradient += part.gradient;
    sum.noise += part.noise;
    sum.weight_per_m2 += part.weight_per_m2;
    sum.weighted_thickness2 += part.weighted_thickness2;
    sum.weighted_variance += part.weighted_variance;
    sum.count += part.count;
  }
  return sum;
}

/// Normals are measured too. Along a tunnel none has a true component, but their noise has one, and
/// its squares add up to information that is none: least squares with noisy regressors, which holds
/// the estimate back at the prediction and makes it look certain [W. A. Fuller, Measurement Error
/// Models, 1987, ch. 1]. Along each principal axis of the position's information A, with N of it
/// noise and f = 1 - N / A: the solution g / (A - N) has the variance A / (A - N)^2, which is that
/// of the information f^2 A with the gradient f g. Where axes were judged, it is those, and the
/// smaller share is meant.
ScanMatcher::Worth ScanMatcher::worth_along_axes(const PoseInformation& sum) const {
  const Eigen::Matrix3d position = sum.information.topLeftCorner<3, 3>();
  Worth worth;
  worth.axes_odom = open_.axes_odom
                        ? *open_.axes_odom
                        : Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(position).eigenvectors();
  for (int i = 0; i < 3; ++i) {
    const Vector3d axis = worth.axes_odom.col(i);
    const double noise = axis.dot(sum.noise * axis);
    worth.noise_free[i] = std::max(0.0, 1.0 - noise / (axis.dot(position * axis) + 1e-12));
    worth.likely[i] = std::min(worth.noise_free[i], open_.likely[i]);
    if (worth.noise_free[i] > 0.0) {
      const double certain = std::min(worth.noise_free[i], open_.pulled_back[i]);
      worth.certain[i] = open_.root_trust[i] * certain / worth.noise_free[i];
    }
  }
  return worth;
}

/// Of the noise-free information, along each axis the share `certain`^2. The rest is taken out as
/// if that axis were a nuisance of so much more variance: with it goes what it says of the heading
/// and of the other axes. (Only its own rows and columns made smaller, the rest would pass for
/// certain, and a place that is wrong along a street would turn the robot.)
Matrix6d left_of(const Matrix6d& noise_free,
                 const Eigen::Matrix3d& axes_odom,
                 const Vector3d& certain) {
  Matrix6d left = noise_free;
  for (int i = 0; i < 3; ++i) {
    const Vector6d told = left.leftCols<3>() * axes_odom.col(i);
    const double along = axes_odom.col(i).dot(told.head<3>());
    if (along > kUnseen * kUnseen) {
      left -= (1.0 - certain[i] * certain[i]) / along * told * told.transpose();
    }
  }
  return left;
}

/// A matrix over the position's axes, the identity over the rotation.
Matrix6d over_axes(const Eigen::Matrix3d& axes_odom, const Vector3d& along) {
  Matrix6d all = Matrix6d::Identity();
  all.topLeftCorner<3, 3>() = axes_odom * along.asDiagonal() * axes_odom.transpose();
  return all;
}

/// What the sum over all residuals is worth.
PoseInformation ScanMatcher::weighed(PoseInformation sum, double least_scatter) {
  if (sum.count == 0) {
    scratch_.kept.setZero();
    return sum;
  }
  const Worth worth = worth_along_axes(sum);
  const Eigen::LLT<Matrix6d> root(sum.information + kUnseen * Matrix6d::Identity());
  scratch_.unweighed = sum.information;
  scratch_.step = -root.solve(sum.gradient);
  allow_for_scatter(scatter_after(scratch_.step), root, scratch_.step, least_scatter, sum);
  const auto most = static_cast<std::size_t>(config_.max_patches);
  const double scale =
      static_cast<double>(std::min(count_patches(), most)) / static_cast<double>(sum.count);
  scratch_.least_scatter = least_scatter;
  scratch_.kept = over_axes(worth.axes_odom, worth.noise_free);
  sum.information = scale * left_of(scratch_.kept * sum.information * scratch_.kept.transpose(),
                                    worth.axes_odom,
                                    worth.certain);
  // The step is as long as the pull that comes says, not as what is promised.
  const Vector3d longer = (worth.likely.array() > kLeastPull)
                              .select(worth.likely.cwiseMax(kLeastPull).cwiseInverse(), 0.0);
  sum.gradient = -sum.information * over_axes(worth.axes_odom, longer) * scratch_.step;
  sum.noise *= scale;
  return sum;
}

/// What holds at one pose need not hold at another: where the prediction was a guess, most points
/// lie beside their planes until the first step.
bool ScanMatcher::is_judgement_due(const Pose& T_odom_base) const {
  return !judged_at_ || (T_odom_base.p - judged_at_->p).norm() > kJudgedWithin_m ||
         so3_log(T_odom_base.q.conjugate() * judged_at_->q).norm() > kJudgedWithin_rad;
}

/// Surfaces are asked alone again.
void ScanMatcher::forget_judgement() {
  also_nearest_ = false;
  open_ = {};
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    if (std::exchange(residuals_[i].is_of_nearest, false) || found_[i] == Found::kNoNearest) {
      found_[i] = Found::kNotAsked;
    }
  }
}

PoseInformation ScanMatcher::linearise(const Pose& T_odom_base) {
  const Viewpoint view{T_odom_base, T_odom_base.q.toRotationMatrix()};
  const bool judge = is_judgement_due(view.T_odom_base);
  if (judge) {
    forget_judgement();
    judged_at_ = view.T_odom_base;
  }
  PoseInformation sum = sum_of_all(view);
  if (judge) {
    const auto cautious = weighed(sum, 1.0);
    also_nearest_ = leaves_pose_open(cautious.information);
    if (also_nearest_) {
      sum = sum_of_all(view);
      const bool any_nearest = std::any_of(
          residuals_.begin(), residuals_.end(), [](const Residual& r) { return r.is_of_nearest; });
      if (any_nearest) {
        const auto promised = weighed(sum, 1.0);
        judge_open_axes(view, promised.information.topLeftCorner<3, 3>());
      }
    }
  }
  // A plane of the few points nearest to one that is matched goes through them whatever their
  // noise: that residuals against such planes are small is no witness.
  return weighed(sum, also_nearest_ ? 1.0 : share_of_map(sum));
}

double ScanMatcher::share_within(double distance_m) const {
  std::size_t near = 0;
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    near += found_[i] == Found::kPlane && std::abs(residuals_[i].residual_m) < distance_m ? 1 : 0;
  }
  return points_base_.empty()
             ? 0.0
             : static_cast<double>(near) / static_cast<double>(points_base_.size());
}

}  // namespace trigpoint::lio_mapper
