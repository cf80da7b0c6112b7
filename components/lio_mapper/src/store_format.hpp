// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What writer and reader of the keyframe store agree on; KEYFRAMES.md says the same in words.
#pragma once

#include "trigpoint/base/pose.hpp"
#include "trigpoint/lio_mapper/checkpoint.hpp"

#include "sqlite_database.hpp"

#include <array>
#include <cstdint>

namespace trigpoint::lio_mapper::store {

inline constexpr int kFormatVersion = 5;       ///< PRAGMA user_version
inline constexpr int kNoExtrinsicVersion = 4;  ///< checkpoint of a state without extrinsic
inline constexpr int kRawPointsVersion = 3;    ///< clouds as float32, no rows, no checkpoint

inline constexpr const char* kSchema =
    "CREATE TABLE keyframes("
    " row INTEGER PRIMARY KEY, id INTEGER NOT NULL, stamp_ns INTEGER NOT NULL,"
    " odom_epoch INTEGER NOT NULL, x_odom_m REAL, y_odom_m REAL,"
    " T_odom_base BLOB NOT NULL, pose_covariance BLOB NOT NULL,"
    " aligned INTEGER NOT NULL, T_map_odom BLOB NOT NULL, points_base BLOB NOT NULL);"
    "CREATE INDEX keyframes_place ON keyframes(odom_epoch, x_odom_m, y_odom_m, stamp_ns);"
    "CREATE INDEX keyframes_time ON keyframes(odom_epoch, stamp_ns, x_odom_m, y_odom_m);"
    "CREATE TABLE gps_rows("
    " row INTEGER PRIMARY KEY, fix_stamp_ns INTEGER NOT NULL, odom_epoch INTEGER NOT NULL,"
    " mode INTEGER NOT NULL, decision_x INTEGER NOT NULL, decision_y INTEGER NOT NULL,"
    " decision_z INTEGER NOT NULL, position_map BLOB NOT NULL, covariance_map BLOB NOT NULL,"
    " lever_arm_base BLOB NOT NULL, applied INTEGER NOT NULL, verdict TEXT NOT NULL);"
    "CREATE TABLE checkpoint("
    " id INTEGER PRIMARY KEY CHECK(id = 1), stamp_ns INTEGER NOT NULL,"
    " odom_epoch INTEGER NOT NULL, aligned INTEGER NOT NULL, distance_m REAL NOT NULL,"
    " next_keyframe INTEGER NOT NULL, scans_received INTEGER NOT NULL,"
    " scans_used INTEGER NOT NULL, imu_received INTEGER NOT NULL,"
    " rows_applied INTEGER NOT NULL, rows_refused INTEGER NOT NULL,"
    " last_row_fix_ns INTEGER NOT NULL, reset_counter INTEGER NOT NULL,"
    " scans_refused TEXT NOT NULL, state BLOB NOT NULL, covariance BLOB NOT NULL,"
    " drift_covariance BLOB NOT NULL);";

using PoseNumbers = std::array<double, 7>;     ///< x y z qx qy qz qw
using YawPoseNumbers = std::array<double, 6>;  ///< yaw x y z tilt_x tilt_y
/// PoseNumbers, velocity, gyro bias, accelerometer bias, gravity, YawPoseNumbers of T_map_odom and
/// of the newest reset.
using StateNumbers = std::array<double, 31>;

inline PoseNumbers numbers_of(const Pose& T) {
  return {T.p.x(), T.p.y(), T.p.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w()};
}

inline Pose pose_of(const PoseNumbers& n) {
  return {Eigen::Quaterniond(n[6], n[3], n[4], n[5]), {n[0], n[1], n[2]}};
}

inline YawPoseNumbers numbers_of(const YawPose& T) {
  return {T.yaw_rad, T.p.x(), T.p.y(), T.p.z(), T.tilt_rad.x(), T.tilt_rad.y()};
}

inline YawPose yaw_pose_of(const YawPoseNumbers& n) {
  return {n[0], {n[1], n[2], n[3]}, {n[4], n[5]}};
}

StateNumbers state_numbers_of(const Checkpoint& checkpoint);
void set_state(const StateNumbers& numbers, Checkpoint& checkpoint);

/// "name count" lines.
std::string text_of(const std::vector<NamedCount>& counts);
std::vector<NamedCount> counts_of(const std::string& text);

inline std::int64_t version_of(Database& database) {
  Statement statement(database, "PRAGMA user_version");
  statement.step();
  return statement.integer(0);
}

}  // namespace trigpoint::lio_mapper::store
