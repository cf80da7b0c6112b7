// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "session_data.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

namespace fs = std::filesystem;
namespace file = exporter::session_file;

constexpr double kUsualIntervals = 2.5;

enum class Need { kExpected, kOptional };

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
    data.problems.push_back(std::string(error.what()) + ".");
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
    data.scans = exporter::read_scans(path);
  });
}

void load_records(SessionData& data) {
  load(data, file::kRun, Need::kExpected, [&](const auto& path) {
    data.run = exporter::read_run(path);
  });
  load(data, file::kDatum, Need::kExpected, [&](const auto& path) {
    data.datum = exporter::read_datum(path);
  });
  load(data, file::kAlignment, Need::kOptional, [&](const auto& path) {
    data.alignment = exporter::read_alignment(path);
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

/// The one value of the effective configuration that scoring needs.
void load_lever_arm(SessionData& data) {
  load(data, file::kConfig, Need::kExpected, [&](const auto& path) {
    const YAML::Node lever = YAML::LoadFile(path)["robot"]["antenna_position_base_m"];
    if (!lever.IsSequence() || lever.size() != 3) {
      throw std::runtime_error(path +
                               " does not say robot.antenna_position_base_m: scoring against "
                               "fixes takes the antenna to be at base_link");
    }
    for (std::size_t i = 0; i < 3; ++i) {
      data.antenna_position_base_m[static_cast<Eigen::Index>(i)] = lever[i].as<double>();
    }
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

std::vector<Window> SessionData::outages() const {
  const auto stamps = accepted_fixes_ns();
  std::vector<Nanoseconds> intervals;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    intervals.push_back(stamps[i] - stamps[i - 1]);
  }
  Nanoseconds shortest_ns = 2 * kNanosecondsPerSecond;
  if (!intervals.empty()) {
    const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
    std::nth_element(intervals.begin(), middle, intervals.end());
    shortest_ns = std::max(shortest_ns, from_seconds(kUsualIntervals * to_seconds(*middle)));
  }
  const auto& newest = fused.empty() ? lio : fused;
  return find_outages(stamps, newest.empty() ? 0 : newest.back().stamp_ns, shortest_ns);
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

SessionData load_session(const std::string& folder, const ReportOptions& options) {
  if (!fs::is_directory(folder)) {
    throw std::runtime_error(folder + ": is not a session folder");
  }
  SessionData data;
  data.folder = folder;
  load_trajectories(data);
  load_logs(data);
  load_records(data);
  load_counts(data);
  if (options.antenna_position_base_m) {
    data.antenna_position_base_m = *options.antenna_position_base_m;
  } else {
    load_lever_arm(data);
  }
  return data;
}

}  // namespace trigpoint::evaluation
