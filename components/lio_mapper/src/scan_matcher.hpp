// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include "iterated_update.hpp"
#include "local_map.hpp"
#include "map_origins.hpp"
#include "workers.hpp"
#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace trigpoint::lio_mapper {

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
  /// open, points without one are matched with their nearest points.
  PoseInformation linearise(const Pose& T_odom_base);

  /// The same with the extrinsic as unknown, r = n . (R (R_bl p_l + t_bl) + p) + d. Where the map's
  /// origin is known (R_0, p_0, and the extrinsic then), the plane moves with the extrinsic as the
  /// points that made it do; elsewhere the residual is taken to know nothing of the extrinsic.
  PoseAndExtrinsicInformation linearise(const Pose& T_odom_base,
                                        const Pose& T_base_lidar,
                                        const MapOrigins& origins);

  /// Share of the points that lie within `distance_m` of their plane at the last linearisation.
  double share_within(double distance_m) const;

 private:
  struct Residual {
    Eigen::Vector3d point_base_m;
    Eigen::Vector3d direction_base;  ///< of the beam
    double range_m;
    Eigen::Vector3d looked_up_at_odom_m;
    PlaneMatch plane;
    double residual_m;
    double weight;
    const MapOrigin* origin;  ///< of the plane; null: unknown, or not asked for
    bool is_of_nearest{false};
    std::uint32_t patch;  ///< which cube of matching.patch_m it lies in
  };

  /// What is put in front of the residuals of one linearisation.
  struct Viewpoint {
    Pose T_odom_base;
    Eigen::Matrix3d R_odom_base;
    Pose T_base_lidar;
    Pose T_base_base;  ///< from the axes of the points to those of the present extrinsic
  };

  /// Of one linearisation.
  template <int Size>
  struct Scratch {
    std::vector<Information<Size>> sums;                   ///< of blocks
    std::vector<typename Information<Size>::Vector> rows;  ///< of residuals
  };

  /// Of a displaced scan along an axis, sums over its points: w r h, w h h, and their products.
  struct Pull {
    double gradient{0.0};
    double information{0.0};
    double gradient2{0.0};
    double both{0.0};
    double information2{0.0};

    Pull& operator+=(const Pull& other) {
      gradient += other.gradient;
      information += other.information;
      gradient2 += other.gradient2;
      both += other.both;
      information2 += other.information2;
      return *this;
    }

    /// Variance of the gradient, when all residuals were expected to be `displaced_m` h.
    double scatter_about(double displaced_m) const {
      return gradient2 - 2.0 * displaced_m * both + displaced_m * displaced_m * information2;
    }
  };

  using Ask = bool (LocalMap::*)(const Eigen::Vector3d&, PlaneMatch&) const;

  enum class Found : std::uint8_t { kNotAsked, kNothing, kMisfit, kPlane };

  void refresh(std::size_t i, const Viewpoint& view, const MapOrigins* origins);
  Found look_up(Ask ask, Residual& residual) const;
  static bool leaves_pose_open(const Matrix6d& information);
  double variance_m2(const Residual& residual, double cos_incidence) const;
  double weight_of(const Residual& residual, double cos_incidence) const;
  /// Puts residual and weight of `view` into `residual` and gives its row of the Jacobian.
  template <int Size>
  typename Information<Size>::Vector row_of(Residual& residual, const Viewpoint& view) const;
  template <int Size>
  typename Information<Size>::Matrix scatter_after(const typename Information<Size>::Vector& step,
                                                   Scratch<Size>& scratch);
  Pull pull_at(const Viewpoint& view, const Eigen::Vector3d& axis_odom);
  Eigen::Matrix3d share_pulled_back(const Viewpoint& view, const Eigen::Matrix3d& information);
  void number_patches();
  std::size_t count_patches();
  template <typename Visit>
  void in_blocks(const Visit& visit);
  template <int Size>
  Information<Size> sum_of_all(const Viewpoint& view,
                               const MapOrigins* origins,
                               Scratch<Size>& scratch);
  template <int Size>
  Information<Size> weighed(Information<Size> sum, double least_scatter, Scratch<Size>& scratch);
  template <int Size>
  Information<Size> linearise_all(const Viewpoint& view,
                                  const MapOrigins* origins,
                                  Scratch<Size>& scratch);

  const PointCloud& points_base_;
  const LocalMap& map_;
  Pose T_base_lidar_;
  const MatchingConfig& config_;
  Workers& workers_;
  bool judged_{false};  ///< whether surfaces are enough for this scan
  bool also_nearest_{false};
  Eigen::Matrix3d pulled_back_{Eigen::Matrix3d::Identity()};  ///< see share_pulled_back
  std::vector<Residual> residuals_;  ///< one a point, also where none was found
  std::vector<Found> found_;
  std::vector<std::uint8_t> patches_;  ///< whether a residual lies in it
  Scratch<error::kPose> scratch_;
  Scratch<error::kPoseAndExtrinsic> scratch_with_extrinsic_;
};

}  // namespace trigpoint::lio_mapper
