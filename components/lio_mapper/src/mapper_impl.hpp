// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/lio_mapper/cloud_decoder.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"

#include "calibration_report.hpp"
#include "clock_steps.hpp"
#include "imu_buffer.hpp"
#include "imu_intake.hpp"
#include "imu_rate_odometry.hpp"
#include "keyframe_trigger.hpp"
#include "lost_track.hpp"
#include "past_record.hpp"
#include "resumption.hpp"
#include "scan_filter.hpp"
#include "start_up.hpp"
#include "sweep.hpp"

#include <deque>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// lio_mapper.cpp has the way of a sweep, mapper_recovery.cpp what happens at restarts, lost
/// tracks and clocks that are set, mapper_past.cpp what the correction of the past needs.
struct LioMapper::Impl {
  /// `checked` contradicts itself nowhere.
  Impl(const Config& checked, const RobotConfig& robot)
      : config(checked),
        T_base_lidar(robot.T_base_lidar()),
        decoder(config),
        intake(robot.q_base_imu()),
        imu_rate(config.imu, config.imu_rate_odometry_hz),
        calibration_report(config, T_base_lidar),
        keyframe_trigger(config.keyframes),
        lost_track(config.matching, config.recovery) {}

  void begin_stage(Stage stage) const {
    if (observe) {
      observe(stage);
    }
  }

  bool refuse_doubtful(Sweep& sweep, Nanoseconds cloud_stamp_ns, Output& output);
  void queue(Sweep sweep, Output& output);
  void process_what_is_covered(Output& output);
  void start_when_possible(Output& output);
  void begin(Output& output);
  bool resume_at_once(Output& output);
  void go_on_from(Resumption::Found found, Output& output);
  bool resume_from(const StartResult& result, Output& output);
  void begin_epoch_anew(const std::string& code, const std::string& why, Output& output);
  void update_map(const ScanOutcome& outcome);
  void process_front(Output& output);
  void refuse_front(const std::string& reason, const std::string& text, Output& output);
  void refuse_sweep(const std::string& reason,
                    Nanoseconds stamp_ns,
                    const std::string& text,
                    Output& output);
  std::optional<std::string> objection_to(const Sweep& sweep) const;
  void apply_rows(const StateUpdate& update, Output& output);
  void align(const Alignment& alignment, Nanoseconds stamp_ns, Output& output);
  void count_row(const StateUpdate& update, const RowVerdict& verdict, Output& output);
  void judge_health(const ScanOutcome& outcome, Nanoseconds stamp_ns, Output& output);
  void judge_absence(Nanoseconds stamp_ns, Output& output);
  void report(const ScanOutcome& outcome, Output& output);
  Keyframe make_keyframe(const ScanOutcome& outcome, const Odometry& odometry);
  void remember(const ScanResult& result);
  void refresh_status();

  Config config;
  Pose T_base_lidar;
  CloudDecoder decoder;
  ImuIntake intake;
  ImuBuffer imu;
  ClockSteps clock_steps;
  std::deque<Sweep> sweeps;
  std::optional<PastRecord> past;  ///< when it is kept
  std::optional<ScanFilter> filter;
  ImuRateOdometry imu_rate;
  CalibrationReport calibration_report;
  KeyframeTrigger keyframe_trigger;
  LostTrack lost_track;
  std::optional<Resumption> resumption;  ///< until the first start
  StoredPoints stored_points;            ///< while the map is frozen
  Eigen::Vector3d loaded_at_m{Eigen::Vector3d::Zero()};
  std::uint64_t imu_received_before{0};
  std::vector<StoredRow> rows_decided;
  std::uint64_t next_keyframe{0};
  LioStatus status;
  Tally refused_scans;
  Nanoseconds newest_sweep_ns{0};
  Nanoseconds last_used_ns{0};
  Nanoseconds trouble_told_ns{0};
  StageObserver observe;
};

}  // namespace trigpoint::lio_mapper
