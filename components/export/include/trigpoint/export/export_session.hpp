// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A session's results in other programs' formats: the verb `trigpoint export`. Library
// trigpoint::export_formats.
#pragma once

#include "trigpoint/export/map.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace trigpoint::exporter {

struct ExportOptions {
  /// Names of export_formats(); none: all.
  std::vector<std::string> formats;
  double voxel_m{0.1};  ///< of the points, when the session holds keyframes
  double tile_m{0.0};   ///< edge of the squares that the points are split into; 0: one file
  double cell_m{0.25};  ///< of top view and height; larger when these would have over 16 M cells
};

struct ExportFormat {
  std::string name;
  std::string content;  ///< a sentence, with the names of its files
  bool needs_datum{false};
};

const std::vector<ExportFormat>& export_formats();

struct ExportedFile {
  std::string file;
  std::string content;  ///< e.g. "1234 poses" or "map, 500000 points"
  std::string format;   ///< empty of what comes along: datum.yaml
};

struct ExportReport {
  std::vector<ExportedFile> written;
  std::vector<std::string> missing;          ///< a sentence for each thing that is not there
  std::vector<std::string> formats_missing;  ///< of those asked for, that nothing was written in
  MapReport map;                             ///< of the points, when they were rendered
};

/// Writes into `out_folder`. Points are rendered from the keyframes (or taken from map.pcd when
/// only the finished map is there), trajectories are read strictly. What needs a place on the Earth
/// goes through geodesy::MapOnEarth; without datum.yaml, or where the map is in odom, that is left
/// out and told. Throws ConfigError, before anything is written, when the session is no folder, a
/// format is not known (naming those that are), the options cannot be, or a file that would be
/// written is there already; std::runtime_error when a file is damaged or nothing at all could be
/// written.
ExportReport export_session(const std::string& session_folder,
                            const std::string& out_folder,
                            const ExportOptions& options = {},
                            const std::function<void(double)>& progress = {});

}  // namespace trigpoint::exporter
