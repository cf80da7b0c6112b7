// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/lio_mapper/checkpoint.hpp"

#include "scan_filter.hpp"

namespace trigpoint::lio_mapper {

/// The filter's part of a checkpoint, and the status's.
inline Checkpoint checkpoint_of(const ScanFilter& filter,
                                const LioStatus& status,
                                std::uint64_t next_keyframe) {
  const State& state = filter.state();
  Checkpoint c;
  c.stamp_ns = filter.stamp_ns();
  c.odom_epoch = status.odom_epoch;
  c.T_odom_base = state.T_odom_base;
  c.v_odom_mps = state.v_odom_mps;
  c.gyro_bias_radps = state.gyro_bias_radps;
  c.accel_bias_mps2 = state.accel_bias_mps2;
  c.gravity_odom_mps2 = state.gravity_odom_mps2;
  c.aligned = filter.aligned();
  c.T_map_odom = state.T_map_odom;
  c.covariance = filter.covariance();
  c.drift_covariance = filter.drift_covariance();
  c.distance_m = filter.distance_m();
  c.next_keyframe = next_keyframe;
  c.scans_received = status.scans_received;
  c.scans_used = status.scans_used;
  c.imu_received = status.imu_received;
  c.rows_applied = status.rows_applied;
  c.rows_refused = status.rows_refused;
  c.last_row_fix_ns = status.last_row_fix_ns;
  c.reset = status.reset;
  c.scans_refused = status.scans_refused;
  return c;
}

/// What the status says of an earlier run until the first scan of this one.
inline void set_status(const Checkpoint& c, LioStatus& status) {
  status.stamp_ns = c.stamp_ns;
  status.odom_epoch = c.odom_epoch;
  status.aligned = c.aligned;
  status.T_map_odom = c.T_map_odom;
  status.distance_m = c.distance_m;
  status.scans_received = c.scans_received;
  status.scans_used = c.scans_used;
  status.imu_received = c.imu_received;
  status.rows_applied = c.rows_applied;
  status.rows_refused = c.rows_refused;
  status.last_row_fix_ns = c.last_row_fix_ns;
  status.reset = c.reset;
  status.scans_refused = c.scans_refused;
}

}  // namespace trigpoint::lio_mapper
