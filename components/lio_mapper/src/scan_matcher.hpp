// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include "iterated_update.hpp"
#include "local_map.hpp"
#include "workers.hpp"
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace trigpoint::lio_mapper {

/// Information of directions that no residual sees, where an inverse is asked for.
inline constexpr double kUnseen = 1e-3;

/// L^-1 M L^-T: M where what `root` = L L^T is the root of is the identity.
inline Matrix6d whitened(const Eigen::LLT<Matrix6d>& root, const Matrix6d& matrix) {
  const Matrix6d half = root.matrixL().solve(matrix);
  return root.matrixL().solve(half.transpose());
}

/// Residuals of one scan against the planes of a local map: r = n . (R p + t) + d, FAST-LIO2
/// eq. 12. Sums the normal equations directly while it goes through the points.
class ScanMatcher {
 public:
  /// All but the pose are referred to, not copied; points in base axes, brought there with
  /// `T_base_lidar`. The result does not depend on the number of workers.
  ScanMatcher(const PointCloud& points_base,
              const LocalMap& map,
              const Pose& T_base_lidar,
              const MatchingConfig& config,
              Workers& workers);

  /// Looks up the planes of the points that have moved, since they were looked up, by more than
  /// planes can forgive; else only residuals and weights are new. Where surfaces leave the pose
  /// open, points without one, or with a rough one, are matched with their nearest points.
  PoseInformation linearise(const Pose& T_odom_base);

  /// What the last linearisation knows of the pose when patches, not points, are what
  /// is drawn: residuals in one patch share the map's errors, and by how much is seen in what the
  /// patches pull at the optimum (the covariance that is robust to clusters [K.-Y. Liang, S. L.
  /// Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986]).
  /// None where nearest points were matched, and along axes that fewer than four patches hold.
  /// 1/m^2 and 1/rad^2, in the error's axes.
  Matrix6d information_by_patches() const;

  /// Share of the points that lie within `distance_m` of their plane at the last linearisation.
  double share_within(double distance_m) const;

 private:
  /// Points that one thread takes at a time.
  static constexpr std::size_t kBlock = 256;

  struct Residual {
    Eigen::Vector3d point_base_m;
    Eigen::Vector3d direction_base;  ///< of the beam
    double range_m;
    Eigen::Vector3d looked_up_at_odom_m;
    PlaneMatch plane;
    double residual_m;
    double variance_m2;
    double weight;
    bool is_of_nearest{false};
    std::uint32_t patch;  ///< which cube of matching.patch_m it lies in
    std::uint32_t cell;   ///< which smaller one; set where an axis is open
  };

  /// What is put in front of the residuals of one linearisation.
  struct Viewpoint {
    Pose T_odom_base;
    Eigen::Matrix3d R_odom_base;
  };

  /// Of one linearisation.
  struct Scratch {
    std::vector<PoseInformation> sums;  ///< of blocks
    std::vector<Vector6d> rows;         ///< of residuals
    // Of the last complete sum: as it was before it was weighed, the step that it asks for, ...
    Matrix6d unweighed{Matrix6d::Zero()};
    Vector6d step{Vector6d::Zero()};
    // ... the share that is left along axes whose normals are noisy, and the least that residuals
    // may scatter by, in parts of their stated variances.
    Matrix6d kept{Matrix6d::Zero()};
    double least_scatter{1.0};
  };

  /// What a patch of a scan that is displaced by d pulls it back, and what A promises: sums of
  /// w r h d and of w h h d d over its points.
  struct Pull {
    double back{0.0};
    double promised{0.0};
  };

  struct Share {
    double share;
    double sigma;
  };

  /// What was judged axis by axis; ones along those that are not open.
  struct OpenAxes {
    std::optional<Eigen::Matrix3d> axes_odom;              ///< columns; none before it was judged
    Eigen::Vector3d pulled_back{Eigen::Vector3d::Ones()};  ///< certain share of the promised pull
    Eigen::Vector3d likely{Eigen::Vector3d::Ones()};       ///< the share itself, 0 to 1
    Eigen::Vector3d root_trust{Eigen::Vector3d::Ones()};   ///< root of the share believed
  };

  /// What a sum is worth along axes of the position.
  struct Worth {
    Eigen::Matrix3d axes_odom;                         ///< columns
    Eigen::Vector3d noise_free;                        ///< share of the information, 0 to 1
    Eigen::Vector3d certain{Eigen::Vector3d::Ones()};  ///< share of what is noise-free, 0 to 1
    Eigen::Vector3d likely;                            ///< share of the promised pull that comes
  };

  using Ask = bool (LocalMap::*)(const Eigen::Vector3d&, PlaneMatch&) const;

  enum class Found : std::uint8_t { kNotAsked, kNothing, kNoNearest, kMisfit, kPlane };

  void refresh(std::size_t i, const Viewpoint& view);
  Found look_up(Ask ask, Residual& residual) const;
  bool needs_nearest(Found found, const Residual& residual) const;
  bool is_judgement_due(const Pose& T_odom_base) const;
  void forget_judgement();
  static bool leaves_pose_open(const Matrix6d& information);
  double variance_m2(const Residual& residual, double cos_incidence) const;
  void weigh(Residual& residual, double cos_incidence) const;
  /// Puts residual and weight of `view` into `residual` and gives its row of the Jacobian.
  Vector6d row_of(Residual& residual, const Viewpoint& view) const;
  Matrix6d scatter_after(const Vector6d& step);
  void add_pulls(Viewpoint view,
                 const Eigen::Vector3d& axis_odom,
                 double displaced_m,
                 std::vector<Pull>& by_patch);
  static Share share_of(const std::vector<Pull>& by_patch);
  double trust_in(const Eigen::Vector3d& axis_odom, std::size_t cells) const;
  Eigen::Matrix3d axes_of_surfaces(const Eigen::Matrix3d& information) const;
  Worth worth_along_axes(const PoseInformation& sum) const;
  void judge_open_axes(const Viewpoint& view, const Eigen::Matrix3d& information);
  std::size_t number_cubes(double side_m, std::uint32_t Residual::*number);
  std::size_t count_patches();

  std::size_t blocks() const { return (residuals_.size() + kBlock - 1) / kBlock; }

  template <typename Visit>
  void in_blocks(const Visit& visit);
  PoseInformation sum_of_all(const Viewpoint& view);
  PoseInformation weighed(PoseInformation sum, double least_scatter);

  const PointCloud& points_base_;
  const LocalMap& map_;
  const MatchingConfig& config_;
  Workers& workers_;
  std::optional<Pose> judged_at_;  ///< where it was asked whether surfaces are enough
  bool also_nearest_{false};
  OpenAxes open_;
  std::vector<Residual> residuals_;  ///< one a point, also where none was found
  std::vector<Found> found_;
  std::vector<std::uint8_t> patches_;  ///< whether a residual lies in it
  Scratch scratch_;
};

/// Block by block, so that sums of blocks that are added in order have the same rounding on any
/// number of threads.
template <typename Visit>
void ScanMatcher::in_blocks(const Visit& visit) {
  workers_.run(blocks(), [&](std::size_t block) {
    const std::size_t end = std::min((block + 1) * kBlock, residuals_.size());
    for (std::size_t i = block * kBlock; i < end; ++i) {
      visit(block, i);
    }
  });
}

}  // namespace trigpoint::lio_mapper
