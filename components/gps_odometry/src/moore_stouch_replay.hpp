// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What stands around the published Moore-Stouch filter: what it makes of IMU and wheel odometry,
// and when it predicts and fuses. A replay of its rules on recorded data, with their defects, for
// comparison; rewind.hpp and track.hpp are what the program drives with.
#pragma once

#include "trigpoint/base/time.hpp"

#include "moore_stouch.hpp"
#include <Eigen/Geometry>

#include <map>
#include <optional>

namespace trigpoint::gps_odometry {

/// An IMU message with attitude, in the IMU's axes. Covariances as reported.
struct AhrsSample {
  Nanoseconds stamp_ns{0};
  std::optional<Eigen::Quaterniond> q_world_imu;  ///< nullopt: the IMU gives no attitude
  Eigen::Matrix3d attitude_covariance_rad2{Eigen::Matrix3d::Zero()};
  Eigen::Vector3d gyro_radps{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d gyro_covariance{Eigen::Matrix3d::Zero()};   ///< (rad/s)^2
  Eigen::Vector3d accel_mps2{Eigen::Vector3d::Zero()};        ///< specific force
  Eigen::Matrix3d accel_covariance{Eigen::Matrix3d::Zero()};  ///< (m/s^2)^2
};

/// Linear and angular velocity of base_link in base_link, as of wheel odometry.
struct TwistSample {
  Nanoseconds stamp_ns{0};
  Eigen::Matrix<double, 6, 1> twist_base{Eigen::Matrix<double, 6, 1>::Zero()};  ///< m/s, rad/s
  Eigen::Matrix<double, 6, 6> covariance{Eigen::Matrix<double, 6, 6>::Zero()};
};

/// A position of base_link in the world frame: a fix, its covariance copied as it is.
struct PositionSample {
  Nanoseconds stamp_ns{0};
  Eigen::Vector3d position_m{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};
};

/// `measured` names states of the filter; rates and accelerations are chosen in the IMU's axes and
/// turned with them.
struct ImuUse {
  Eigen::Isometry3d T_base_imu{Eigen::Isometry3d::Identity()};
  MeasuredStates measured;
};

class MooreStouchReplay {
 public:
  MooreStouchReplay(const MooreStouch& start, double sensor_timeout_s);

  /// A message that has arrived. It waits for the next tick; one that is older than the last of its
  /// kind is dropped, one with the same stamp is not.
  void add(const AhrsSample& sample, const ImuUse& use);
  void add(const TwistSample& sample, const MeasuredStates& measured);
  void add(const PositionSample& sample);

  /// One tick of the filter's timer: fuses what waits with a stamp up to now, in order of the
  /// stamps. A stamp before the filter's own time is fused into the present state. When nothing
  /// came for the sensor time-out it predicts to now instead, for ever.
  void tick(Nanoseconds now_ns);

  const MooreStouch& filter() const { return filter_; }

  /// To move the state into another frame.
  MooreStouch& filter() { return filter_; }

  /// What the state is of.
  Nanoseconds stamp_ns() const { return filter_ns_; }

  int late_measurements() const { return late_measurements_; }

 private:
  struct Measurement {
    Vector15d z{Vector15d::Zero()};
    Matrix15d R{Matrix15d::Identity()};
    MeasuredStates measured;
  };

  enum class Kind { kAttitude, kRate, kAcceleration, kTwist, kPosition };

  void enqueue(Kind kind, Nanoseconds stamp_ns, const Measurement& measurement);
  void fuse(Nanoseconds stamp_ns, const Measurement& measurement);
  void predict_to(Nanoseconds stamp_ns);
  Eigen::Vector3d acceleration_base(const AhrsSample& sample, const ImuUse& use) const;

  MooreStouch filter_;
  double sensor_timeout_s_;
  std::multimap<Nanoseconds, Measurement> queue_;
  std::map<Kind, Nanoseconds> newest_ns_;
  Nanoseconds filter_ns_{0};      ///< what the state is of
  Nanoseconds last_input_ns_{0};  ///< last tick that had something to fuse
  std::optional<Nanoseconds> last_tick_ns_;
  Eigen::Vector3d last_rate_radps_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d rate_change_radps2_{Eigen::Vector3d::Zero()};  ///< of the state, between ticks
  int late_measurements_{0};
};

}  // namespace trigpoint::gps_odometry
