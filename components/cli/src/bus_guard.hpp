// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Two runs on one DDS domain mix their data without a word: looked for before anything is sent.
#pragma once

#include "bus_survey.hpp"
#include "system_config.hpp"

#include <string>
#include <vector>

namespace trigpoint::cli {

enum class Guarded {
  kSensors,         ///< points, imu, fix, clock: what a player writes
  kSensorsAndCores  ///< and the odometries: what a whole run writes
};

struct BusFindings {
  bool interrupted{false};           ///< SIGINT or SIGTERM came while listening
  std::vector<std::string> writers;  ///< a sentence's part for each topic that has writers
};

/// Listens for a moment. Throws ConfigError when domain, interface or peers are given wrongly,
/// std::runtime_error when the bus cannot be joined.
BusFindings look_for_writers(const SystemConfig& config, Guarded guarded);

/// Joins the bus and leaves it; says which: "DDS domain 3 with fastdds". Throws as
/// look_for_writers.
std::string try_to_join(const SystemConfig& config);

/// "gps/odometry: trigpoint_gps_ekf15 (process 123)\n..." with the remedy; for an error.
std::string refusal(const BusFindings& findings, const SystemConfig& config);

/// The process that a DDS writer belongs to, as far as can be told on this computer: its program
/// and number when that program is Trigpoint's, else "a program whose GUID is ...".
std::string owner_of(const std::string& writer_guid, const recording::TopicSurvey& survey);

}  // namespace trigpoint::cli
