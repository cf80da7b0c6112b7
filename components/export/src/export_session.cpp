// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/export_session.hpp"

#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/export/session.hpp"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

namespace fs = std::filesystem;

/// truth.tum alone is no result: it comes with a log.
void check_for_results(const std::string& session) {
  for (const char* name : {session_file::kKeyframes,
                           session_file::kMap,
                           session_file::kFused,
                           session_file::kFusedSmoothed,
                           session_file::kLio,
                           session_file::kGps}) {
    if (fs::exists(path_in(session, name))) {
      return;
    }
  }
  throw std::runtime_error(
      session +
      ": nothing to export: it holds neither keyframes.sqlite, map.pcd, fused.tum, "
      "lio.tum nor gps.tum" +
      (fs::exists(path_in(session, session_file::kTruth))
           ? "; a simulated drive becomes a session by `trigpoint map`"
           : ""));
}

void check(const std::string& session_folder,
           const std::string& out_folder,
           const ExportOptions& options) {
  if (!fs::is_directory(session_folder)) {
    throw std::runtime_error(session_folder + ": is not a session folder");
  }
  for (const auto& format : options.formats) {
    if (format != "pcd" && format != "tum") {
      throw std::runtime_error("unknown format '" + format + "', there are: pcd, tum");
    }
  }
  if (fs::exists(out_folder) && fs::equivalent(session_folder, out_folder)) {
    throw std::runtime_error(out_folder + ": is the session itself, choose another folder");
  }
  check_for_results(session_folder);
  create_session_folder(out_folder);
}

void export_pcd(const std::string& session,
                const std::string& out,
                double voxel_m,
                const std::function<void(double)>& progress,
                ExportReport& report) {
  const auto target = path_in(out, session_file::kMap);
  const auto keyframes = path_in(session, session_file::kKeyframes);
  const auto alignment = path_in(session, session_file::kAlignment);
  if (fs::exists(keyframes)) {
    std::optional<Alignment> fallback;
    if (fs::exists(alignment)) {
      fallback = read_alignment(alignment).alignment;
    }
    const std::optional<CorrectedPoses> corrected = read_corrected(session);
    report.map = render_map(keyframes,
                            fallback,
                            voxel_m,
                            target,
                            progress,
                            {corrected ? &*corrected : nullptr,
                             corrected.has_value(),
                             past_settings_of(session).lidar_position_base_m});
    report.written.push_back({target,
                              "frame " + report.map.frame + ", " +
                                  std::to_string(report.map.points_written) + " points"});
  } else if (fs::exists(path_in(session, session_file::kMap))) {
    copy_file(path_in(session, session_file::kMap), target);
    const std::string frame = frame_of_pcd(target);
    report.written.push_back({target,
                              (frame.empty() ? "" : "frame " + frame + ", ") +
                                  "copied: the session holds no keyframes"});
  } else {
    report.missing.push_back("no map: the session holds neither keyframes.sqlite nor map.pcd");
  }
}

void export_tum(const std::string& session, const std::string& out, ExportReport& report) {
  for (const char* name : {session_file::kFused,
                           session_file::kFusedSmoothed,
                           session_file::kLio,
                           session_file::kGps,
                           session_file::kTruth}) {
    const auto source = path_in(session, name);
    if (!fs::exists(source)) {
      report.missing.push_back(std::string("no ") + name + " in the session");
      continue;
    }
    const auto poses = read_trajectory(source).size();
    copy_file(source, path_in(out, name));
    report.written.push_back({path_in(out, name), std::to_string(poses) + " poses"});
  }
}

}  // namespace

ExportReport export_session(const std::string& session_folder,
                            const std::string& out_folder,
                            const ExportOptions& options,
                            const std::function<void(double)>& progress) {
  check(session_folder, out_folder, options);
  ExportReport report;
  for (const auto& format : options.formats) {
    if (format == "pcd") {
      export_pcd(session_folder, out_folder, options.voxel_m, progress, report);
    } else {
      export_tum(session_folder, out_folder, report);
    }
  }
  if (report.written.empty()) {
    std::string reasons;
    for (const auto& sentence : report.missing) {
      reasons += (reasons.empty() ? "" : "; ") + sentence;
    }
    throw std::runtime_error(session_folder + ": nothing to export: " + reasons);
  }
  const auto datum = path_in(session_folder, session_file::kDatum);
  if (fs::exists(datum)) {
    copy_file(datum, path_in(out_folder, session_file::kDatum));
    report.written.push_back({path_in(out_folder, session_file::kDatum), "origin of map"});
  }
  return report;
}

}  // namespace trigpoint::exporter
