// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What matches are worth along axes that surfaces leave open.
#include "scan_matcher.hpp"
#include "voxel_key.hpp"
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <tsl/robin_map.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace trigpoint::lio_mapper {

using Eigen::Vector3d;

namespace {

/// Surfaces that leave the pose less certain than this are not enough: among walls they leave 5 mm
/// and 0.6 mrad, among trees 13 mm.
constexpr double kOpenPosition_m = 0.01;
constexpr double kOpenRotation_rad = 2e-3;
/// By so much a scan is displaced to see whether it is pulled back: within this other points become
/// the nearest, and surfaces are still found.
constexpr double kDisplaced_m = 0.25;
/// So many points tell that.
constexpr std::size_t kDisplacedPoints = 1000;
/// Side of the cubes whose planes are taken to be right or wrong together.
constexpr double kCell_m = 1.5;
/// A share of the information that is less certain than this many sigmas is none.
constexpr double kCertainShare_sigmas = 2.0;
/// What is vague is believed when at least this share of the pull is certain: three posts in a
/// field pull back all that they promise, crowns and rings on a ceiling a third.
constexpr double kMostlyPulled = 0.5;
/// In the choice of axes.
constexpr double kSaidByAll = 0.01;
/// Of the promise, where one patch holds the rest.
constexpr double kLeastPromise = 1e-3;

}  // namespace

/// Into which cube of this side each point falls; how many cubes there are. Points out of the
/// index's range, which no LiDAR reaches, are in one cube.
std::size_t ScanMatcher::number_cubes(double side_m, std::uint32_t Residual::*number) {
  const double per_m = 1.0 / side_m;
  tsl::robin_map<VoxelKey, std::uint32_t, VoxelKeyHash> numbers;
  for (Residual& r : residuals_) {
    const Vector3d& p = r.point_base_m;
    const VoxelKey key = voxel_index_fits(p.x(), p.y(), p.z(), per_m)
                             ? voxel_key(voxel_index(p.x(), p.y(), p.z(), per_m))
                             : ~VoxelKey{0};
    r.*number = numbers.try_emplace(key, static_cast<std::uint32_t>(numbers.size())).first->second;
  }
  return numbers.size();
}

/// Whether surfaces alone leave the pose so uncertain that dearer matches are worth it, as in
/// foliage.
bool ScanMatcher::leaves_pose_open(const Matrix6d& information) {
  const Matrix6d covariance =
      (information + kUnseen * Matrix6d::Identity()).llt().solve(Matrix6d::Identity());
  const auto largest = [&](int at) {
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance.block<3, 3>(at, at),
                                                          Eigen::EigenvaluesOnly)
        .eigenvalues()[2];
  };
  return largest(error::kPosition) > kOpenPosition_m * kOpenPosition_m ||
         largest(error::kRotation) > kOpenRotation_rad * kOpenRotation_rad;
}

/// To `by_patch`: the pull back along `axis` of the scan displaced by `displaced_m`, all matches
/// sought anew, and how much of it is promised.
void ScanMatcher::add_pulls(Viewpoint view,
                            const Vector3d& axis,
                            double displaced_m,
                            std::vector<Pull>& by_patch) {
  view.T_odom_base.p += displaced_m * axis;
  const std::size_t every = residuals_.size() / kDisplacedPoints + 1;
  std::vector<Pull> pulls(residuals_.size());
  in_blocks([&](std::size_t /*block*/, std::size_t i) {
    if (i % every != 0) {
      return;
    }
    Residual r = residuals_[i];
    r.looked_up_at_odom_m = view.R_odom_base * r.point_base_m + view.T_odom_base.p;
    r.is_of_nearest = false;
    Found found = look_up(&LocalMap::match_surface, r);
    if (needs_nearest(found, r)) {
      found = look_up(&LocalMap::match_nearest, r);
    }
    if (found == Found::kNothing) {
      return;
    }
    const double h = r.plane.normal.dot(axis);
    // Off a wall, as it is displaced, a point has a large residual and is no outlier.
    const double residual_m = std::exchange(r.residual_m, 0.0);
    weigh(r, (view.R_odom_base * r.direction_base).dot(r.plane.normal));
    pulls[i] = {r.weight * residual_m * h * displaced_m,
                r.weight * h * h * displaced_m * displaced_m};
  });
  for (std::size_t i = 0; i < pulls.size(); ++i) {
    Pull& patch = by_patch[residuals_[i].patch];
    patch.back += pulls[i].back;
    patch.promised += pulls[i].promised;
  }
}

/// Of the ratio of the patches' sums: f with its standard deviation when patches, not points, are
/// what is drawn, by leaving out each patch in turn [B. Efron, C. Stein, "The jackknife estimate of
/// variance", Ann. Statist. 9, 1981]. One patch that holds all of the promise tells nothing:
/// without it there is none.
ScanMatcher::Share ScanMatcher::share_of(const std::vector<Pull>& by_patch) {
  double back = 0.0;
  double promised = 0.0;
  double patches = 0.0;
  for (const Pull& patch : by_patch) {
    back += patch.back;
    promised += patch.promised;
    patches += patch.promised > 0.0 ? 1.0 : 0.0;
  }
  if (patches < 2.0) {
    return {0.0, 0.0};
  }
  const double share = back / promised;
  double squares = 0.0;
  for (const Pull& patch : by_patch) {
    const double without =
        (back - patch.back) / std::max(promised - patch.promised, kLeastPromise * promised);
    squares += patch.promised > 0.0 ? (without - share) * (without - share) : 0.0;
  }
  return {share, std::sqrt((patches - 1.0) / patches * squares)};
}

/// The principal axes of what surfaces say of the position. Those of all information lean where
/// planes through nearest points are false: along a tunnel towards its walls, whose true pull then
/// vouches for the false one. Where surfaces say next to nothing, all of it decides.
Eigen::Matrix3d ScanMatcher::axes_of_surfaces(const Eigen::Matrix3d& information) const {
  Eigen::Matrix3d said = kSaidByAll * information;
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    const Residual& r = residuals_[i];
    if (found_[i] == Found::kPlane && !r.is_of_nearest) {
      said += r.weight * r.plane.normal * r.plane.normal.transpose();
    }
  }
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(said).eigenvectors();
}

/// Where surfaces are volumes, as crowns are, or planes lie as chance and the rings' pattern lay
/// them, a scan that is moved finds other planes beside each point and is content: residuals that
/// are linearised promise a pull back that does not come, and hold the estimate at its prediction.
/// (Asked only where nearest points were matched: surfaces alone are held to be some.) Along each
/// axis that is open: by how much of what A promises the gradient really changes between two
/// displaced places, the secant f A in place of the tangent A. The solution is then g / (f A), with
/// the information f^2 A, as for noisy normals; the information with the part of f that is certain,
/// the solution with f itself, or the less is certain the farther it would go.
void ScanMatcher::judge_open_axes(const Viewpoint& view, const Eigen::Matrix3d& information) {
  open_.axes_odom = axes_of_surfaces(information);
  const std::size_t cells = number_cubes(kCell_m, &Residual::cell);
  for (int i = 0; i < 3; ++i) {
    const Vector3d axis = open_.axes_odom->col(i);
    double along = 1.0;
    double trust = 1.0;
    double likely = 1.0;
    const double promised_here = axis.dot(information * axis);
    if (promised_here > kUnseen && promised_here < 1.0 / (kOpenPosition_m * kOpenPosition_m)) {
      std::vector<Pull> by_patch(patches_.size());
      add_pulls(view, axis, kDisplaced_m, by_patch);
      add_pulls(view, axis, -kDisplaced_m, by_patch);
      const Share pulled = share_of(by_patch);
      along = std::clamp(pulled.share - kCertainShare_sigmas * pulled.sigma, 0.0, 1.0);
      likely = std::clamp(pulled.share, 0.0, 1.0);
      trust = trust_in(axis, cells);
      // Vaguer than the displacement within which matches hold, and most of it not even certain.
      const double left = trust * along * along * promised_here;
      const bool is_vague = left * kDisplaced_m * kDisplaced_m < 1.0;
      trust = is_vague && along < kMostlyPulled ? 0.0 : trust;
    }
    open_.pulled_back[i] = along;
    open_.likely[i] = likely;
    open_.root_trust[i] = std::sqrt(trust);
  }
}

/// What few places say of an axis has a t-distribution of as many degrees of freedom, less one, and
/// so a variance that is n / (n - 2) of the normal one, and none at all up to two: that the planes
/// of one place are right is seen by those of the others only. How many places there are: Kish's
/// effective number, (sum c)^2 / sum c^2, of their parts c of the information.
double ScanMatcher::trust_in(const Vector3d& axis, std::size_t cells) const {
  std::vector<double> by_cell(cells);
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    if (found_[i] == Found::kPlane) {
      const double h = residuals_[i].plane.normal.dot(axis);
      by_cell[residuals_[i].cell] += residuals_[i].weight * h * h;
    }
  }
  double sum = 0.0;
  double squares = 0.0;
  for (const double part : by_cell) {
    sum += part;
    squares += part * part;
  }
  const double freedom = squares > 0.0 ? sum * sum / squares - 1.0 : 0.0;
  return freedom > 2.0 ? (freedom - 2.0) / freedom : 0.0;
}

}  // namespace trigpoint::lio_mapper
