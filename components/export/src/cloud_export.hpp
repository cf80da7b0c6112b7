// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The map's points to all files that hold points or a view of them, in one reading.
#pragma once

#include "trigpoint/export/export_session.hpp"
#include "trigpoint/geodesy/map_on_earth.hpp"

#include "cloud_file.hpp"
#include "top_view.hpp"

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::exporter {

/// What a first reading of the map tells.
struct CloudSurvey {
  std::uint64_t points{0};
  float highest_intensity{0.0F};
  bool on_earth{false};  ///< what follows is known
  Eigen::Vector3d lowest_utm_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d highest_utm_m{Eigen::Vector3d::Zero()};
  Eigen::Vector2d lowest_deg{Eigen::Vector2d::Zero()};  ///< longitude, latitude
  Eigen::Vector2d highest_deg{Eigen::Vector2d::Zero()};
};

struct CloudExport {
  std::string pcd_file;                       ///< the map, read twice
  std::string frame;                          ///< of it
  const geodesy::MapOnEarth* earth{nullptr};  ///< not owned; null: files in `frame` only
  std::string out_folder;
  std::vector<std::string> formats;  ///< pcd (tiles of it), ply, las, geotiff, kml, kmz
  double tile_m{0.0};                ///< 0: whole
  double cell_m{0.25};               ///< of the top view

  bool wants(const std::string& format) const;
};

struct CloudExportResult {
  std::vector<ExportedFile> written;
  /// In longitude and latitude, for KML; when it was asked for and there is a point.
  std::optional<TopView> overlay;
};

CloudSurvey survey(const CloudExport& job, const std::function<void(double)>& progress);

CloudExportResult export_cloud(const CloudExport& job, const std::function<void(double)>& progress);

}  // namespace trigpoint::exporter
