// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A session's results in other programs' formats: the verb `trigpoint export`. Library
// trigpoint::export_map.
#pragma once

#include "trigpoint/export/map.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace trigpoint::exporter {

struct ExportOptions {
  std::vector<std::string> formats{"pcd", "tum"};
  double voxel_m{0.1};  ///< of the PCD when the session holds keyframes
};

struct ExportedFile {
  std::string file;
  std::string content;  ///< e.g. "1234 poses" or "map, 500000 points"
};

struct ExportReport {
  std::vector<ExportedFile> written;
  std::vector<std::string> missing;  ///< a sentence for each thing the session does not hold
  MapReport map;                     ///< of the PCD, when it was rendered
};

/// Writes into `out_folder`: for pcd map.pcd, rendered from the keyframes (or copied when only the
/// finished map is there); for tum every trajectory, after it was read strictly. Throws
/// std::runtime_error when the session is no folder, a format is not known (naming those that are),
/// a file is damaged, or nothing at all could be written.
ExportReport export_session(const std::string& session_folder,
                            const std::string& out_folder,
                            const ExportOptions& options = {},
                            const std::function<void(double)>& progress = {});

}  // namespace trigpoint::exporter
