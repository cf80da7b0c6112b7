// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/export/export_session.hpp"
#include "trigpoint/export/session.hpp"

#include "number_checks.hpp"
#include "progress.hpp"
#include "verbs.hpp"

#include <filesystem>
#include <iostream>
#include <memory>

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

int run(const ExportVerbOptions& options) {
  require_session(options.session);
  exporter::ExportReport report;
  {
    Progress progress("exporting");
    report = exporter::export_session(
        options.session, options.out, options.what, [&](double share) { progress(share); });
  }
  for (const exporter::ExportedFile& file : report.written) {
    std::cout << file.file << "  " << file.content << "\n";
  }
  for (const std::string& sentence : report.missing) {
    std::cerr << sentence << "\n";
  }
  return 0;
}

}  // namespace

void add_export(CLI::App& app, Chosen& chosen) {
  CLI::App* verb =
      app.add_subcommand("export", "Write a session's map and trajectories for other programs");
  const auto options = std::make_shared<ExportVerbOptions>();
  verb->add_option("SESSION", options->session, "session folder")
      ->required()
      ->check(CLI::ExistingDirectory);
  verb->add_option("--out", options->out, "folder, created when missing")->required();
  verb->add_option("--format", options->what.formats, "pcd, tum; may be repeated (default both)")
      ->check(CLI::IsMember({"pcd", "tum"}));
  verb->add_option("--voxel", options->what.voxel_m, "cell size of the point cloud, m")
      ->capture_default_str()
      ->check(more_than_zero());
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
