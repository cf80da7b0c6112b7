// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/export/export_session.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/shell/stop_signal.hpp"

#include "interruption.hpp"
#include "number_checks.hpp"
#include "progress.hpp"
#include "verbs.hpp"

#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

namespace trigpoint::cli {

namespace {

struct ExportVerbOptions {
  std::string session;
  std::string out;
  exporter::ExportOptions what;
};

/// A simulated drive has a truth.tum as well, but nothing that was estimated.
void require_session(const std::string& folder) {
  namespace file = exporter::session_file;
  for (const char* name : {file::kKeyframes, file::kMap, file::kFused, file::kLio, file::kGps}) {
    if (std::filesystem::exists(std::filesystem::path(folder) / name)) {
      return;
    }
  }
  throw ConfigError(folder +
                    ": is no session folder (none of keyframes.sqlite, map.pcd, fused.tum, "
                    "lio.tum, gps.tum is in it); trigpoint map and bringup/run leave one");
}

/// What was asked for by name and could not be written is a failure; what "all" cannot do is not.
int run(const ExportVerbOptions& options) {
  require_session(options.session);
  const std::string out = options.out.empty()
                              ? (std::filesystem::path(options.session) / "export").string()
                              : options.out;
  exporter::ExportReport report;
  try {
    const shell::StopSignal stop;
    Progress progress("exporting");
    report = exporter::export_session(options.session, out, options.what, [&](double share) {
      if (stop.requested()) {
        throw Interrupted();
      }
      progress(share);
    });
  } catch (const Interrupted&) {
    std::cerr << "trigpoint export: interrupted; what is in " << out << " is whole\n";
    return kInterrupted;
  }
  for (const exporter::ExportedFile& file : report.written) {
    std::cout << file.file << "  " << file.content << "\n";
  }
  for (const std::string& sentence : report.missing) {
    std::cerr << sentence << "\n";
  }
  return options.what.formats.empty() || report.formats_missing.empty() ? 0 : 1;
}

std::vector<std::string> names_of_formats() {
  std::vector<std::string> names;
  for (const exporter::ExportFormat& format : exporter::export_formats()) {
    names.push_back(format.name);
  }
  return names;
}

std::string help_of_formats() {
  std::string text = "Formats:\n";
  for (const exporter::ExportFormat& format : exporter::export_formats()) {
    text += "  " + format.name + std::string(9 - format.name.size(), ' ') + format.content + "\n";
  }
  return text +
         "LAS, GeoJSON, GPX, KML, KMZ and GeoTIFF need the session's datum.yaml. Heights are above "
         "the WGS 84 ellipsoid.";
}

}  // namespace

void add_export(CLI::App& app, Chosen& chosen) {
  CLI::App* verb =
      app.add_subcommand("export", "Write a session's map and trajectories for other programs");
  const auto options = std::make_shared<ExportVerbOptions>();
  verb->add_option("SESSION", options->session, "session folder")
      ->required()
      ->check(CLI::ExistingDirectory);
  verb->add_option(
      "--out",
      options->out,
      "folder, created when missing (default SESSION/export); what it holds already is "
      "never written over");
  verb->add_option("--format", options->what.formats, "see below; may be repeated (default all)")
      ->check(CLI::IsMember(names_of_formats()));
  verb->add_option("--voxel", options->what.voxel_m, "cell size of the point cloud, m")
      ->capture_default_str()
      ->check(more_than_zero());
  verb->add_option("--tile",
                   options->what.tile_m,
                   "split the point clouds into squares of this edge, m (default: whole)")
      ->check(more_than_zero());
  verb->add_option("--cell",
                   options->what.cell_m,
                   "cell size of top view and height, m; larger on a map of over 16 million cells")
      ->capture_default_str()
      ->check(more_than_zero());
  verb->footer(help_of_formats());
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
