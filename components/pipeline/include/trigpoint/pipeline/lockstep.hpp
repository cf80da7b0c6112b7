// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The three cores in one process: every input goes through all of them before the next one comes.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/fusion_gate/config.hpp"
#include "trigpoint/gps_odometry/config.hpp"
#include "trigpoint/lio_mapper/config.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"
#include "trigpoint/recording/log.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace trigpoint::pipeline {

struct CoreConfigs {
  RobotConfig robot;
  gps_odometry::Config gps_odometry;
  lio_mapper::Config lio_mapper;
  fusion_gate::Config fusion_gate;
};

/// What one input made the three components say, in the order in which they said it.
struct Step {
  std::vector<Odometry> gps_odometry;
  std::vector<GpsStatus> gps_status;
  std::vector<lio_mapper::ScanResult> scans;
  std::vector<Odometry> lio_imu_rate;
  std::vector<Odometry> fused;
  std::vector<Odometry> fused_raw;  ///< before the hand-over
  std::vector<FusionStatus> fusion_status;
  std::vector<StateUpdate> state_updates;
  std::optional<Datum> datum;  ///< elected by this input
  Events events;
};

/// Deterministic: the same entries give the same bits. The wiring is that of the bus: the gate
/// hears the filter and the mapper, the mapper hears the gate.
class Lockstep {
 public:
  /// Throws ConfigError when a core refuses its configuration.
  explicit Lockstep(const CoreConfigs& configs);
  ~Lockstep();

  /// Before the first entry: the mapper goes on from a stored session.
  void resume(const lio_mapper::Checkpoint& checkpoint,
              lio_mapper::StoredPoints points,
              const lio_mapper::ResumeOptions& options);

  /// Withheld fixes are not fed to anybody.
  Step step(const recording::LogEntry& entry);
  /// An entry that is a cloud, as a CloudDecoder with the mapper's configuration has read it; its
  /// bytes are not looked at. All clouds in this way, or all in the other.
  Step step(const recording::LogEntry& entry, lio_mapper::DecodedCloud cloud);
  /// End of the log: what still waits in the mapper.
  Step finish();

  /// For who corrects its past between two steps.
  lio_mapper::LioMapper& mapper();

  std::optional<Datum> datum() const;
  std::optional<Alignment> best_alignment() const;
  GpsStatus gps_status() const;
  LioStatus lio_status() const;
  std::optional<lio_mapper::Checkpoint> checkpoint() const;
  /// Rows that the mapper decided on since its newest scan.
  std::vector<lio_mapper::StoredRow> take_rows();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::pipeline
