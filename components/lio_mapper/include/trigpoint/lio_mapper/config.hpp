// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <string>

namespace trigpoint {
class ConfigFields;
}

namespace trigpoint::lio_mapper {

/// How an input cloud tells its points' times.
struct SweepTimingConfig {
  std::string point_time{"field"};             ///< field | azimuth | snapshot
  std::string stamp_is{"auto"};                ///< auto | begin | middle | end of the sweep
  std::string time_field{"auto"};              ///< auto, or the field's name
  std::string time_unit{"auto"};               ///< auto | s | ms | us | ns
  double sweep_period_s{0.1};                  ///< for azimuth timing
  double first_azimuth_rad{3.14159265358979};  ///< azimuth timing: where the sweep begins
  bool clockwise{true};                        ///< azimuth timing: seen from above
  double min_range_m{0.5};
  double max_range_m{120.0};
  double time_offset_s{0.0};  ///< added to LiDAR stamps to bring them to the IMU's clock
};

struct SurfelMapConfig {
  double leaf_m{0.5};             ///< side of a leaf voxel; a parent is 3 x 3 x 3 leaves
  std::size_t leaf_capacity{20};  ///< points after which a leaf's mean is frozen
  double max_flatness{0.03};      ///< smallest over largest eigenvalue of a plane's leaf means
  double min_linearity{0.1};      ///< middle over largest eigenvalue, so that a line is no plane
  double max_residual_m{0.5};     ///< farther planes do not explain a point
  bool nearest_points{true};      ///< where no plane holds: one through five points
};

struct IkdMapConfig {
  double voxel_m{0.5};               ///< one point a voxel
  double max_neighbour_m{2.236};     ///< farthest of the five points that make a plane
  double max_plane_distance_m{0.1};  ///< of each of them from it
};

/// Noise of the IMU as the filter sees it: vibration and scale errors included, so larger than a
/// data sheet's.
struct ImuConfig {
  double gyro_noise_radps_sqrthz{5e-4};
  double accel_noise_mps2_sqrthz{2e-2};
  double gyro_bias_walk_radps_sqrts{2e-5};
  double accel_bias_walk_mps2_sqrts{3e-4};
  double initial_gyro_bias_sigma_radps{0.01};
  double initial_accel_bias_sigma_mps2{0.05};
  double max_gap_s{0.1};       ///< longer intervals between samples are bridged with inflated noise
  double lost_gap_s{0.5};      ///< sweeps that an interval longer than this touches are refused
  double gap_accel_mps2{0.5};  ///< sigma by which the bridged motion is wrong in a long gap
  double gap_gyro_radps{0.2};
};

struct StartConfig {
  double window_s{1.0};        ///< of IMU, before odom is levelled
  double max_speed_mps{40.0};  ///< forward speeds tried at the start
  double speed_step_mps{2.0};
  double rest_speed_mps{0.3};  ///< slower starts count as at rest when the IMU agrees
};

struct MatchingConfig {
  double voxel_m{0.5};  ///< down-sampling before matching
  double range_sigma_m{0.02};
  double angle_sigma_rad{1.5e-3};  ///< beam direction and divergence: counts at grazing incidence
  double robust_width{2.0};        ///< residuals beyond this many sigmas lose weight (Huber)
  double grazing_cos{0.15};        ///< planes that the beam hits more flatly lose weight
  double patch_m{5.0};             ///< residuals in a cube of this side weigh as one
  std::int64_t max_patches{200};   ///< more cubes weigh as this many
  std::int64_t min_matches{50};
  std::int64_t max_iterations{5};
  double converged_position_m{1e-3};
  double converged_rotation_rad{1e-4};
  std::int64_t threads{2};   ///< that match; the result is the same for any number
  double lost_after_s{2.0};  ///< coasting longer than this is LOST
};

/// Estimation of how the LiDAR is turned, about what is configured.
struct ExtrinsicConfig {
  bool estimate{false};
  double rotation_sigma_rad{0.03};
  double level_sigma_rad{0.01};  ///< of roll and pitch when they are not estimated
  double position_sigma_m{0.05};
};

struct LocalMapConfig {
  double half_side_m{150.0};  ///< of the cube around the robot that is kept
  double prune_every_m{10.0};
  std::string kind{"surfel_map"};  ///< surfel_map | ikd_tree
  SurfelMapConfig surfel;
  IkdMapConfig ikd;
};

/// How fast odom drifts away from the truth: random walk of T_map_odom per metre driven.
struct DriftConfig {
  double position_sigma_m_sqrtm{0.0002};
  double yaw_sigma_rad_sqrtm{2e-5};
  double tilt_sigma_rad_sqrtm{2e-5};
  /// Share of the pose's covariance relative to the local map that the map inherits per metre.
  double map_renewal_per_m{0.25};
  /// Random walk of the tilt of odom against gravity that moves the robot along an axis which scans
  /// do not hold.
  double blind_tilt_rad_sqrts{1.6e-3};
};

struct RowsConfig {
  double history_s{2.5};
  std::int64_t max_waiting{64};
};

struct KeyframeConfig {
  double distance_m{1.0};
  double rotation_rad{0.1745};
  double interval_s{10.0};  ///< also without motion, so that a standing robot's map is refreshed
  double voxel_m{0.2};
};

/// Finding the place in the map again, after a restart or a lost track.
struct RecoveryConfig {
  double radius_m{10.0};     ///< about the predicted place
  double yaw_rad{0.5236};    ///< to either side of the predicted heading
  double min_share{0.35};    ///< mean likelihood, by the map, of the points that stand out
  double min_lead{0.15};     ///< of that over any other place
  std::int64_t attempts{3};  ///< of a restart, half a second of sweeps apart
  double give_up_s{10.0};    ///< of a lost track with usable sweeps, until odom begins anew
};

/// Correcting the past while driving (README, "The past").
struct PastConfig {
  bool enabled{false};
  double interval_s{30.0};  ///< at least, from one correction to the next
};

/// The only defaults of lio_mapper; units and rules are in src/config.cpp.
struct Config {
  SweepTimingConfig sweep;
  ImuConfig imu;
  StartConfig start;
  MatchingConfig matching;
  ExtrinsicConfig extrinsic;
  LocalMapConfig local_map;
  DriftConfig drift;
  RowsConfig rows;
  KeyframeConfig keyframes;
  RecoveryConfig recovery;
  PastConfig past;
  double imu_rate_odometry_hz{100.0};
};

void describe(Config& config, ConfigFields& fields);

}  // namespace trigpoint::lio_mapper
