// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One example of every plain struct in which no two fields hold the same value and none its
// default, and its comparison field by field: a field that a conversion forgets or swaps is seen.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"

#include <gtest/gtest.h>

namespace trigpoint::bus::samples {

/// Elements first, first + 1, ... row by row.
template <int Rows, int Columns = Rows>
Eigen::Matrix<double, Rows, Columns> counting_matrix(double first) {
  Eigen::Matrix<double, Rows, Columns> matrix;
  for (int row = 0; row < Rows; ++row) {
    for (int column = 0; column < Columns; ++column) {
      matrix(row, column) = first + row * Columns + column;
    }
  }
  return matrix;
}

inline ImuSample imu() {
  ImuSample imu;
  imu.stamp_ns = 1'700'000'000'123'456'789;
  imu.frame_id = "imu_link";
  imu.gyro_radps = {0.1, 0.2, 0.3};
  imu.accel_mps2 = {1.1, 1.2, 9.8};
  imu.q_world_base = Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);
  return imu;
}

inline GnssFix fix() {
  GnssFix fix;
  fix.stamp_ns = 1'700'000'001'000'000'001;
  fix.frame_id = "gps";
  fix.status = FixStatus::kGbas;
  fix.service = 0x0102;
  fix.latitude_deg = 49.01;
  fix.longitude_deg = -8.43;
  fix.altitude_m = 112.8;
  fix.covariance_enu_m2 = counting_matrix<3>(0.25);
  fix.covariance_type = CovarianceType::kKnown;
  return fix;
}

inline TwistMeasurement twist() {
  TwistMeasurement twist;
  twist.stamp_ns = 1'700'000'001'500'000'003;
  twist.frame_id = "rear_axle";
  twist.linear_mps = {-1.5, 0.25, 0.125};
  twist.covariance_m2ps2 = counting_matrix<3>(0.5);
  return twist;
}

inline YawMeasurement yaw() {
  YawMeasurement yaw;
  yaw.stamp_ns = 1'700'000'002'500'000'004;
  yaw.frame_id = "compass";
  yaw.q_world_base = Eigen::Quaterniond(0.5, 0.25, -0.125, 0.75);  // of no unit length: as it came
  yaw.variance_rad2 = 0.0625;
  return yaw;
}

inline PointCloudMessage cloud() {
  PointCloudMessage cloud;
  cloud.stamp_ns = -1;  // also before 1970
  cloud.frame_id = "lidar";
  cloud.height = 2;
  cloud.width = 3;
  cloud.fields = {{"x", 0, 7, 1}, {"time", 4, 6, 2}};
  cloud.is_bigendian = true;
  cloud.point_step = 12;
  cloud.row_step = 36;
  for (int byte = 0; byte < 72; ++byte) {
    cloud.data.push_back(static_cast<std::uint8_t>(255 - byte));
  }
  cloud.is_dense = false;
  return cloud;
}

inline Odometry odometry() {
  Odometry odometry;
  odometry.stamp_ns = 1'700'000'002'999'999'999;
  odometry.frame_id = "map";
  odometry.child_frame_id = "gnss_antenna";
  odometry.T_frame_child = {Eigen::Quaterniond(0.1, 0.7, -0.5, 0.5), {10.0, -20.0, 30.0}};
  odometry.pose_covariance = counting_matrix<6>(100.0);
  odometry.linear_mps = {4.0, 5.0, 6.0};
  odometry.angular_radps = {0.4, 0.5, 0.6};
  odometry.twist_covariance = counting_matrix<6>(200.0);
  return odometry;
}

inline Datum datum() {
  return {48.78, 9.18, 345.6, 1'699'999'999'000'000'007};
}

inline GpsStatus gps_status() {
  GpsStatus status;
  status.stamp_ns = 11'000'000'001;
  status.source = "ekf15 0.1.0";
  status.health = GpsHealth::kDeadReckoning;
  status.datum_id = "48.780000000 9.180000000 345.6000";
  status.gnss_class = GnssClass::kFloat;
  status.last_accepted_fix_ns = 10'900'000'002;
  status.accepted_antenna_map_m = {1.0, 2.0, 3.0};
  status.accepted_covariance_map_m2 = counting_matrix<3>(0.5);
  status.test_ratio = {0.1, 0.2, 1.3};
  status.fixes_received = 1'000'000'000'001;
  status.fixes_accepted = 1'000'000'000'000;
  status.rejections = {{"stale", 7}, {"no covariance", 8}};
  status.imu_received = 99;
  status.reset = {3, {0.03, {0.1, 0.2, 0.4}}};
  status.recent_fixes = {
      {10'800'000'003, false, "teleport", {4.0, 5.0, 6.0}, counting_matrix<3>(1.5)},
      {10'900'000'002, true, "", {1.0, 2.0, 3.0}, counting_matrix<3>(0.5)}};
  return status;
}

inline LioStatus lio_status() {
  LioStatus status;
  status.stamp_ns = 12'000'000'001;
  status.odom_epoch = 2;
  status.health = LioHealth::kDegraded;
  status.observability = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  status.sigma = {0.01, 0.02, 0.03, 0.04, 0.05, 0.06};
  status.reset = {4, {0.5, {0.6, 0.7, 0.8}}};
  status.aligned = true;
  status.T_map_odom = {-1.5, {7.0, 8.0, 9.0}, {0.01, 0.02}};
  status.T_map_odom_covariance = counting_matrix<6>(300.0);
  status.rows_applied = 21;
  status.rows_refused = 22;
  status.last_refusal = "row of 10.9 s is older than 1 s";
  status.last_row_fix_ns = 11'900'000'003;
  status.scans_received = 23;
  status.scans_used = 24;
  status.scans_refused = {{"no time field", 5}};
  status.imu_received = 25;
  status.distance_m = 1234.5;
  status.scan_ms = 17.5;
  return status;
}

inline StateUpdate state_update() {
  StateUpdate update;
  update.fix_stamp_ns = 13'000'000'001;
  update.mode = UpdateMode::kOverwrite;
  update.decision = {AxisDecision::kFused, AxisDecision::kCoast, AxisDecision::kLio};
  update.position_map_m = {-1.0, -2.0, -3.0};
  update.covariance_map_m2 = counting_matrix<3>(0.75);
  update.inflation = 51.0;
  update.lever_arm_base_m = {0.3, 0.2, 1.1};
  update.first_alignment =
      Alignment{6, {0.25, {100.0, 200.0, 300.0}}, counting_matrix<4>(400.0), true};
  return update;
}

inline FusionStatus fusion_status() {
  FusionStatus status;
  status.stamp_ns = 14'000'000'001;
  status.mode = "hard";
  status.axes[0] = {AxisSource::kLio, 0.62, 0.5, "sigma 0.62 m > threshold 0.50 m"};
  status.axes[1] = {AxisSource::kFused, 0.42, 0.51, "admitted"};
  status.axes[2] = {AxisSource::kGps, 0.9, 1.0, "no mapper"};
  status.aligned = true;
  status.T_map_odom = {0.75, {11.0, 12.0, 13.0}};
  status.yaw_sigma_rad = 0.002;
  status.position_sigma_m = {0.1, 0.2, 0.3};
  status.verdict = {13'000'000'002, true, "used on east and north"};
  status.fixes_seen = 31;
  status.fixes_used = 32;
  status.verdicts = {{"used", 32}, {"repeated", 1}, {"", 2}};
  status.gps_source = "0123456789abcdef";
  status.judged = {{12'900'000'003, false, "off level"}, status.verdict};
  return status;
}

inline void expect_equal(const ImuSample& a, const ImuSample& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.frame_id, b.frame_id);
  EXPECT_EQ(a.gyro_radps, b.gyro_radps);
  EXPECT_EQ(a.accel_mps2, b.accel_mps2);
  ASSERT_EQ(a.q_world_base.has_value(), b.q_world_base.has_value());
  if (a.q_world_base) {
    EXPECT_EQ(a.q_world_base->coeffs(), b.q_world_base->coeffs());
  }
}

inline void expect_equal(const GnssFix& a, const GnssFix& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.frame_id, b.frame_id);
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.service, b.service);
  EXPECT_EQ(a.latitude_deg, b.latitude_deg);
  EXPECT_EQ(a.longitude_deg, b.longitude_deg);
  EXPECT_EQ(a.altitude_m, b.altitude_m);
  EXPECT_EQ(a.covariance_enu_m2, b.covariance_enu_m2);
  EXPECT_EQ(a.covariance_type, b.covariance_type);
}

inline void expect_equal(const TwistMeasurement& a, const TwistMeasurement& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.frame_id, b.frame_id);
  EXPECT_EQ(a.linear_mps, b.linear_mps);
  EXPECT_EQ(a.covariance_m2ps2, b.covariance_m2ps2);
}

inline void expect_equal(const YawMeasurement& a, const YawMeasurement& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.frame_id, b.frame_id);
  ASSERT_EQ(a.q_world_base.has_value(), b.q_world_base.has_value());
  if (a.q_world_base) {
    EXPECT_EQ(a.q_world_base->coeffs(), b.q_world_base->coeffs());
  }
  EXPECT_EQ(a.variance_rad2, b.variance_rad2);
}

inline void expect_equal(const PointCloudMessage& a, const PointCloudMessage& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.frame_id, b.frame_id);
  EXPECT_EQ(a.height, b.height);
  EXPECT_EQ(a.width, b.width);
  ASSERT_EQ(a.fields.size(), b.fields.size());
  for (std::size_t i = 0; i < a.fields.size(); ++i) {
    EXPECT_EQ(a.fields[i].name, b.fields[i].name);
    EXPECT_EQ(a.fields[i].offset, b.fields[i].offset);
    EXPECT_EQ(a.fields[i].datatype, b.fields[i].datatype);
    EXPECT_EQ(a.fields[i].count, b.fields[i].count);
  }
  EXPECT_EQ(a.is_bigendian, b.is_bigendian);
  EXPECT_EQ(a.point_step, b.point_step);
  EXPECT_EQ(a.row_step, b.row_step);
  EXPECT_EQ(a.data, b.data);
  EXPECT_EQ(a.is_dense, b.is_dense);
}

inline void expect_equal(const Odometry& a, const Odometry& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.frame_id, b.frame_id);
  EXPECT_EQ(a.child_frame_id, b.child_frame_id);
  EXPECT_EQ(a.T_frame_child.p, b.T_frame_child.p);
  EXPECT_EQ(a.T_frame_child.q.coeffs(), b.T_frame_child.q.coeffs());
  EXPECT_EQ(a.pose_covariance, b.pose_covariance);
  EXPECT_EQ(a.linear_mps, b.linear_mps);
  EXPECT_EQ(a.angular_radps, b.angular_radps);
  EXPECT_EQ(a.twist_covariance, b.twist_covariance);
}

inline void expect_equal(const Datum& a, const Datum& b) {
  EXPECT_EQ(a.latitude_deg, b.latitude_deg);
  EXPECT_EQ(a.longitude_deg, b.longitude_deg);
  EXPECT_EQ(a.height_m, b.height_m);
  EXPECT_EQ(a.elected_ns, b.elected_ns);
}

inline void expect_equal(const YawPose& a, const YawPose& b) {
  EXPECT_EQ(a.yaw_rad, b.yaw_rad);
  EXPECT_EQ(a.tilt_rad, b.tilt_rad);
  EXPECT_EQ(a.p, b.p);
}

inline void expect_equal(const ResetInfo& a, const ResetInfo& b) {
  EXPECT_EQ(a.counter, b.counter);
  expect_equal(a.delta, b.delta);
}

inline void expect_equal(const std::vector<NamedCount>& a, const std::vector<NamedCount>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].name, b[i].name);
    EXPECT_EQ(a[i].count, b[i].count);
  }
}

inline void expect_equal(const GpsStatus& a, const GpsStatus& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.source, b.source);
  EXPECT_EQ(a.health, b.health);
  EXPECT_EQ(a.datum_id, b.datum_id);
  EXPECT_EQ(a.gnss_class, b.gnss_class);
  EXPECT_EQ(a.last_accepted_fix_ns, b.last_accepted_fix_ns);
  EXPECT_EQ(a.accepted_antenna_map_m, b.accepted_antenna_map_m);
  EXPECT_EQ(a.accepted_covariance_map_m2, b.accepted_covariance_map_m2);
  EXPECT_EQ(a.test_ratio, b.test_ratio);
  EXPECT_EQ(a.fixes_received, b.fixes_received);
  EXPECT_EQ(a.fixes_accepted, b.fixes_accepted);
  expect_equal(a.rejections, b.rejections);
  EXPECT_EQ(a.imu_received, b.imu_received);
  expect_equal(a.reset, b.reset);
  ASSERT_EQ(a.recent_fixes.size(), b.recent_fixes.size());
  for (std::size_t i = 0; i < a.recent_fixes.size(); ++i) {
    EXPECT_EQ(a.recent_fixes[i].stamp_ns, b.recent_fixes[i].stamp_ns);
    EXPECT_EQ(a.recent_fixes[i].accepted, b.recent_fixes[i].accepted);
    EXPECT_EQ(a.recent_fixes[i].reason, b.recent_fixes[i].reason);
    EXPECT_EQ(a.recent_fixes[i].antenna_map_m, b.recent_fixes[i].antenna_map_m);
    EXPECT_EQ(a.recent_fixes[i].covariance_map_m2, b.recent_fixes[i].covariance_map_m2);
  }
}

inline void expect_equal(const LioStatus& a, const LioStatus& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.odom_epoch, b.odom_epoch);
  EXPECT_EQ(a.health, b.health);
  EXPECT_EQ(a.observability, b.observability);
  EXPECT_EQ(a.sigma, b.sigma);
  expect_equal(a.reset, b.reset);
  EXPECT_EQ(a.aligned, b.aligned);
  expect_equal(a.T_map_odom, b.T_map_odom);
  EXPECT_EQ(a.T_map_odom_covariance, b.T_map_odom_covariance);
  EXPECT_EQ(a.rows_applied, b.rows_applied);
  EXPECT_EQ(a.rows_refused, b.rows_refused);
  EXPECT_EQ(a.last_refusal, b.last_refusal);
  EXPECT_EQ(a.last_row_fix_ns, b.last_row_fix_ns);
  EXPECT_EQ(a.scans_received, b.scans_received);
  EXPECT_EQ(a.scans_used, b.scans_used);
  expect_equal(a.scans_refused, b.scans_refused);
  EXPECT_EQ(a.imu_received, b.imu_received);
  EXPECT_EQ(a.distance_m, b.distance_m);
  EXPECT_EQ(a.scan_ms, b.scan_ms);
}

inline void expect_equal(const StateUpdate& a, const StateUpdate& b) {
  EXPECT_EQ(a.fix_stamp_ns, b.fix_stamp_ns);
  EXPECT_EQ(a.mode, b.mode);
  EXPECT_EQ(a.decision, b.decision);
  EXPECT_EQ(a.position_map_m, b.position_map_m);
  EXPECT_EQ(a.covariance_map_m2, b.covariance_map_m2);
  EXPECT_EQ(a.inflation, b.inflation);
  EXPECT_EQ(a.lever_arm_base_m, b.lever_arm_base_m);
  ASSERT_EQ(a.first_alignment.has_value(), b.first_alignment.has_value());
  if (a.first_alignment) {
    EXPECT_EQ(a.first_alignment->odom_epoch, b.first_alignment->odom_epoch);
    expect_equal(a.first_alignment->T_map_odom, b.first_alignment->T_map_odom);
    EXPECT_EQ(a.first_alignment->covariance, b.first_alignment->covariance);
    EXPECT_EQ(a.first_alignment->replaces, b.first_alignment->replaces);
  }
}

inline void expect_equal(const FixVerdict& a, const FixVerdict& b) {
  EXPECT_EQ(a.fix_stamp_ns, b.fix_stamp_ns);
  EXPECT_EQ(a.used, b.used);
  EXPECT_EQ(a.reason, b.reason);
}

inline void expect_equal(const FusionStatus& a, const FusionStatus& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.mode, b.mode);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(a.axes[axis].source, b.axes[axis].source);
    EXPECT_EQ(a.axes[axis].sigma_m, b.axes[axis].sigma_m);
    EXPECT_EQ(a.axes[axis].threshold_m, b.axes[axis].threshold_m);
    EXPECT_EQ(a.axes[axis].reason, b.axes[axis].reason);
  }
  EXPECT_EQ(a.aligned, b.aligned);
  expect_equal(a.T_map_odom, b.T_map_odom);
  EXPECT_EQ(a.yaw_sigma_rad, b.yaw_sigma_rad);
  EXPECT_EQ(a.position_sigma_m, b.position_sigma_m);
  expect_equal(a.verdict, b.verdict);
  EXPECT_EQ(a.fixes_seen, b.fixes_seen);
  EXPECT_EQ(a.fixes_used, b.fixes_used);
  expect_equal(a.verdicts, b.verdicts);
  EXPECT_EQ(a.gps_source, b.gps_source);
  ASSERT_EQ(a.judged.size(), b.judged.size());
  for (std::size_t i = 0; i < a.judged.size(); ++i) {
    expect_equal(a.judged[i], b.judged[i]);
  }
}

}  // namespace trigpoint::bus::samples
