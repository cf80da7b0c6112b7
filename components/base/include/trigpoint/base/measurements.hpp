// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the sensors say: the plain twins of the ROS 2 messages Imu, NavSatFix and PointCloud2.
#pragma once

#include "trigpoint/base/time.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct ImuSample {
  Nanoseconds stamp_ns{0};
  std::string frame_id;
  Eigen::Vector3d gyro_radps{Eigen::Vector3d::Zero()};  ///< angular rate, sensor frame
  Eigen::Vector3d accel_mps2{Eigen::Vector3d::Zero()};  ///< specific force, +g on z at rest
  std::optional<Eigen::Quaterniond> q_world_base;       ///< attitude, when the sensor gives one
};

enum class FixStatus : std::int8_t { kUnknown = -2, kNoFix = -1, kFix = 0, kSbas = 1, kGbas = 2 };

enum class CovarianceType : std::uint8_t {
  kUnknown = 0,
  kApproximated = 1,
  kDiagonalKnown = 2,
  kKnown = 3
};

/// NavSatFix: WGS 84, height above the ellipsoid, at the antenna's phase centre.
struct GnssFix {
  Nanoseconds stamp_ns{0};
  std::string frame_id;
  FixStatus status{FixStatus::kNoFix};
  std::uint16_t service{0};
  double latitude_deg{kNaN};
  double longitude_deg{kNaN};
  double altitude_m{kNaN};
  Eigen::Matrix3d covariance_enu_m2{Eigen::Matrix3d::Zero()};
  CovarianceType covariance_type{CovarianceType::kUnknown};
};

/// Velocity of a point of the vehicle by wheels or another sensor: the linear part of a twist.
struct TwistMeasurement {
  Nanoseconds stamp_ns{0};
  std::string frame_id;  ///< axes of the velocity
  Eigen::Vector3d linear_mps{Eigen::Vector3d::Constant(kNaN)};
  Eigen::Matrix3d covariance_m2ps2{Eigen::Matrix3d::Zero()};  ///< not positive: unknown
};

/// Heading by a magnetometer or two antennas: an attitude of which the yaw is used.
struct YawMeasurement {
  Nanoseconds stamp_ns{0};
  std::string frame_id;
  std::optional<Eigen::Quaterniond> q_world_base;  ///< world: east, north, up; as it came
  double variance_rad2{0.0};                       ///< of yaw; not positive: unknown
};

/// One field of a point, as in sensor_msgs/PointField (datatype codes are ROS's: 1 int8, 2 uint8,
/// 3 int16, 4 uint16, 5 int32, 6 uint32, 7 float32, 8 float64).
struct PointField {
  std::string name;
  std::uint32_t offset{0};  ///< bytes from the start of the point
  std::uint8_t datatype{0};
  std::uint32_t count{1};
};

/// PointCloud2 as it came: bytes with a description. Decoded by field name, never by a fixed
/// struct.
struct PointCloudMessage {
  Nanoseconds stamp_ns{0};
  std::string frame_id;
  std::uint32_t height{1};
  std::uint32_t width{0};
  std::vector<PointField> fields;
  bool is_bigendian{false};
  std::uint32_t point_step{0};
  std::uint32_t row_step{0};
  std::vector<std::uint8_t> data;
  bool is_dense{true};
};

struct PointXyzi {
  float x{0.0F};  ///< m
  float y{0.0F};
  float z{0.0F};
  float intensity{0.0F};

  Eigen::Vector3f position() const { return {x, y, z}; }
};

/// Decoded points in one frame at one time; the owner of the cloud says which.
using PointCloud = std::vector<PointXyzi>;

/// What a source holds for `xyz + intensity` points as a PointCloud2 (fields x y z intensity,
/// float32).
PointCloudMessage to_cloud_message(const PointCloud& cloud,
                                   Nanoseconds stamp_ns,
                                   const std::string& frame_id);

}  // namespace trigpoint
