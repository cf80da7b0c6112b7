// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "session_data.hpp"

#include "trigpoint/geodesy/local_frame.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

namespace fs = std::filesystem;
namespace file = exporter::session_file;

/// Of trigpoint_supervise.
constexpr const char* kRestarts = "restarts.csv";
constexpr double kUsualIntervals = 2.5;
/// Data are printed to 1e-9 degree and 1e-4 m.
constexpr double kSameDatum_m = 0.001;

enum class Need { kExpected, kOptional };

void note_damage(SessionData& data, const std::string& cause) {
  data.damaged.push_back(cause + ".");
  data.problems.push_back(data.damaged.back());
}

/// Runs `read` on the file when it exists; a damaged or missing expected file becomes a problem.
template <typename Read>
void load(SessionData& data, const std::string& name, Need need, const Read& read) {
  const auto path = data.path(name);
  if (!fs::exists(path)) {
    if (need == Need::kExpected) {
      data.problems.push_back("There is no " + name + " in the session.");
    }
    return;
  }
  try {
    read(path);
  } catch (const std::exception& error) {
    const std::string cause = error.what();
    const bool is_named = cause.find(path) != std::string::npos;
    note_damage(data, (is_named ? "" : path + ": ") + cause);
  }
}

void load_trajectories(SessionData& data) {
  const auto into = [](Trajectory& trajectory) {
    return [&](const std::string& path) { trajectory = exporter::read_trajectory(path); };
  };
  load(data, file::kFused, Need::kExpected, into(data.fused));
  load(data, file::kFusedSmoothed, Need::kOptional, into(data.fused_smoothed));
  load(data, file::kLio, Need::kExpected, into(data.lio));
  load(data, file::kGps, Need::kExpected, into(data.gps));
  load(data, file::kTruth, Need::kOptional, into(data.truth));
}

void load_logs(SessionData& data) {
  load(data, file::kFixes, Need::kExpected, [&](const auto& path) {
    data.fixes = exporter::read_fixes(path);
  });
  load(data, file::kGate, Need::kExpected, [&](const auto& path) {
    data.gate = exporter::read_gate_log(path);
  });
  load(data, file::kGpsStatus, Need::kExpected, [&](const auto& path) {
    data.gps_status = exporter::read_gps_status(path);
  });
  load(data, file::kScans, Need::kExpected, [&](const auto& path) {
    data.has_scan_log = true;
    data.scans = exporter::read_scans(path);
  });
  load(data, file::kSweeps, Need::kOptional, [&](const auto& path) {
    data.sweeps = exporter::read_sweeps(path);
    std::stable_sort(data.sweeps.begin(), data.sweeps.end(), [](const auto& a, const auto& b) {
      return a.arrival_ns < b.arrival_ns;
    });
  });
  load(data, kRestarts, Need::kOptional, [&](const auto& path) {
    data.restarts = read_restarts(path);
  });
}

/// A run that is too short, or a receiver that sends nothing good, is the usual cause.
std::string why_no_datum(const SessionData& data) {
  const auto fed = data.fixes_fed();
  if (data.fixes.empty()) {
    return "There is no datum: the log holds no fix, and the configuration names none.";
  }
  const auto accepted =
      data.gps_status.empty() ? std::uint64_t{0} : data.gps_status.back().fixes_accepted;
  if (static_cast<std::int64_t>(accepted) < data.datum_fixes) {
    return "There is no datum: fewer than " + std::to_string(data.datum_fixes) +
           " good fixes (the GPS filter accepted " + std::to_string(accepted) + " of " +
           std::to_string(fed) + ").";
  }
  return "There is no datum although the GPS filter accepted " + std::to_string(accepted) +
         " fixes: they never agreed with each other for long enough, or " + file::kDatum +
         " was lost.";
}

void load_records(SessionData& data) {
  load(data, file::kRun, Need::kExpected, [&](const auto& path) {
    data.run = exporter::read_run(path);
  });
  load(data, file::kDatum, Need::kOptional, [&](const auto& path) {
    data.datum = exporter::read_datum(path);
  });
  const bool needs_none = data.run && data.run->mode == "lio" && data.fixes.empty();
  if (!needs_none && !fs::exists(data.path(file::kDatum))) {
    data.problems.push_back(why_no_datum(data));
  }
  load(data, file::kAlignment, Need::kOptional, [&](const auto& path) {
    data.alignment = exporter::read_alignment(path);
    if (data.alignment->admitted && !exporter::is_known(data.alignment->alignment)) {
      data.alignment->admitted = false;
      data.alignment->was_admitted = true;
      data.alignment->comment = "not admitted any more: nobody knew at the end how good it was";
    }
  });
}

void load_counts(SessionData& data) {
  const std::string suffix = file::kCountsSuffix;
  for (const auto& entry : fs::directory_iterator(data.folder)) {
    const auto name = entry.path().filename().string();
    if (!name.ends_with(suffix)) {
      continue;
    }
    load(data, name, Need::kExpected, [&](const auto& path) {
      data.counts.push_back(
          {name.substr(0, name.size() - suffix.size()), exporter::read_counts(path)});
    });
  }
  std::sort(data.counts.begin(), data.counts.end(), [](const auto& a, const auto& b) {
    return a.program < b.program;
  });
}

/// Of the configuration when it says so; what is no number is told, and `value` left alone.
template <typename Number>
void read_number(SessionData& data,
                 const YAML::Node& config,
                 const std::string& section,
                 const char* key,
                 Number& value) {
  const YAML::Node within = config[section];
  const YAML::Node entry = within && within.IsMap() ? within[key] : YAML::Node();
  if (entry.IsDefined() && !entry.IsNull() && !YAML::convert<Number>::decode(entry, value)) {
    note_damage(data,
                data.path(file::kConfig) + ": " + section + "." + key + " must be a number; is " +
                    YAML::Dump(entry));
  }
}

/// The values of the effective configuration that the report needs.
void load_config(SessionData& data, const ReportOptions& options) {
  load(data, file::kConfig, Need::kExpected, [&](const auto& path) {
    const YAML::Node config = YAML::LoadFile(path);
    read_number(data, config, "gps_odometry", "datum_fixes", data.datum_fixes);
    double undulation_m = 0.0;
    read_number(data, config, "robot", "geoid_undulation_m", undulation_m);
    for (exporter::LoggedFix& logged : data.fixes) {
      logged.fix.altitude_m += undulation_m;  // as the filter did
    }
    const YAML::Node lever = config["robot"]["antenna_position_base_m"];
    if (options.antenna_position_base_m) {
      return;
    }
    if (!lever.IsSequence() || lever.size() != 3) {
      throw std::runtime_error(path +
                               " does not say robot.antenna_position_base_m: scoring against "
                               "fixes takes the antenna to be at base_link");
    }
    for (std::size_t i = 0; i < 3; ++i) {
      data.antenna_position_base_m[static_cast<Eigen::Index>(i)] = lever[i].as<double>();
    }
  });
  data.antenna_position_base_m =
      options.antenna_position_base_m.value_or(data.antenna_position_base_m);
}

/// Truth in the tangent plane of another datum is another frame: no score may be made of it.
void check_truth(SessionData& data) {
  if (data.truth.empty() || !data.datum) {
    return;
  }
  const auto named = exporter::datum_named_in(data.path(file::kTruth));
  if (!named) {
    return;
  }
  const double moved_m = (geodesy::LocalFrame(*data.datum)
                              .to_map(geodesy::place_of(*named))
                              .value_or(Eigen::Vector3d::Constant(kNaN)))
                             .norm();
  if (moved_m <= kSameDatum_m) {
    return;
  }
  data.truth_refused =
      std::string(file::kTruth) + " is in map at datum " + named->id() +
      ", the session's datum is " + data.datum->id() +
      (std::isfinite(moved_m) ? ", " + std::to_string(std::llround(std::ceil(moved_m))) + " m away"
                              : ", elsewhere on the Earth") +
      ": not scored against it";
  data.truth.clear();
}

std::optional<Nanoseconds> last_before(const Trajectory& trajectory, Nanoseconds stamp_ns) {
  const auto after = std::lower_bound(
      trajectory.begin(), trajectory.end(), stamp_ns, [](const auto& pose, Nanoseconds at_ns) {
        return pose.stamp_ns < at_ns;
      });
  return after == trajectory.begin() ? std::nullopt : std::optional(std::prev(after)->stamp_ns);
}

bool holds_a_session(const std::string& folder) {
  const auto names = {file::kRun,
                      file::kConfig,
                      file::kFused,
                      file::kLio,
                      file::kGps,
                      file::kKeyframes,
                      file::kFixes,
                      file::kGate};
  return std::any_of(names.begin(), names.end(), [&](const char* name) {
    return fs::exists(exporter::path_in(folder, name));
  });
}

}  // namespace

std::vector<Nanoseconds> SessionData::accepted_fixes_ns() const {
  std::vector<Nanoseconds> stamps;
  for (const auto& status : gps_status) {
    if (status.last_accepted_fix_ns != 0) {
      stamps.push_back(status.last_accepted_fix_ns);
    }
  }
  if (stamps.empty()) {
    for (const auto& status : gate) {
      if (status.verdict.used) {
        stamps.push_back(status.verdict.fix_stamp_ns);
      }
    }
  }
  if (stamps.empty()) {
    for (const auto& logged : fixes) {
      if (!logged.withheld && logged.fix.status >= FixStatus::kFix) {
        stamps.push_back(logged.fix.stamp_ns);
      }
    }
  }
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  return stamps;
}

std::vector<exporter::RunInfo> SessionData::runs() const {
  std::vector<exporter::RunInfo> all = run ? run->before : std::vector<exporter::RunInfo>{};
  if (run) {
    all.push_back(*run);
  }
  return all;
}

Breaks SessionData::run_begins() const {
  Breaks begins;
  const std::vector<exporter::RunInfo> all = runs();
  for (std::size_t i = 1; i < all.size(); ++i) {
    if (all[i].begin_ns) {
      begins.push_back(*all[i].begin_ns);
    }
  }
  std::sort(begins.begin(), begins.end());
  return begins;
}

Breaks SessionData::odom_begins() const {
  Breaks begins = run_begins();
  for (std::size_t i = 1; i < scans.size(); ++i) {
    if (scans[i].status.odom_epoch != scans[i - 1].status.odom_epoch) {
      begins.push_back(scans[i].status.stamp_ns);
    }
  }
  std::sort(begins.begin(), begins.end());
  return begins;
}

std::vector<Window> SessionData::outages() const {
  const auto stamps = accepted_fixes_ns();
  const Breaks begins = run_begins();
  std::vector<Nanoseconds> intervals;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    if (!is_between(begins, stamps[i - 1], stamps[i])) {
      intervals.push_back(stamps[i] - stamps[i - 1]);
    }
  }
  Nanoseconds shortest_ns = 2 * kNanosecondsPerSecond;
  if (!intervals.empty()) {
    const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
    std::nth_element(intervals.begin(), middle, intervals.end());
    shortest_ns = std::max(shortest_ns, from_seconds(kUsualIntervals * to_seconds(*middle)));
  }
  const auto& newest = fused.empty() ? lio : fused;
  std::vector<Window> found =
      find_outages(stamps, newest.empty() ? 0 : newest.back().stamp_ns, shortest_ns);
  for (Window& window : found) {  // one that goes to the end of its run ends there
    if (is_between(begins, window.begin_ns, window.end_ns)) {
      const auto next = std::upper_bound(begins.begin(), begins.end(), window.begin_ns);
      window.end_ns = last_before(newest, *next).value_or(window.begin_ns);
    }
  }
  std::erase_if(
      found, [&](const Window& window) { return window.end_ns - window.begin_ns <= shortest_ns; });
  return found;
}

Window SessionData::span() const {
  Window span{std::numeric_limits<Nanoseconds>::max(), std::numeric_limits<Nanoseconds>::min()};
  const auto include = [&](Nanoseconds stamp_ns) {
    span.begin_ns = std::min(span.begin_ns, stamp_ns);
    span.end_ns = std::max(span.end_ns, stamp_ns);
  };
  for (const auto* trajectory : {&fused, &lio, &gps}) {
    if (!trajectory->empty()) {
      include(trajectory->front().stamp_ns);
      include(trajectory->back().stamp_ns);
    }
  }
  for (const auto& row : gate) {
    include(row.stamp_ns);
  }
  return span.begin_ns <= span.end_ns ? span : Window{};
}

double SessionData::driven_s() const {
  const Window whole = span();
  Nanoseconds driven_ns = whole.end_ns - whole.begin_ns;
  for (const Nanoseconds begin_ns : run_begins()) {
    Nanoseconds end_ns = std::numeric_limits<Nanoseconds>::min();
    for (const auto* trajectory : {&fused, &lio, &gps}) {
      end_ns = std::max(end_ns, last_before(*trajectory, begin_ns).value_or(end_ns));
    }
    if (end_ns > whole.begin_ns && begin_ns < whole.end_ns) {
      driven_ns -= begin_ns - end_ns;
    }
  }
  return to_seconds(driven_ns);
}

std::size_t SessionData::fixes_fed() const {
  return static_cast<std::size_t>(std::count_if(fixes.begin(), fixes.end(), [](const auto& logged) {
    return !logged.withheld && logged.fix.status != FixStatus::kNoFix;
  }));
}

void check_is_session(const std::string& folder) {
  if (!fs::is_directory(folder)) {
    throw std::runtime_error(folder + ": is not a session folder");
  }
  if (!holds_a_session(folder)) {
    throw std::runtime_error(folder + ": is not a session: it holds neither " + file::kRun + ", " +
                             file::kConfig + ", a trajectory, " + file::kKeyframes + ", " +
                             file::kFixes + " nor " + file::kGate);
  }
}

SessionData load_session(const std::string& folder, const ReportOptions& options) {
  check_is_session(folder);
  SessionData data;
  data.folder = folder;
  load_trajectories(data);
  load_logs(data);
  load_config(data, options);
  load_records(data);
  check_truth(data);
  load_counts(data);
  return data;
}

}  // namespace trigpoint::evaluation
