// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "finish_session.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/evaluation/report.hpp"
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/export/map.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include "progress.hpp"

#include <filesystem>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>

namespace trigpoint::cli {

namespace {

namespace fs = std::filesystem;
namespace file = exporter::session_file;
using exporter::path_in;

constexpr double kMapVoxel_m = 0.1;

std::optional<Alignment> alignment_of(const std::string& session) {
  const std::string path = path_in(session, file::kAlignment);
  if (!fs::exists(path)) {
    return std::nullopt;
  }
  return exporter::read_alignment(path).alignment;
}

void tell(const lio_mapper::PoseGraphReport& past) {
  std::cerr << "pose graph: " << past.keyframes << " keyframes, " << past.rows << " GPS rows ("
            << past.rows_doubted << " doubted), " << past.loops << " loop closures";
  for (const NamedCount& refused : past.loops_refused) {
    std::cerr << ", " << refused.count << " refused as " << refused.name;
  }
  std::cerr << "; largest correction " << past.largest_correction_m << " m"
            << (past.converged || past.keyframes == 0 ? "" : "; did not converge") << "\n";
}

/// A file that is damaged costs the correction, not the map.
void correct(const std::string& session) {
  std::optional<lio_mapper::PoseGraphReport> past;
  std::string failure;
  try {
    Progress progress("correcting the past");
    past = exporter::correct_session(session, [&](double share) { progress(share); });
  } catch (const std::runtime_error& error) {
    failure = error.what();
  }
  if (past) {
    tell(*past);
  } else {
    std::cerr << "the past is not corrected: " << failure << "\n";
  }
}

void render_map(const std::string& session) {
  const std::string keyframes = path_in(session, file::kKeyframes);
  if (!fs::exists(keyframes)) {
    std::cerr << "no keyframes in " << session << ": no map\n";
    return;
  }
  correct(session);
  const std::optional<exporter::CorrectedPoses> corrected = exporter::read_corrected(session);
  Progress progress("rendering the map");
  const exporter::MapReport map =
      exporter::render_map(keyframes,
                           alignment_of(session),
                           kMapVoxel_m,
                           path_in(session, file::kMap),
                           [&](double share) { progress(share); },
                           {corrected ? &*corrected : nullptr,
                            true,
                            exporter::past_settings_of(session).lidar_position_base_m});
  std::cerr << "map: " << map.points_moving << " of " << map.points_read
            << " points are of moving objects and left out\n";
  const lio_mapper::CloudSizes stored = lio_mapper::KeyframeReader(keyframes).cloud_sizes();
  std::cerr << "keyframes: " << stored.keyframes << ", " << stored.points << " points in "
            << static_cast<double>(stored.bytes) * 1e-6 << " MB, " << stored.ratio()
            << " of what float32 would take\n";
  if (!map.remark.empty()) {
    std::cerr << "map: " << map.remark << "\n";
  }
}

}  // namespace

void refuse_other_folder(const std::string& folder) {
  try {
    evaluation::check_is_session(folder);
  } catch (const std::runtime_error& error) {
    throw ConfigError(error.what());
  }
}

int finish_session(const std::string& session) {
  evaluation::check_is_session(session);  // before anything is written into the folder
  evaluation::ReportOptions options;
  try {
    render_map(session);
  } catch (const std::runtime_error& error) {  // what was driven is reported all the same
    options.failures.push_back(std::string("The map was not rendered: ") + error.what() + ".");
    std::cerr << "trigpoint report: " << options.failures.back() << "\n";
  }
  const evaluation::ReportResult report = evaluation::write_report(session, options);
  std::cout << report.text << "\n" << report.report_file << "\n";
  if (!report.page_file.empty()) {
    std::cout << report.page_file << "\n";
  }
  for (const std::string& picture : report.pictures) {
    std::cout << picture << "\n";
  }
  for (const std::string& problem : report.problems) {
    std::cerr << "trigpoint report: " << problem << "\n";
  }
  for (std::size_t i = options.failures.size(); i < report.failures.size(); ++i) {
    std::cerr << "trigpoint report: " << report.failures[i] << "\n";
  }
  return report.complete && report.failures.empty() ? 0 : 1;
}

}  // namespace trigpoint::cli
