// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// ROS 1 serialisation: little-endian, packed in order of declaration, strings with a uint32 length.
#include "bag_messages.hpp"

#include <cstring>
#include <stdexcept>

namespace trigpoint::gps_odometry {

namespace {

class Bytes {
 public:
  explicit Bytes(std::span<const std::uint8_t> rest) : rest_(rest) {}

  const std::uint8_t* take(std::size_t count) {
    if (count > rest_.size()) {
      throw std::out_of_range("the message is cut off");
    }
    const std::uint8_t* const taken = rest_.data();
    rest_ = rest_.subspan(count);
    return taken;
  }

  std::uint32_t word() {
    std::uint32_t value;
    std::memcpy(&value, take(sizeof value), sizeof value);
    return value;
  }

  std::string text() {
    const std::uint32_t length = word();
    return {reinterpret_cast<const char*>(take(length)), length};
  }

  template <int Rows, int Columns = 1>
  Eigen::Matrix<double, Rows, Columns>
  numbers() {  // row-major; only symmetric ones are not vectors
    Eigen::Matrix<double, Rows, Columns> values;
    std::memcpy(
        values.data(), take(sizeof(double) * Rows * Columns), sizeof(double) * Rows * Columns);
    return values;
  }

  /// std_msgs/Header
  Nanoseconds stamp_of_header() {
    word();
    const Nanoseconds seconds = word();
    const Nanoseconds nanoseconds = word();
    text();
    return seconds * kNanosecondsPerSecond + nanoseconds;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

/// Zero means no rotation to the published filter.
Eigen::Quaterniond rotation_of(const Eigen::Vector4d& xyzw) {
  const Eigen::Quaterniond q(xyzw);
  return q.norm() > 0.0 ? q.normalized() : Eigen::Quaterniond::Identity();
}

}  // namespace

AhrsSample imu_of_ros1(std::span<const std::uint8_t> bytes) {
  Bytes cursor(bytes);
  AhrsSample sample;
  sample.stamp_ns = cursor.stamp_of_header();
  sample.q_world_imu = rotation_of(cursor.numbers<4>());
  sample.attitude_covariance_rad2 = cursor.numbers<3, 3>();
  sample.gyro_radps = cursor.numbers<3>();
  sample.gyro_covariance = cursor.numbers<3, 3>();
  sample.accel_mps2 = cursor.numbers<3>();
  sample.accel_covariance = cursor.numbers<3, 3>();
  if (sample.attitude_covariance_rad2(0, 0) == -1.0) {  // ROS: there is no attitude
    sample.q_world_imu.reset();
  }
  return sample;
}

OdometryTwist twist_of_ros1(std::span<const std::uint8_t> bytes) {
  Bytes cursor(bytes);
  OdometryTwist odometry;
  odometry.sample.stamp_ns = cursor.stamp_of_header();
  odometry.child_frame_id = cursor.text();
  cursor.numbers<7>();     // pose
  cursor.numbers<6, 6>();  // its covariance
  odometry.sample.twist_base = cursor.numbers<6>();
  odometry.sample.covariance = cursor.numbers<6, 6>();
  return odometry;
}

}  // namespace trigpoint::gps_odometry
