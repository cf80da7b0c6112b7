// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One simulated drive through the three cores, in every mode of the gate on the same input.
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/evaluation/continuity.hpp"
#include "trigpoint/evaluation/fault_scores.hpp"
#include "trigpoint/evaluation/trajectory_error.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "input.hpp"

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::fusion_table {

/// What became of one fix.
struct Judgement {
  std::array<bool, 3> moves{};  ///< a row of this axis (east, north, up) went to the mapper
  bool used{false};             ///< the gate's verdict
  std::string reason;           ///< its words; empty: none was published

  /// Of several verdicts given at once only the newest is published.
  bool is_used() const { return used || moves[0] || moves[1] || moves[2]; }
};

/// How well gps/odometry says that it knows where it is.
struct GpsSigma {
  Nanoseconds stamp_ns{0};
  double horizontal_m{kNaN};
};

/// What one mode made of the drive.
struct Run {
  evaluation::Trajectory fused;                 ///< as published online, at IMU rate
  evaluation::Trajectory odom;                  ///< lio/odometry_imu_rate
  std::vector<evaluation::PosePair> pairs;      ///< fused and truth
  std::vector<evaluation::PosePair> raw_pairs;  ///< fusion/odometry_raw and truth
  double nees_pose{kNaN};                       ///< mean over fused, per degree of freedom
  double nees_position{kNaN};
  /// Root mean squares over fused of error and sigma: x y z, roll pitch yaw about the axes of map.
  Eigen::Matrix<double, 6, 1> rms_error{Eigen::Matrix<double, 6, 1>::Constant(kNaN)};
  Eigen::Matrix<double, 6, 1> rms_sigma{Eigen::Matrix<double, 6, 1>::Constant(kNaN)};
  std::vector<GpsSigma> gps_sigmas;
  std::vector<NamedCount> verdicts;             ///< of all fixes, by code
  std::map<Nanoseconds, Judgement> judgements;  ///< by the fix's stamp
  double process_s{0.0};                        ///< processor time of the three cores
};

struct ReceivedFix {
  Nanoseconds stamp_ns{0};
  Eigen::Vector3d error_map_m{Eigen::Vector3d::Zero()};  ///< against the true antenna
};

struct Drive {
  std::string scenario;
  std::uint64_t seed{1};
  std::shared_ptr<const simulator::Truth> truth;
  std::vector<simulator::FixTruth> fixes;  ///< of every epoch; for scoring only
  std::vector<ReceivedFix> received;       ///< once each, in order of their stamps
  std::map<std::string, Run> runs;         ///< by mode
  /// The same with the fixes once each, in order, at the receiver's usual latency; on demand.
  std::map<std::string, Run> sorted_runs;

  const Run* run_of(const std::string& mode) const;
};

struct DriveOptions {
  cli::InputOptions input;  ///< scenario and seed
  std::vector<std::string> modes;
  bool sorted{false};  ///< also sorted_runs
};

Drive drive(const DriveOptions& options);

/// What the faults do to the fixes of a drive, without driving it (no LiDAR).
Drive without_runs(const cli::InputOptions& input);

/// The choices of fusion_gate.mode.
std::vector<std::string> known_modes();

/// Stretches of consecutive fixes that were delivered and are as asked, from the first such fix to
/// the next one that is not (or the drive's end).
std::vector<evaluation::Window> stretches(
    const Drive& drive,
    const std::function<bool(const simulator::FixTruth&)>& is);

/// From the last fix before to the first one after, where none came for more than 2 s; only those
/// that end before the drive does.
std::vector<evaluation::Window> outages(const Drive& drive);

}  // namespace trigpoint::fusion_table
