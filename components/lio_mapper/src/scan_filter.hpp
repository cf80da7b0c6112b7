// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/lio_mapper/config.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"
#include "trigpoint/lio_mapper/stages.hpp"

#include "attitude_window.hpp"
#include "clock_offset.hpp"
#include "extrinsic_rotation.hpp"
#include "imu_buffer.hpp"
#include "iterated_update.hpp"
#include "local_map.hpp"
#include "row_history.hpp"
#include "sweep.hpp"
#include "workers.hpp"
#include <Eigen/Core>

#include <functional>
#include <memory>
#include <optional>
#include <utility>

namespace trigpoint::lio_mapper {

class ScanMatcher;

/// Where the filter begins; T_base_lidar is the filter's own matter.
struct InitialState {
  Nanoseconds stamp_ns{0};
  State state;
  ErrorMatrix covariance{ErrorMatrix::Zero()};
};

/// What one sweep did.
struct ScanOutcome {
  bool first{false};      ///< began the map; nothing to match
  bool used{false};       ///< matched, or first
  std::size_t points{0};  ///< after thinning
  std::size_t matches{0};
  int iterations{0};
  double share_within_10_cm{0.0};  ///< of the thinned points, from their planes
  std::array<double, 6> observability{};
  PointCloud points_base;   ///< undistorted, all; with the extrinsic that this scan ended with
  PointCloud thinned_base;  ///< undistorted, one a voxel
};

/// What a filter takes over from an earlier one of the same odom epoch.
struct Past {
  bool aligned{false};
  double distance_m{0.0};
  Matrix6d drift_covariance{Matrix6d::Zero()};  ///< of odom, about its origin, ROS order
  std::unique_ptr<LocalMap> map;
};

/// What a search for a scan's place found.
struct Sighting {
  bool match_as_usual{false};  ///< the prediction is good enough
  std::optional<Pose> T_odom_base;
  Eigen::Matrix2d spread_m2{Eigen::Matrix2d::Zero()};  ///< of places around that are as good
};

/// Finds a scan in the map whose predicted pose may be too uncertain for matching.
using PoseSearch = std::function<Sighting(const State& predicted,
                                          const ErrorMatrix& covariance,
                                          const PointCloud& thinned_base)>;

/// The method, one call a step: propagate, undistort, thin, match and update, apply GPS rows,
/// insert. One odom epoch; knows nothing of start-up, waiting or reporting.
class ScanFilter {
 public:
  /// `observe` may be empty.
  ScanFilter(const Config& config,
             const Pose& T_base_lidar,
             const InitialState& initial,
             StageObserver observe = {});

  /// Before the first scan.
  void take_over(Past past);

  /// `imu` covers the sweep's end. With a `search` the scan is matched only where that finds it.
  ScanOutcome process(const Sweep& sweep, const ImuBuffer& imu, const PoseSearch& search = {});

  Nanoseconds stamp_ns() const;
  const State& state() const;
  const ErrorMatrix& covariance() const;

  Calibration calibration() const;

  bool aligned() const { return aligned_; }

  double distance_m() const { return distance_m_; }

  const LocalMap& map() const { return *map_; }

  /// For another one of the same place; the caller has the old one to dispose of.
  void swap_map(std::unique_ptr<LocalMap>& map) { map_.swap(map); }

  Workers& workers() { return *workers_; }

  const Matrix6d& drift_covariance() const { return drift_covariance_; }

  void align(const Alignment& alignment);
  RowVerdict apply(const StateUpdate& update);

  std::vector<StateUpdate> take_covered() { return history_.take_covered(); }

  const RowHistory& history() const { return history_; }

  std::size_t rows_waiting() const { return history_.waiting(); }

  /// Of base_link in odom, in ROS order: relative to the local map, plus what odom itself may have
  /// drifted since the epoch began.
  Matrix6d pose_covariance() const;
  /// Only relative to the local map, in ROS order.
  Matrix6d pose_covariance_in_local_map() const;
  /// That of the state, as it is stated. The filter weighs a scan as if all residuals in a patch
  /// were wrong together, so that its gains are those of who trusts no single scan far; what a scan
  /// is worth, its patches show.
  ErrorMatrix stated_covariance() const;
  /// Of T_map_odom: yaw, x, y, z, tilt x, tilt y.
  Matrix6d placement_covariance() const;

  /// Called once between process() and the next process(): rows that wait count before the scan
  /// enters the map. Gives what has entered it, in odom.
  PointCloud insert(const ScanOutcome& outcome);

  /// False from a search for the place on, until scans have settled it: they are kept out of maps.
  bool is_placed() const { return !searched_at_m_ || map_->empty(); }

 private:
  struct Prediction {
    State state;
    ErrorMatrix covariance;
    ErrorMatrix transition{ErrorMatrix::Identity()};
    Path path{};
    bool guessed{false};  ///< in part: the IMU was saturated
  };

  Prediction predict(const Sweep& sweep, const ImuBuffer& imu) const;
  void add_drift(Prediction& prediction);
  static void add_clock_noise(const Sweep& sweep, Prediction& prediction);
  void begin(Stage stage) const;
  /// The prediction conditioned on the pose that a search found; false when it found none.
  bool search(const PoseSearch& look, const PointCloud& thinned_base, Prediction& prediction);
  void shape(const Sweep& sweep, const Prediction& prediction, ScanOutcome& outcome) const;
  UpdateResult match_guessed(const Sweep& sweep, Prediction& prediction, ScanOutcome& outcome);
  UpdateResult match(const Prediction& prediction,
                     const PointCloud& thinned_base,
                     ScanOutcome& outcome);
  void turn_extrinsic(Prediction& prediction);
  void compare_with_gyro(const UpdateResult& result, Nanoseconds stamp_ns, const ImuBuffer& imu);
  void learn_from(const AttitudeWindow& window);
  UpdateResult update(const Prediction& prediction, ScanMatcher& matcher);

  Config config_;
  Pose T_base_lidar_;
  InitialState initial_;
  StageObserver observe_;
  std::unique_ptr<Workers> workers_;
  std::unique_ptr<LocalMap> map_;
  AttitudeWindows windows_;
  ClockOffsetEstimator clock_offset_;
  ExtrinsicRotationEstimator extrinsic_rotation_;
  Eigen::Vector3d extrinsic_taken_rad_{Eigen::Vector3d::Zero()};  ///< of its turn, into the state
  RowHistory history_;
  bool aligned_{false};
  double distance_m_{0.0};
  Eigen::Vector3d pruned_at_m_{Eigen::Vector3d::Zero()};
  /// distance_m_ when the place was searched for, while what was found is not settled.
  std::optional<double> searched_at_m_;
  /// At the newest linearisation, see bent_map.hpp.
  Eigen::Matrix3d unbent_{Eigen::Matrix3d::Identity()};
  /// What the newest scan knows of the pose by its patches, see scan_matcher.hpp.
  Matrix6d known_by_patches_{Matrix6d::Zero()};
  /// Of the last usable scan, see drift.hpp.
  Eigen::Matrix3d blind_{Eigen::Matrix3d::Zero()};
  Matrix6d drift_covariance_{Matrix6d::Zero()};  ///< of odom, about its origin, ROS order
};

PointCloud transformed(const PointCloud& points, const Pose& T);

}  // namespace trigpoint::lio_mapper
