// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A drive through exact planes: LiDAR by closed-form ray casting, IMU by differentiating the
// motion.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/pose.hpp"
#include "trigpoint/base/so3.hpp"

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace trigpoint::lio_mapper::testing_support {

/// Stands for `rest_s`, then goes around an ellipse in a hall of 40 x 24 x 6 m with four pillars;
/// other drives give other poses and other walls.
class RoomDrive {
 public:
  explicit RoomDrive(double rest_s = 1.0, double speed_mps = 2.0)
      : rest_s_(rest_s), rate_radps_(speed_mps / kRadius_m) {}

  virtual ~RoomDrive() = default;

  virtual Pose pose_at(double t_s) const {
    const double angle = angle_at(t_s);
    const Eigen::Vector3d p{kRadius_m * std::sin(angle),
                            0.6 * kRadius_m * (1.0 - std::cos(angle)),
                            0.1 * std::sin(3.0 * angle)};
    const double yaw = std::atan2(0.6 * std::sin(angle), std::cos(angle));
    return {from_roll_pitch_yaw({0.03 * std::sin(2.0 * angle), 0.02 * std::sin(5.0 * angle), yaw}),
            p};
  }

  /// Rates and specific force by central differences of the pose, plus constant biases.
  ImuSample imu_at(Nanoseconds stamp_ns) const {
    constexpr double kH_s = 1e-3;
    const double t_s = to_seconds(stamp_ns - kEpoch_ns);
    const Pose before = pose_at(t_s - kH_s);
    const Pose now = pose_at(t_s);
    const Pose after = pose_at(t_s + kH_s);
    const Eigen::Vector3d acceleration = (after.p - 2.0 * now.p + before.p) / (kH_s * kH_s);
    ImuSample sample;
    sample.stamp_ns = stamp_ns;
    sample.gyro_radps = so3_log(before.q.conjugate() * after.q) / (2.0 * kH_s) + gyro_bias_radps;
    sample.accel_mps2 =
        now.q.conjugate() * (acceleration + Eigen::Vector3d(0.0, 0.0, 9.80665)) + accel_bias_mps2;
    return sample;
  }

  /// A turn of 100 ms from `begin_ns`, 16 beams, moving while it turns; fields x y z intensity
  /// time.
  PointCloudMessage sweep_at(Nanoseconds begin_ns, int azimuths = 600) const {
    PointCloudMessage cloud;
    cloud.stamp_ns = begin_ns;
    const char* const names[] = {"x", "y", "z", "intensity", "time"};
    for (std::uint32_t i = 0; i < 5; ++i) {
      cloud.fields.push_back({names[i], 4 * i, 7, 1});
    }
    cloud.point_step = 20;
    std::mt19937 noise(noise_seed + static_cast<unsigned>(begin_ns / 1'000'000));
    std::normal_distribution<double> range_noise(0.0, range_sigma_m);
    for (int a = 0; a < azimuths; ++a) {
      const double time_s = 0.1 * a / (azimuths - 1);
      const Pose T = pose_at(to_seconds(begin_ns - kEpoch_ns) + time_s);
      for (int beam = 0; beam < 16; ++beam) {
        const double elevation = (-15.0 + 2.0 * beam) * kDegree;
        const double azimuth = kPi - 2.0 * kPi * a / azimuths;
        const Eigen::Vector3d direction{std::cos(elevation) * std::cos(azimuth),
                                        std::cos(elevation) * std::sin(azimuth),
                                        std::sin(elevation)};
        const double range = cast(T.p, T.q * direction) + range_noise(noise);
        append(cloud, range * direction, time_s);
      }
    }
    cloud.width = static_cast<std::uint32_t>(cloud.data.size() / cloud.point_step);
    cloud.row_step = static_cast<std::uint32_t>(cloud.data.size());
    return cloud;
  }

  static constexpr Nanoseconds kEpoch_ns = 1'000 * kNanosecondsPerSecond;

  Eigen::Vector3d gyro_bias_radps{0.002, -0.003, 0.001};
  Eigen::Vector3d accel_bias_mps2{0.0, 0.0, 0.0};
  double range_sigma_m{0.01};
  unsigned noise_seed{0};

 private:
  static constexpr double kPi = 3.14159265358979323846;
  static constexpr double kDegree = kPi / 180.0;
  static constexpr double kRadius_m = 10.0;
  static constexpr double kRampUp_s = 2.0;

  double angle_at(double t_s) const {
    const double moving_s = std::max(0.0, t_s - rest_s_);
    if (rest_s_ <= 0.0) {
      return rate_radps_ * t_s;
    }
    return moving_s < kRampUp_s ? rate_radps_ * moving_s * moving_s / (2.0 * kRampUp_s)
                                : rate_radps_ * (moving_s - kRampUp_s / 2.0);
  }

  /// Distance to the nearest of the hall's six faces and the pillars' sides.
  virtual double cast(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
    double nearest = std::numeric_limits<double>::infinity();
    const Eigen::Vector3d low{-20.0, -6.0, -1.5};
    const Eigen::Vector3d high{20.0, 18.0, 4.5};
    for (int axis = 0; axis < 3; ++axis) {
      const double face = direction[axis] > 0.0 ? high[axis] : low[axis];
      if (std::abs(direction[axis]) > 1e-12) {
        nearest = std::min(nearest, (face - from[axis]) / direction[axis]);
      }
    }
    for (const double x : {-15.0, 15.0}) {
      for (const double y : {-3.0, 15.0}) {
        nearest = std::min(nearest, cast_at_pillar(from, direction, {x, y}));
      }
    }
    return nearest;
  }

  /// Entry into the square pillar of 2 m around `centre`, or infinity.
  static double cast_at_pillar(const Eigen::Vector3d& from,
                               const Eigen::Vector3d& direction,
                               const Eigen::Vector2d& centre) {
    double enter = 0.0;
    double leave = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 2; ++axis) {
      if (std::abs(direction[axis]) < 1e-12) {
        return std::numeric_limits<double>::infinity();
      }
      const double a = (centre[axis] - 1.0 - from[axis]) / direction[axis];
      const double b = (centre[axis] + 1.0 - from[axis]) / direction[axis];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    return enter < leave && enter > 0.0 ? enter : std::numeric_limits<double>::infinity();
  }

  static void append(PointCloudMessage& cloud, const Eigen::Vector3d& p, double time_s) {
    const float values[5] = {static_cast<float>(p.x()),
                             static_cast<float>(p.y()),
                             static_cast<float>(p.z()),
                             1.0F,
                             static_cast<float>(time_s)};
    const std::size_t at = cloud.data.size();
    cloud.data.resize(at + sizeof values);
    std::memcpy(cloud.data.data() + at, values, sizeof values);
  }

  double rest_s_;
  double rate_radps_;
};

}  // namespace trigpoint::lio_mapper::testing_support
