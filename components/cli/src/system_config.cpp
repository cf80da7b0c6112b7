// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "system_config.hpp"

namespace trigpoint::cli {

namespace {

void describe_log(recording::LogOptions& log, ConfigFields& fields) {
  fields.flag("require_points", log.require_points, "refuse a log without the points topic");
  fields.flag("require_imu", log.require_imu, "refuse a log without the IMU topic");
  fields.flag("require_fix", log.require_fix, "refuse a log without the GPS topic");
  fields.flag("require_aiding",
              log.require_aiding,
              "refuse a log without robot.twist_topic or robot.yaw_topic, where these are named");
  fields.number("fix_rate_limit_hz",
                log.fix_rate_limit_hz,
                "fixes beyond this rate are withheld, for scoring only; 0 feeds all",
                kNotNegative);
  fields.number("start_s", log.start_s, "skip this much of the log", kNotNegative);
  fields.number("duration_s", log.duration_s, "then use this much; 0 is all", kNotNegative);
  fields.number("lead_in_s",
                log.lead_in_s,
                "KITTI: IMU and fixes from this long before the first sweep",
                kNotNegative);
  fields.number("elevation_correction_rad",
                log.elevation_correction_rad,
                "KITTI: its beams' elevation angles are too low by this much");
}

/// What the gate may send, the mapper must take.
void refuse_rows_that_come_too_late(const pipeline::CoreConfigs& cores) {
  const double latest_s = cores.fusion_gate.max_fix_age_s + fusion_gate::kJudgingSlack_s;
  const double kept_s = cores.lio_mapper.rows.history_s;
  if (latest_s > kept_s) {
    throw ConfigError("fusion_gate.max_fix_age_s allows rows that are " + std::to_string(latest_s) +
                      " s old, and lio_mapper.rows.history_s keeps only " + std::to_string(kept_s) +
                      " s: make the former smaller or the latter larger");
  }
}

}  // namespace

void describe(SystemConfig& config, ConfigFields& fields) {
  using trigpoint::describe;
  fields.section("robot",
                 "where the sensors sit, and what their topics are called",
                 [&](ConfigFields& f) { describe(config.cores.robot, f); });
  fields.section("bus", "how the processes take part in DDS", [&](ConfigFields& f) {
    bus::describe(config.bus, f);
  });
  fields.section("gps_odometry", "the GPS filter", [&](ConfigFields& f) {
    gps_odometry::describe(config.cores.gps_odometry, f);
  });
  fields.section("lio_mapper", "the LiDAR-inertial mapper", [&](ConfigFields& f) {
    lio_mapper::describe(config.cores.lio_mapper, f);
  });
  fields.section("fusion_gate", "the arbiter", [&](ConfigFields& f) {
    fusion_gate::describe(config.cores.fusion_gate, f);
  });
  fields.section(
      "log", "which part of a log is used", [&](ConfigFields& f) { describe_log(config.log, f); });
}

std::string mode_of(const SystemConfig& config) {
  return config.cores.fusion_gate.mode;
}

void load(SystemConfig& config, const std::vector<std::string>& files) {
  load_config(files, [&config](ConfigFields& fields) { describe(config, fields); });
  refuse_rows_that_come_too_late(config.cores);
}

std::string print(SystemConfig config) {
  return print_config([&config](ConfigFields& fields) { describe(config, fields); });
}

}  // namespace trigpoint::cli
