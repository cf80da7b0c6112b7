// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "report_sections.hpp"

#include "trigpoint/evaluation/plane_thickness.hpp"

#include "gate_series.hpp"
#include "table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;
/// A silence of the gate longer than this is nobody's choice.
constexpr double kLongestRow_s = 2.0;

std::string sigma_text(double yaw_sigma_rad, const std::array<double, 3>& sigma_m) {
  return "yaw " + fixed(yaw_sigma_rad * kDegreesPerRadian, 3) + " deg, east " +
         fixed(sigma_m[0], 3) + " m, north " + fixed(sigma_m[1], 3) + " m, up " +
         fixed(sigma_m[2], 3) + " m";
}

bool is_known_sigma_of(const FusionStatus& row) {
  return is_known_sigma(row.yaw_sigma_rad) &&
         std::all_of(row.position_sigma_m.begin(), row.position_sigma_m.end(), is_known_sigma);
}

std::string transform_text(const YawPose& T) {
  return "yaw " + fixed(T.yaw_rad * kDegreesPerRadian, 4) + " deg, translation (" +
         fixed(T.p.x(), 3) + ", " + fixed(T.p.y(), 3) + ", " + fixed(T.p.z(), 3) + ") m, tilt (" +
         fixed(T.tilt_rad.x() * kDegreesPerRadian, 3) + ", " +
         fixed(T.tilt_rad.y() * kDegreesPerRadian, 3) + ") deg";
}

/// Nearest rank: the smallest value that at least this share of the sorted values does not exceed.
double percentile(const std::vector<double>& sorted, double part) {
  if (sorted.empty()) {
    return kNaN;
  }
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(sorted.size())));
  return sorted[std::max<std::size_t>(rank, 1) - 1];
}

/// Seconds of each source on one axis.
std::array<double, 4> seconds_by_source(const std::vector<FusionStatus>& rows, std::size_t axis) {
  std::array<double, 4> seconds{};
  for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
    const double dt_s = to_seconds(rows[i + 1].stamp_ns - rows[i].stamp_ns);
    seconds.at(static_cast<std::size_t>(rows[i].axes.at(axis).source)) +=
        std::clamp(dt_s, 0.0, kLongestRow_s);
  }
  return seconds;
}

std::string axis_table(const SessionData& data) {
  Table table({"axis", "threshold m", "fused", "lio", "gps", "none"});
  const std::array<const char*, 3> names{"east", "north", "up"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto seconds = seconds_by_source(data.gate, axis);
    const double all = seconds[0] + seconds[1] + seconds[2] + seconds[3];
    const auto part = [&](AxisSource source) {
      return share(seconds.at(static_cast<std::size_t>(source)) / all);
    };
    table.add({names.at(axis),
               fixed(data.gate.back().axes.at(axis).threshold_m, 2),
               part(AxisSource::kFused),
               part(AxisSource::kLio),
               part(AxisSource::kGps),
               part(AxisSource::kNone)});
  }
  return table.str();
}

bool nobody_chosen(const std::vector<FusionStatus>& rows) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto seconds = seconds_by_source(rows, axis);
    if (seconds[1] + seconds[2] + seconds[3] > 0.0) {
      return false;
    }
  }
  return true;
}

/// The number after "POINTS" in a PCD's header.
std::string points_of(const std::string& pcd) {
  std::ifstream in(pcd, std::ios::binary);
  for (std::string word; in >> word && word != "DATA";) {
    if (word == "POINTS") {
      std::uint64_t points = 0;
      in >> points;
      return std::to_string(points);
    }
  }
  return "an unknown number of";
}

std::string place_of_map(const SessionData& data, const SessionMap& map) {
  if (map.frame == "odom") {
    return "Its frame is odom: nothing aligned it with map.";
  }
  if (!data.alignment) {
    return "Its frame is map, by the alignment that the mapper had; no " +
           std::string(file::kAlignment) + " was left.";
  }
  const bool corrected = std::filesystem::exists(data.path(file::kKeyframePoses));
  if (data.alignment->was_admitted) {
    return "Its frame is map, by alignments that were admitted while it was driven; what is of an "
           "odom epoch without one is left out.";
  }
  return data.alignment->admitted
             ? corrected ? "Its frame is map, every keyframe placed by the pose graph."
                         : "Its frame is map, placed with the alignment above."
             : "Placed with the alignment above, which the gate has **not admitted**: neither its "
               "place nor its direction can be relied on.";
}

std::string thickness_text(const SessionMap& map) {
  if (!map.problem.empty()) {
    return "Thickness of facades: " + map.problem + ".\n";
  }
  const PlaneThickness found = facade_thickness(map.points);
  if (found.planes == 0) {
    return "Thickness of facades: there is no upright plane to measure.\n";
  }
  return "Thickness of facades (one sigma across upright planes: half the width of the middle 68 % "
         "of their points): median " +
         fixed(found.median_m, 3) + " m, 90th percentile " + fixed(found.p90_m, 3) + " m, " +
         std::to_string(found.planes) + " planes in " + std::to_string(found.cells) +
         " cells of 2 m" +
         (found.share_looked_at < 1.0
              ? ", a sample of " + share(found.share_looked_at) + " of the map"
              : "") +
         ".\n";
}

std::string how_text(const exporter::RunInfo& run) {
  return (run.how == "dds" ? "three processes over DDS" : run.how) + ", gate mode `" + run.mode +
         "`, GPS filter `" + run.gps_filter + "`";
}

/// A run that was killed has not written how long it was.
std::string data_text(double data_s) {
  return data_s > 0.0 ? fixed(data_s, 1) + " s" : "how long is not known";
}

std::string pace_text(double data_s, double wall_s) {
  if (!(wall_s > 0.0)) {
    return "not known";
  }
  return fixed(wall_s, 1) + " s, " + fixed(data_s / wall_s, 2) + " times real time";
}

/// One, or all that a session has been resumed with.
std::string print_runs(const std::vector<exporter::RunInfo>& runs) {
  if (runs.empty()) {
    return "";
  }
  if (runs.size() == 1) {
    const exporter::RunInfo& run = runs.front();
    return "- Log: `" + run.log + "`, " + data_text(run.data_s) + "\n- Run: " + how_text(run) +
           "\n- Processing time: " + pace_text(run.data_s, run.wall_s) + "\n";
  }
  std::string text = "- Logs, of which each went on with what was there:\n";
  double data_s = 0.0;
  double wall_s = 0.0;
  bool all_known = true;
  for (const exporter::RunInfo& run : runs) {
    data_s += run.wall_s > 0.0 ? run.data_s : 0.0;
    wall_s += run.wall_s;
    all_known = all_known && run.wall_s > 0.0;
    text += "  - `" + run.log + "`";
    text += run.how.empty() ? ""
                            : ", " + data_text(run.data_s) + ": " + how_text(run) +
                                  "; processing time " + pace_text(run.data_s, run.wall_s);
    text += run.interrupted ? ", interrupted by the user\n" : "\n";
  }
  return text + "- Processing time in all: " + pace_text(data_s, wall_s) +
         (all_known ? "\n" : " (without the runs of which it is not known)\n");
}

}  // namespace

std::string print_run(const SessionData& data) {
  std::string text = "## What was run\n\n";
  if (data.interrupted()) {
    text += "**The run was interrupted by the user**; this is about what was done so far.\n\n";
  }
  text += print_runs(data.runs());
  if (std::filesystem::exists(data.path(file::kConfig))) {
    text +=
        std::string("- Effective configuration: [") + file::kConfig + "](" + file::kConfig + ")\n";
  }
  if (data.datum) {
    text += "- Datum (latitude, longitude, ellipsoidal height): " + data.datum->id() +
            (data.datum->elected_ns == 0
                 ? ", given by configuration\n"
                 : ", elected at " + exporter::stamp_text(data.datum->elected_ns) + "\n");
  }
  if (!data.lio.empty()) {
    text += "- Distance driven (lio.tum): " + fixed(length_of(data.lio, data.odom_begins()), 1) +
            " m\n";
  }
  return text;
}

std::string print_alignment(const SessionData& data) {
  std::string text = "## Alignment of odom to map\n\n";
  if (data.alignment) {
    const exporter::AlignmentRecord& record = *data.alignment;
    const Alignment& alignment = record.alignment;
    const auto sigma = [&](int i) { return std::sqrt(alignment.covariance(i, i)); };
    const std::string verdict = record.admitted       ? "Admitted"
                                : record.was_admitted ? "**Not admitted at the end**"
                                                      : "**Not admitted by the gate**";
    text += verdict + (record.comment.empty() ? "" : " (" + record.comment + ")") +
            ", odom epoch " + std::to_string(alignment.odom_epoch) + ": " +
            transform_text(alignment.T_map_odom) + ".\n\n" +
            (exporter::is_known(alignment)
                 ? "Its sigma: " + sigma_text(sigma(0), {sigma(1), sigma(2), sigma(3)}) + ".\n"
                 : "How good it is nobody knows.\n");
  } else {
    text += "No alignment was found: nothing in this session is georeferenced by fusion.\n";
  }
  const auto last = std::find_if(data.gate.rbegin(), data.gate.rend(), [](const auto& row) {
    return row.aligned && is_known_sigma_of(row);
  });
  if (last != data.gate.rend()) {
    text += (last == data.gate.rbegin()
                 ? "\nAt the end: "
                 : "\nIn force until " + exporter::stamp_text(last->stamp_ns) + ": ") +
            transform_text(last->T_map_odom) +
            ". Its sigma: " + sigma_text(last->yaw_sigma_rad, last->position_sigma_m) + ".\n";
  }
  return text;
}

std::string print_gate(const SessionData& data) {
  std::string text = "## What the gate did\n\n";
  if (data.gate.empty()) {
    return text + "No status of the gate was recorded.\n";
  }
  const auto& last = data.gate.back();
  const GateTotals totals = totals_of(data.gate);
  text += "Mode `" + last.mode + "`. Fixes seen " + std::to_string(totals.fixes_seen) + ", used " +
          std::to_string(totals.fixes_used) + ".\n\n";
  Table verdicts({"verdict", "fixes"});
  for (const auto& [name, count] : totals.verdicts) {
    verdicts.add({name, std::to_string(count)});
  }
  if (!verdicts.is_empty()) {
    text += verdicts.str() + "\n";
  }
  text += "Share of time by source, per axis:\n\n" + axis_table(data);
  if (!data.fused.empty() && nobody_chosen(data.gate)) {
    text += "\n" + std::string(file::kFused) + " holds " + std::to_string(data.fused.size()) +
            " poses although no status names a source for longer than a moment.\n";
  }
  return text;
}

std::string print_times(const SessionData& data) {
  std::string text = "## Times per scan\n\n";
  std::vector<double> times_ms;
  double sum_ms = 0.0;
  for (const auto& scan : data.scans) {
    if (std::isfinite(scan.status.scan_ms)) {
      times_ms.push_back(scan.status.scan_ms);
      sum_ms += scan.status.scan_ms;
    }
  }
  if (times_ms.empty()) {
    return text + "No scan was recorded.\n";
  }
  std::sort(times_ms.begin(), times_ms.end());
  Table table({"scans", "median ms", "p99 ms", "max ms", "mapper alone, times real time"});
  const Breaks begins = data.run_begins();
  double span_s = 0.0;
  for (std::size_t i = 1; i < data.scans.size(); ++i) {
    const Nanoseconds before_ns = data.scans[i - 1].status.stamp_ns;
    const Nanoseconds stamp_ns = data.scans[i].status.stamp_ns;
    span_s += is_between(begins, before_ns, stamp_ns) ? 0.0 : to_seconds(stamp_ns - before_ns);
  }
  table.add({std::to_string(times_ms.size()),
             fixed(percentile(times_ms, 0.5), 2),
             fixed(percentile(times_ms, 0.99), 2),
             fixed(times_ms.back(), 2),
             fixed(span_s / (sum_ms * 1e-3), 1)});
  return text + table.str();
}

std::string print_map(const SessionData& data, const SessionMap& map) {
  std::string text = "## Map\n\n";
  const auto pcd = data.path(file::kMap);
  std::error_code error;
  const auto bytes = std::filesystem::file_size(pcd, error);
  if (error) {
    return text + "There is no " + std::string(file::kMap) + ".\n";
  }
  return text + "[" + file::kMap + "](" + file::kMap + "): " + points_of(pcd) + " points, " +
         fixed(static_cast<double>(bytes) * 1e-6, 1) + " MB. " + place_of_map(data, map) + "\n\n" +
         thickness_text(map);
}

}  // namespace trigpoint::evaluation
