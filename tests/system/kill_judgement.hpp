// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What is judged of a drive whose processes were struck, from what was heard and from what the
// session holds. Apart from the drive itself, so that every check can be seen to fail.
#pragma once

#include "trigpoint/base/time.hpp"
#include "trigpoint/evaluation/trajectory_error.hpp"

#include <chrono>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace trigpoint::tests {

using Clock = std::chrono::steady_clock;

/// Processes as their logs are named.
inline const std::string kMapper = "trigpoint_lio_mapper";
inline const std::string kGate = "trigpoint_fusion_gate";
inline const std::string kFilter = "trigpoint_gps_eskf18";

inline constexpr double kPickUp_s = 2.0;  ///< issue
/// Without its word on the bus, from the blow on: a kill is found at once, a hang 0.9 s after the
/// stop at the latest, and what is started again 0.1 s later has kPickUp_s.
inline constexpr double kDownAfterKill_s = kPickUp_s + 0.3;
inline constexpr double kDownAfterPause_s = kPickUp_s + 0.5;
inline constexpr double kDownAfterHang_s = kPickUp_s + 1.0;
/// Who lives may be silent for as long as it waits for the dead one (fusion_gate.lio_timeout_s).
inline constexpr double kOthersGap_s = 1.5;
inline constexpr std::uint64_t kUncounted = 3;  ///< scans that a mapper refused with a reason
inline constexpr double kCovered = 0.95;        ///< of what fused.tum might have covered
inline constexpr double kWatched_s = 10.0;      ///< the others, after a blow
inline constexpr double kWorstWithin_s = 5.0;   ///< after a blow

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
  /// Largest error of fused.tum in the 5 s after the blow; NaN when it has nothing there.
  double worst_after_m{std::numeric_limits<double>::quiet_NaN()};
};

struct DriveResult {
  int exit_code{-1};
  std::string output;
  std::vector<BlowResult> blows;
  double rmse_m{1e9};  ///< fused.tum against the truth, no alignment
  double worst_m{1e9};
  double smoothed_rmse_m{1e9};  ///< fused_smoothed.tum
  double truth_s{0.0};          ///< from the first to the last pose
  double covered_s{0.0};        ///< of these, by poses of fused.tum
  std::uint64_t map_points{0};
  std::uint64_t scans_played{0};
  std::uint64_t scans_done{0};                  ///< with a pose in lio.tum
  std::uint64_t scans_listed{0};                ///< as missed, in the report
  std::set<std::string> left_in_shared_memory;  ///< by those that were struck
};

/// A message of a process.
struct Word {
  Clock::time_point at;
  Nanoseconds stamp_ns{0};
  std::string writer;
};

/// By process.
using Words = std::map<std::string, std::vector<Word>>;

struct Struck {
  Blow blow;
  Clock::time_point at;
  Clock::time_point returned;  ///< started again, or continued
  bool restarted{false};
  std::set<std::string> shared_memory;
};

/// Longest silence between two moments, silence up to `end` included.
double longest_gap_s(const std::vector<Word>& words, Clock::time_point from, Clock::time_point end);

/// The drive's own time at a moment, as the newest stamp that anybody had told by then.
Nanoseconds drive_time_ns(const Words& words, Clock::time_point at);

/// `drive_end_ns` on the clock of the stamps: nobody is blamed for silence after it.
BlowResult judge_blow(const Struck& struck,
                      const Words& words,
                      Nanoseconds drive_end_ns,
                      const std::vector<evaluation::PosePair>& fused_and_truth);

double down_limit_s(Kind kind);
bool held(const BlowResult& blow);

std::uint64_t missed_scans(const DriveResult& drive);
/// The report lists as many as are missing, no fewer and no more; false when none were played.
bool missed_scans_are_listed(const DriveResult& drive);

/// What fused.tum must cover at least when it might have covered `possible_s`. There is nothing
/// in it while the gate is down, and while it waits for a mapper; longer than allowed counts as
/// allowed, because a process that never came back is no excuse.
double least_covered_s(double possible_s, const std::vector<BlowResult>& blows);

}  // namespace trigpoint::tests
