// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A drive in real time through bringup/run, whose processes are killed and stopped on the way, and
// what the bus, the session and its report show of it.
#pragma once

#include "trigpoint/export/session.hpp"

#include <cstdint>
#include <set>
#include <string>
#include <vector>

namespace trigpoint::tests {

enum class Kind {
  kKill,   ///< kill -9
  kPause,  ///< SIGSTOP, and SIGCONT a moment later
  kHang    ///< SIGSTOP for good: its supervisor must find out
};

struct Blow {
  double at_s{0.0};  ///< after the drive's first message
  std::string process;
  Kind kind{Kind::kKill};
};

struct BlowResult {
  Blow blow;
  bool restarted{false};   ///< another process has taken its place
  double down_s{1e9};      ///< without its word on the bus
  double pick_up_s{1e9};   ///< from the start of its successor (or SIGCONT) to the first word
  double others_gap_s{0};  ///< longest silence of any other process in the 10 s after the blow
};

struct DriveResult {
  int exit_code{-1};
  std::string output;
  std::vector<BlowResult> blows;
  double rmse_m{1e9};  ///< fused.tum against the truth, no alignment
  double worst_m{1e9};
  double smoothed_rmse_m{1e9};  ///< fused_smoothed.tum
  std::uint64_t map_points{0};
  std::uint64_t scans_played{0};
  std::uint64_t scans_done{0};                  ///< with a pose in lio.tum
  std::uint64_t scans_listed{0};                ///< as missed, in the report
  std::set<std::string> left_in_shared_memory;  ///< by those that were struck
};

struct DriveSettings {
  std::string scenario;
  int seed{1};
  double duration_s{180.0};
  std::string domain;
  std::string session;
  std::string rate{"1"};
  std::vector<std::string> more_arguments;
};

/// Processes as their logs are named.
inline const std::string kMapper = "trigpoint_lio_mapper";
inline const std::string kGate = "trigpoint_fusion_gate";
inline const std::string kFilter = "trigpoint_gps_eskf18";

/// Runs it to its end. ROS_DOMAIN_ID of this process is set to the domain.
DriveResult drive(const DriveSettings& settings, const std::vector<Blow>& blows);

const char* name_of(Kind kind);

}  // namespace trigpoint::tests
