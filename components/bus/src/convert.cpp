// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/convert.hpp"

#include "message_parts.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace trigpoint::bus {

namespace {

constexpr double kNoOrientation = -1.0;           // sensor_msgs/Imu: orientation_covariance[0]
constexpr double kSmallestQuaternionNorm = 1e-6;  // drivers without attitude leave all zeros

geometry_msgs::msg::Point point_message(const Eigen::Vector3d& point) {
  geometry_msgs::msg::Point message;
  message.x(point.x());
  message.y(point.y());
  message.z(point.z());
  return message;
}

Eigen::Vector3d point_of(const geometry_msgs::msg::Point& message) {
  return {message.x(), message.y(), message.z()};
}

bool has_orientation(const sensor_msgs::msg::Imu& message) {
  return message.orientation_covariance()[0] != kNoOrientation &&
         quaternion_of(message.orientation()).norm() > kSmallestQuaternionNorm;
}

FixStatus fix_status(std::int8_t number) {
  const bool known = number >= static_cast<std::int8_t>(FixStatus::kUnknown) &&
                     number <= static_cast<std::int8_t>(FixStatus::kGbas);
  return known ? static_cast<FixStatus>(number) : FixStatus::kUnknown;
}

sensor_msgs::msg::PointField field_message(const PointField& field) {
  sensor_msgs::msg::PointField message;
  message.name(field.name);
  message.offset(field.offset);
  message.datatype(field.datatype);
  message.count(field.count);
  return message;
}

/// Everything but the points' bytes.
PointCloudMessage cloud_description(const sensor_msgs::msg::PointCloud2& message) {
  PointCloudMessage cloud;
  cloud.stamp_ns = from_message(message.header().stamp());
  cloud.frame_id = message.header().frame_id();
  cloud.height = message.height();
  cloud.width = message.width();
  for (const auto& field : message.fields()) {
    cloud.fields.push_back({field.name(), field.offset(), field.datatype(), field.count()});
  }
  cloud.is_bigendian = message.is_bigendian();
  cloud.point_step = message.point_step();
  cloud.row_step = message.row_step();
  cloud.is_dense = message.is_dense();
  return cloud;
}

}  // namespace

std_msgs::msg::Header header_of(Nanoseconds stamp_ns, const std::string& frame_id) {
  std_msgs::msg::Header header;
  header.stamp(to_message(stamp_ns));
  header.frame_id(frame_id);
  return header;
}

geometry_msgs::msg::Vector3 vector_message(const Eigen::Vector3d& vector) {
  geometry_msgs::msg::Vector3 message;
  message.x(vector.x());
  message.y(vector.y());
  message.z(vector.z());
  return message;
}

Eigen::Vector3d vector_of(const geometry_msgs::msg::Vector3& message) {
  return {message.x(), message.y(), message.z()};
}

geometry_msgs::msg::Quaternion quaternion_message(const Eigen::Quaterniond& q) {
  geometry_msgs::msg::Quaternion message;
  message.x(q.x());
  message.y(q.y());
  message.z(q.z());
  message.w(q.w());
  return message;
}

Eigen::Quaterniond quaternion_of(const geometry_msgs::msg::Quaternion& message) {
  return {message.w(), message.x(), message.y(), message.z()};
}

namespace {

geometry_msgs::msg::TwistWithCovariance twist_message(const TwistMeasurement& twist) {
  Matrix6d covariance = Matrix6d::Identity() * kUnknownVariance;  // the angular part
  covariance.topLeftCorner<3, 3>() = twist.covariance_m2ps2;
  geometry_msgs::msg::TwistWithCovariance message;
  message.twist().linear(vector_message(twist.linear_mps));
  message.covariance(row_major(covariance));
  return message;
}

TwistMeasurement twist_of(const builtin_interfaces::msg::Time& stamp,
                          const std::string& frame_id,
                          const geometry_msgs::msg::TwistWithCovariance& message) {
  TwistMeasurement twist;
  twist.stamp_ns = from_message(stamp);
  twist.frame_id = frame_id;
  twist.linear_mps = vector_of(message.twist().linear());
  twist.covariance_m2ps2 = from_row_major<6>(message.covariance()).topLeftCorner<3, 3>();
  return twist;
}

}  // namespace

builtin_interfaces::msg::Time to_message(Nanoseconds stamp_ns) {
  constexpr Nanoseconds kLowest = std::numeric_limits<std::int32_t>::min() * kNanosecondsPerSecond;
  constexpr Nanoseconds kHighest =
      std::numeric_limits<std::int32_t>::max() * kNanosecondsPerSecond + kNanosecondsPerSecond - 1;
  const Nanoseconds clamped = std::clamp(stamp_ns, kLowest, kHighest);
  Nanoseconds seconds = clamped / kNanosecondsPerSecond;
  if (clamped % kNanosecondsPerSecond < 0) {
    --seconds;  // round down, so that nanosec counts upwards before 1970 too
  }
  builtin_interfaces::msg::Time message;
  message.sec(static_cast<std::int32_t>(seconds));
  message.nanosec(static_cast<std::uint32_t>(clamped - seconds * kNanosecondsPerSecond));
  return message;
}

Nanoseconds from_message(const builtin_interfaces::msg::Time& stamp) {
  return stamp.sec() * kNanosecondsPerSecond + stamp.nanosec();
}

sensor_msgs::msg::Imu to_message(const ImuSample& imu) {
  sensor_msgs::msg::Imu message;
  message.header(header_of(imu.stamp_ns, imu.frame_id));
  message.orientation(
      quaternion_message(imu.q_world_base.value_or(Eigen::Quaterniond::Identity())));
  message.orientation_covariance()[0] = imu.q_world_base ? 0.0 : kNoOrientation;
  message.angular_velocity(vector_message(imu.gyro_radps));
  message.linear_acceleration(vector_message(imu.accel_mps2));
  return message;
}

ImuSample from_message(const sensor_msgs::msg::Imu& message) {
  ImuSample imu;
  imu.stamp_ns = from_message(message.header().stamp());
  imu.frame_id = message.header().frame_id();
  imu.gyro_radps = vector_of(message.angular_velocity());
  imu.accel_mps2 = vector_of(message.linear_acceleration());
  if (has_orientation(message)) {
    imu.q_world_base = quaternion_of(message.orientation());
  }
  return imu;
}

geometry_msgs::msg::TwistWithCovarianceStamped to_message(const TwistMeasurement& twist) {
  geometry_msgs::msg::TwistWithCovarianceStamped message;
  message.header(header_of(twist.stamp_ns, twist.frame_id));
  message.twist(twist_message(twist));
  return message;
}

nav_msgs::msg::Odometry to_odometry_message(const TwistMeasurement& twist) {
  nav_msgs::msg::Odometry message;
  message.header(header_of(twist.stamp_ns, "odom"));
  message.child_frame_id(twist.frame_id);
  message.pose().pose().orientation().w(1.0);
  message.pose().covariance(row_major(Matrix6d(Matrix6d::Identity() * kUnknownVariance)));
  message.twist(twist_message(twist));
  return message;
}

TwistMeasurement twist_from_message(const geometry_msgs::msg::TwistWithCovarianceStamped& message) {
  return twist_of(message.header().stamp(), message.header().frame_id(), message.twist());
}

TwistMeasurement twist_from_message(const nav_msgs::msg::Odometry& message) {
  return twist_of(message.header().stamp(), message.child_frame_id(), message.twist());
}

sensor_msgs::msg::Imu to_message(const YawMeasurement& yaw) {
  sensor_msgs::msg::Imu message;
  message.header(header_of(yaw.stamp_ns, yaw.frame_id));
  message.orientation(
      quaternion_message(yaw.q_world_base.value_or(Eigen::Quaterniond::Identity())));
  message.orientation_covariance()[0] = yaw.q_world_base ? 0.0 : kNoOrientation;
  message.orientation_covariance()[8] = yaw.variance_rad2;
  message.angular_velocity_covariance()[0] = -1.0;
  message.linear_acceleration_covariance()[0] = -1.0;
  return message;
}

YawMeasurement yaw_from_message(const sensor_msgs::msg::Imu& message) {
  YawMeasurement yaw;
  yaw.stamp_ns = from_message(message.header().stamp());
  yaw.frame_id = message.header().frame_id();
  yaw.variance_rad2 = message.orientation_covariance()[8];
  if (has_orientation(message)) {
    yaw.q_world_base = quaternion_of(message.orientation());
  }
  return yaw;
}

sensor_msgs::msg::NavSatFix to_message(const GnssFix& fix) {
  sensor_msgs::msg::NavSatFix message;
  message.header(header_of(fix.stamp_ns, fix.frame_id));
  message.status().status(static_cast<std::int8_t>(fix.status));
  message.status().service(fix.service);
  message.latitude(fix.latitude_deg);
  message.longitude(fix.longitude_deg);
  message.altitude(fix.altitude_m);
  message.position_covariance(row_major(fix.covariance_enu_m2));
  message.position_covariance_type(static_cast<std::uint8_t>(fix.covariance_type));
  return message;
}

GnssFix from_message(const sensor_msgs::msg::NavSatFix& message) {
  GnssFix fix;
  fix.stamp_ns = from_message(message.header().stamp());
  fix.frame_id = message.header().frame_id();
  fix.status = fix_status(message.status().status());
  fix.service = message.status().service();
  fix.latitude_deg = message.latitude();
  fix.longitude_deg = message.longitude();
  fix.altitude_m = message.altitude();
  fix.covariance_enu_m2 = from_row_major<3>(message.position_covariance());
  fix.covariance_type = enumerator(
      message.position_covariance_type(), CovarianceType::kKnown, CovarianceType::kUnknown);
  return fix;
}

sensor_msgs::msg::PointCloud2 to_message(const PointCloudMessage& cloud) {
  sensor_msgs::msg::PointCloud2 message;
  message.header(header_of(cloud.stamp_ns, cloud.frame_id));
  message.height(cloud.height);
  message.width(cloud.width);
  for (const PointField& field : cloud.fields) {
    message.fields().push_back(field_message(field));
  }
  message.is_bigendian(cloud.is_bigendian);
  message.point_step(cloud.point_step);
  message.row_step(cloud.row_step);
  message.data(cloud.data);
  message.is_dense(cloud.is_dense);
  return message;
}

PointCloudMessage from_message(const sensor_msgs::msg::PointCloud2& message) {
  PointCloudMessage cloud = cloud_description(message);
  cloud.data = message.data();
  return cloud;
}

PointCloudMessage from_message(sensor_msgs::msg::PointCloud2&& message) {
  PointCloudMessage cloud = cloud_description(message);
  cloud.data = std::move(message.data());
  return cloud;
}

nav_msgs::msg::Odometry to_message(const Odometry& odometry) {
  nav_msgs::msg::Odometry message;
  message.header(header_of(odometry.stamp_ns, odometry.frame_id));
  message.child_frame_id(odometry.child_frame_id);
  message.pose().pose().position(point_message(odometry.T_frame_child.p));
  message.pose().pose().orientation(quaternion_message(odometry.T_frame_child.q));
  message.pose().covariance(row_major(odometry.pose_covariance));
  message.twist().twist().linear(vector_message(odometry.linear_mps));
  message.twist().twist().angular(vector_message(odometry.angular_radps));
  message.twist().covariance(row_major(odometry.twist_covariance));
  return message;
}

Odometry from_message(const nav_msgs::msg::Odometry& message) {
  Odometry odometry;
  odometry.stamp_ns = from_message(message.header().stamp());
  odometry.frame_id = message.header().frame_id();
  odometry.child_frame_id = message.child_frame_id();
  odometry.T_frame_child.p = point_of(message.pose().pose().position());
  odometry.T_frame_child.q = quaternion_of(message.pose().pose().orientation());
  odometry.pose_covariance = from_row_major<6>(message.pose().covariance());
  odometry.linear_mps = vector_of(message.twist().twist().linear());
  odometry.angular_radps = vector_of(message.twist().twist().angular());
  odometry.twist_covariance = from_row_major<6>(message.twist().covariance());
  return odometry;
}

sensor_msgs::msg::NavSatFix to_message(const Datum& datum) {
  GnssFix fix;
  fix.stamp_ns = datum.elected_ns;
  fix.frame_id = "map";
  fix.status = FixStatus::kFix;
  fix.latitude_deg = datum.latitude_deg;
  fix.longitude_deg = datum.longitude_deg;
  fix.altitude_m = datum.height_m;
  return to_message(fix);
}

Datum datum_from_message(const sensor_msgs::msg::NavSatFix& message) {
  Datum datum;
  datum.latitude_deg = message.latitude();
  datum.longitude_deg = message.longitude();
  datum.height_m = message.altitude();
  datum.elected_ns = from_message(message.header().stamp());
  return datum;
}

tf2_msgs::msg::TFMessage to_tf_message(std::span<const StampedTransform> transforms) {
  tf2_msgs::msg::TFMessage message;
  for (const StampedTransform& from : transforms) {
    geometry_msgs::msg::TransformStamped transform;
    transform.header(header_of(from.stamp_ns, from.frame_id));
    transform.child_frame_id(from.child_frame_id);
    transform.transform().translation(vector_message(from.T_frame_child.p));
    transform.transform().rotation(quaternion_message(from.T_frame_child.q));
    message.transforms().push_back(std::move(transform));
  }
  return message;
}

std::vector<StampedTransform> from_message(const tf2_msgs::msg::TFMessage& message) {
  std::vector<StampedTransform> transforms;
  for (const auto& from : message.transforms()) {
    const Pose pose(quaternion_of(from.transform().rotation()),
                    vector_of(from.transform().translation()));
    transforms.push_back({from_message(from.header().stamp()),
                          from.header().frame_id(),
                          from.child_frame_id(),
                          pose});
  }
  return transforms;
}

rosgraph_msgs::msg::Clock to_clock_message(Nanoseconds now_ns) {
  rosgraph_msgs::msg::Clock message;
  message.clock(to_message(now_ns));
  return message;
}

Nanoseconds from_message(const rosgraph_msgs::msg::Clock& message) {
  return from_message(message.clock());
}

diagnostic_msgs::msg::DiagnosticArray to_message(Nanoseconds stamp_ns,
                                                 std::span<const Diagnostic> diagnostics) {
  diagnostic_msgs::msg::DiagnosticArray message;
  message.header(header_of(stamp_ns, ""));
  for (const Diagnostic& diagnostic : diagnostics) {
    diagnostic_msgs::msg::DiagnosticStatus status;
    status.level(static_cast<std::uint8_t>(diagnostic.level));
    status.name(diagnostic.name);
    status.message(diagnostic.message);
    status.hardware_id(diagnostic.hardware_id);
    for (const auto& [key, text] : diagnostic.values) {
      diagnostic_msgs::msg::KeyValue value;
      value.key(key);
      value.value(text);
      status.values().push_back(std::move(value));
    }
    message.status().push_back(std::move(status));
  }
  return message;
}

std::vector<Diagnostic> from_message(const diagnostic_msgs::msg::DiagnosticArray& message) {
  std::vector<Diagnostic> diagnostics;
  for (const auto& status : message.status()) {
    Diagnostic diagnostic;
    diagnostic.level = enumerator(status.level(), DiagnosticLevel::kStale, DiagnosticLevel::kError);
    diagnostic.name = status.name();
    diagnostic.message = status.message();
    diagnostic.hardware_id = status.hardware_id();
    for (const auto& value : status.values()) {
      diagnostic.values.emplace_back(value.key(), value.value());
    }
    diagnostics.push_back(std::move(diagnostic));
  }
  return diagnostics;
}

}  // namespace trigpoint::bus
