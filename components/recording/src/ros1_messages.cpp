// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// ROS 1 serialisation: little-endian, packed in order of declaration, strings and arrays with a
// uint32 length in front. By hand and not with ros/serialization.h, which allocates what a damaged
// length says before it looks whether so many bytes are there.
#include "ros1_messages.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

namespace trigpoint::recording {

static_assert(std::endian::native == std::endian::little);

namespace {

struct EndOfBytes : std::exception {};

class Ros1Bytes {
 public:
  explicit Ros1Bytes(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  std::span<const std::uint8_t> take(std::size_t count) {
    if (count > rest_.size()) {
      throw EndOfBytes();
    }
    const auto taken = rest_.first(count);
    rest_ = rest_.subspan(count);
    return taken;
  }

  template <class Number>
  Number number() {
    Number value;
    std::memcpy(&value, take(sizeof(Number)).data(), sizeof(Number));
    return value;
  }

  template <int Count>
  Eigen::Matrix<double, Count, 1> numbers() {
    Eigen::Matrix<double, Count, 1> values;
    std::memcpy(values.data(), take(sizeof(double) * Count).data(), sizeof(double) * Count);
    return values;
  }

  std::span<const std::uint8_t> array() { return take(number<std::uint32_t>()); }

  std::string text() {
    const auto characters = array();
    return {characters.begin(), characters.end()};
  }

 private:
  std::span<const std::uint8_t> rest_;
};

/// std_msgs/Header: seq, stamp, frame_id.
template <class Message>
void read_header(Ros1Bytes& bytes, Message& message) {
  bytes.number<std::uint32_t>();
  const auto seconds = bytes.number<std::uint32_t>();
  const auto nanoseconds = bytes.number<std::uint32_t>();
  message.stamp_ns = static_cast<Nanoseconds>(seconds) * kNanosecondsPerSecond + nanoseconds;
  message.frame_id = bytes.text();
}

/// The covariance's first element is -1 when the sensor gives no attitude; many drivers leave a
/// zero quaternion instead.
std::optional<Eigen::Quaterniond> attitude(const Eigen::Vector4d& xyzw, double first_covariance) {
  constexpr double kNormTolerance = 0.1;
  if (first_covariance < 0.0 || !(std::abs(xyzw.norm() - 1.0) < kNormTolerance)) {
    return std::nullopt;
  }
  return Eigen::Quaterniond(xyzw[3], xyzw[0], xyzw[1], xyzw[2]).normalized();
}

ImuSample read_imu(Ros1Bytes& bytes) {
  ImuSample imu;
  read_header(bytes, imu);
  const auto orientation = bytes.numbers<4>();
  imu.q_world_base = attitude(orientation, bytes.numbers<9>()[0]);
  imu.gyro_radps = bytes.numbers<3>();
  bytes.numbers<9>();
  imu.accel_mps2 = bytes.numbers<3>();
  bytes.numbers<9>();
  return imu;
}

GnssFix read_fix(Ros1Bytes& bytes) {
  GnssFix fix;
  read_header(bytes, fix);
  const auto status = bytes.number<std::int8_t>();
  fix.status = status >= -1 && status <= 2 ? static_cast<FixStatus>(status) : FixStatus::kUnknown;
  fix.service = bytes.number<std::uint16_t>();
  fix.latitude_deg = bytes.number<double>();
  fix.longitude_deg = bytes.number<double>();
  fix.altitude_m = bytes.number<double>();
  const auto covariance = bytes.numbers<9>();
  fix.covariance_enu_m2 =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(covariance.data());
  const auto type = bytes.number<std::uint8_t>();
  fix.covariance_type = type <= 3 ? static_cast<CovarianceType>(type) : CovarianceType::kUnknown;
  return fix;
}

PointField read_field(Ros1Bytes& bytes) {
  PointField field;
  field.name = bytes.text();
  field.offset = bytes.number<std::uint32_t>();
  field.datatype = bytes.number<std::uint8_t>();
  field.count = bytes.number<std::uint32_t>();
  return field;
}

PointCloudMessage read_cloud(Ros1Bytes& bytes) {
  PointCloudMessage cloud;
  read_header(bytes, cloud);
  cloud.height = bytes.number<std::uint32_t>();
  cloud.width = bytes.number<std::uint32_t>();
  for (auto fields = bytes.number<std::uint32_t>(); fields > 0; --fields) {
    cloud.fields.push_back(read_field(bytes));
  }
  cloud.is_bigendian = bytes.number<std::uint8_t>() != 0;
  cloud.point_step = bytes.number<std::uint32_t>();
  cloud.row_step = bytes.number<std::uint32_t>();
  const auto data = bytes.array();
  cloud.data.assign(data.begin(), data.end());
  cloud.is_dense = bytes.number<std::uint8_t>() != 0;
  return cloud;
}

Matrix6d matrix6(const Eigen::Matrix<double, 36, 1>& row_major) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(row_major.data());
}

TwistMeasurement read_twist(Ros1Bytes& bytes) {
  TwistMeasurement twist;
  read_header(bytes, twist);
  twist.linear_mps = bytes.numbers<3>();
  bytes.numbers<3>();
  twist.covariance_m2ps2 = matrix6(bytes.numbers<36>()).topLeftCorner<3, 3>();
  return twist;
}

Odometry read_odometry(Ros1Bytes& bytes) {
  Odometry odometry;
  read_header(bytes, odometry);
  odometry.child_frame_id = bytes.text();
  odometry.T_frame_child.p = bytes.numbers<3>();
  const auto xyzw = bytes.numbers<4>();
  odometry.T_frame_child.q = Eigen::Quaterniond(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
  odometry.pose_covariance = matrix6(bytes.numbers<36>());
  odometry.linear_mps = bytes.numbers<3>();
  odometry.angular_radps = bytes.numbers<3>();
  odometry.twist_covariance = matrix6(bytes.numbers<36>());
  return odometry;
}

/// The orientation as it came: the filter judges its length.
YawMeasurement read_yaw(Ros1Bytes& bytes) {
  YawMeasurement yaw;
  read_header(bytes, yaw);
  const auto xyzw = bytes.numbers<4>();
  const auto covariance = bytes.numbers<9>();
  bytes.numbers<3 + 9 + 3 + 9>();
  if (covariance[0] != -1.0 && !xyzw.isZero(0.0)) {
    yaw.q_world_base = Eigen::Quaterniond(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
  }
  yaw.variance_rad2 = covariance[8];
  return yaw;
}

template <class Message>
bool decode(std::span<const std::uint8_t> bytes, Message& message, Message (*read)(Ros1Bytes&)) {
  try {
    Ros1Bytes cursor(bytes);
    message = read(cursor);
    return true;
  } catch (const EndOfBytes&) {
    return false;
  }
}

}  // namespace

bool decode_ros1(std::span<const std::uint8_t> bytes, ImuSample& imu) {
  return decode(bytes, imu, read_imu);
}

bool decode_ros1(std::span<const std::uint8_t> bytes, GnssFix& fix) {
  return decode(bytes, fix, read_fix);
}

bool decode_ros1(std::span<const std::uint8_t> bytes, PointCloudMessage& cloud) {
  return decode(bytes, cloud, read_cloud);
}

bool decode_ros1(std::span<const std::uint8_t> bytes, TwistMeasurement& twist) {
  return decode(bytes, twist, read_twist);
}

bool decode_ros1(std::span<const std::uint8_t> bytes, Odometry& odometry) {
  return decode(bytes, odometry, read_odometry);
}

bool decode_ros1(std::span<const std::uint8_t> bytes, YawMeasurement& yaw) {
  return decode(bytes, yaw, read_yaw);
}

}  // namespace trigpoint::recording
