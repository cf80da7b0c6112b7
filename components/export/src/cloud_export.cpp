// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "cloud_export.hpp"

#include "trigpoint/export/map.hpp"
#include "trigpoint/export/session.hpp"

#include "geo_files.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>

namespace trigpoint::exporter {

namespace {

/// LAS asks for the whole range of 16 bits; which of these a LiDAR fills depends on its driver.
double intensity_factor_of(float highest) {
  constexpr double kMost = 65535.0;
  for (const double range : {1.0, 255.0, kMost}) {
    if (highest <= range) {
      return kMost / range;
    }
  }
  return kMost / highest;
}

/// The cloud files that are open, each with the coordinates that it takes.
class CloudOutputs {
 public:
  CloudOutputs(const CloudExport& job, const CloudSurvey& survey) : job_(job), survey_(survey) {
    if (job.tile_m > 0.0) {
      add("pcd", false, [this](const std::string& file) { return open_pcd(file, job_.frame); });
    }
    add("ply", on_earth(), [this](const std::string& file) { return open_ply(file, comments()); });
    if (on_earth()) {
      add("las", true, [this](const std::string& file) { return open_las(file, las()); });
    }
  }

  /// Folders of tiles that were not finished are empty by then, and go too.
  ~CloudOutputs() {
    for (Output& output : outputs_) {
      output.cloud.reset();
      if (output.tiles != nullptr) {
        std::error_code not_empty;
        std::filesystem::remove(output.path, not_empty);
      }
    }
  }

  CloudOutputs(const CloudOutputs&) = delete;
  CloudOutputs& operator=(const CloudOutputs&) = delete;

  bool wants_utm() const {
    return std::any_of(outputs_.begin(), outputs_.end(), [](const auto& o) { return o.in_utm; });
  }

  void append(const std::vector<FilePoint>& in_frame, const std::vector<FilePoint>& in_utm) {
    for (Output& output : outputs_) {
      output.cloud->append(output.in_utm ? in_utm : in_frame);
    }
  }

  std::vector<ExportedFile> finish() {
    std::vector<ExportedFile> written;
    for (Output& output : outputs_) {
      std::string content = std::to_string(output.cloud->finish()) + " points, " +
                            (output.in_utm ? "EPSG:" + std::to_string(epsg_of(job_.earth->zone())) +
                                                 " and height above the ellipsoid"
                                           : "frame " + job_.frame);
      if (output.tiles != nullptr) {
        content += ", in " + std::to_string(output.tiles->tiles()) + " tiles";
      }
      written.push_back({output.path, content, output.format});
    }
    return written;
  }

 private:
  using OpenFile = std::function<std::unique_ptr<CloudFile>(const std::string& file)>;

  struct Output {
    std::string format;
    std::string path;
    bool in_utm{false};
    std::unique_ptr<CloudFile> cloud;
    const CloudTiles* tiles{nullptr};  ///< `cloud` when it is in tiles
  };

  bool on_earth() const { return survey_.on_earth; }

  void add(const std::string& format, bool in_utm, const OpenFile& open) {
    if (!job_.wants(format)) {
      return;
    }
    Output output;
    output.format = format;
    output.in_utm = in_utm;
    if (job_.tile_m > 0.0) {
      output.path = path_in(job_.out_folder, "map_" + format);
      std::filesystem::create_directory(output.path);
      auto tiles = std::make_unique<CloudTiles>(
          job_.tile_m, [folder = output.path, format, open](const std::string& corner) {
            return open(path_in(folder, "map_" + corner + "." + format));
          });
      output.tiles = tiles.get();
      output.cloud = std::move(tiles);
    } else {
      output.path = path_in(job_.out_folder, "map." + format);
      output.cloud = open(output.path);
    }
    outputs_.push_back(std::move(output));
  }

  std::vector<std::string> comments() const {
    if (!on_earth()) {
      return {"frame " + job_.frame};
    }
    return {"EPSG:" + std::to_string(epsg_of(job_.earth->zone())) +
            ", z is the height above the WGS 84 ellipsoid, m"};
  }

  LasSettings las() const {
    return {wkt_with_height_of(job_.earth->zone()),
            survey_.lowest_utm_m.array().floor(),
            intensity_factor_of(survey_.highest_intensity)};
  }

  const CloudExport& job_;
  const CloudSurvey& survey_;
  std::vector<Output> outputs_;
};

/// Longitudes go on beyond 180 degrees, as seen from the datum, so that a map on the antimeridian
/// stays in one piece.
Eigen::Vector2d lon_lat(const geodesy::MapOnEarth& earth, const geodesy::Geographic& place) {
  const double datum_deg = earth.datum().longitude_deg;
  return {datum_deg + std::remainder(place.longitude_deg - datum_deg, 360.0), place.latitude_deg};
}

/// Cells of about `cell_m` along both axes at this latitude.
Eigen::Vector2d cell_in_degrees(double cell_m, double latitude_deg) {
  constexpr double kMetresPerDegree = 111'320.0;
  const double cosine = std::cos(latitude_deg * std::numbers::pi / 180.0);
  return {cell_m / (kMetresPerDegree * std::max(cosine, 0.01)), cell_m / kMetresPerDegree};
}

struct Views {
  std::optional<TopView> utm;
  std::optional<TopView> degrees;
};

Views views_of(const CloudExport& job, const CloudSurvey& survey) {
  Views views;
  if (!survey.on_earth || survey.points == 0) {
    return views;
  }
  if (job.wants("geotiff")) {
    views.utm.emplace(grid_over(survey.lowest_utm_m.head<2>(),
                                survey.highest_utm_m.head<2>(),
                                Eigen::Vector2d::Constant(job.cell_m)));
  }
  if (job.wants("kml") || job.wants("kmz")) {
    const Eigen::Vector2d cell = cell_in_degrees(job.cell_m, survey.lowest_deg.y());
    views.degrees.emplace(grid_over(survey.lowest_deg, survey.highest_deg, cell));
  }
  return views;
}

void write_tiffs(const CloudExport& job, const TopView& view, std::vector<ExportedFile>& written) {
  const std::string wkt = wkt_of(job.earth->zone());
  const Grid& grid = view.grid();
  const std::string content = std::to_string(grid.columns) + " x " + std::to_string(grid.rows) +
                              " cells of " + std::to_string(grid.cell.x()) +
                              " m, EPSG:" + std::to_string(epsg_of(job.earth->zone()));
  const std::string picture = path_in(job.out_folder, "top_view.tif");
  write_picture_tiff(picture, view, wkt);
  written.push_back({picture, content, "geotiff"});
  const std::string height = path_in(job.out_folder, "height.tif");
  write_height_tiff(height, view, wkt);
  written.push_back({height, content + ", highest point above the ellipsoid", "geotiff"});
}

/// A point of the map on the Earth.
struct Place {
  geodesy::Geographic geographic;
  Eigen::Vector3d utm_m;
};

/// Throws when a point of the map has no place in UTM although the datum has.
Place place_of(const geodesy::MapOnEarth& earth, const Eigen::Vector3d& p_map_m) {
  const geodesy::Geographic geographic = earth.geographic(p_map_m);
  const auto utm_m = earth.utm(geographic);
  if (!utm_m) {
    throw std::runtime_error("a point of the map, " + std::to_string(p_map_m.norm() / 1000.0) +
                             " km from the datum, has no place in the datum's UTM zone");
  }
  return {geographic, *utm_m};
}

}  // namespace

bool CloudExport::wants(const std::string& format) const {
  return std::find(formats.begin(), formats.end(), format) != formats.end();
}

CloudSurvey survey(const CloudExport& job, const std::function<void(double)>& progress) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  CloudSurvey result;
  result.on_earth = job.earth != nullptr;
  result.lowest_utm_m.setConstant(kInfinity);
  result.highest_utm_m.setConstant(-kInfinity);
  result.lowest_deg.setConstant(kInfinity);
  result.highest_deg.setConstant(-kInfinity);
  visit_pcd(job.pcd_file, [&](const PointCloud& points, double share) {
    result.points += points.size();
    for (const PointXyzi& point : points) {
      result.highest_intensity = std::max(result.highest_intensity, point.intensity);
      if (job.earth == nullptr) {
        continue;
      }
      const Place place = place_of(*job.earth, point.position().cast<double>());
      const Eigen::Vector3d& utm_m = place.utm_m;
      const Eigen::Vector2d place_deg = lon_lat(*job.earth, place.geographic);
      result.lowest_utm_m = result.lowest_utm_m.cwiseMin(utm_m);
      result.highest_utm_m = result.highest_utm_m.cwiseMax(utm_m);
      result.lowest_deg = result.lowest_deg.cwiseMin(place_deg);
      result.highest_deg = result.highest_deg.cwiseMax(place_deg);
    }
    progress(share);
  });
  return result;
}

CloudExportResult export_cloud(const CloudExport& job,
                               const std::function<void(double)>& progress) {
  const CloudSurvey surveyed = survey(job, [&](double share) { progress(0.4 * share); });
  CloudOutputs outputs(job, surveyed);
  Views views = views_of(job, surveyed);
  const bool wants_earth = outputs.wants_utm() || views.utm || views.degrees;
  std::vector<FilePoint> in_frame;
  std::vector<FilePoint> in_utm;
  visit_pcd(job.pcd_file, [&](const PointCloud& points, double share) {
    in_frame.clear();
    in_utm.clear();
    for (const PointXyzi& point : points) {
      in_frame.push_back({point.position().cast<double>(), point.intensity});
      if (!wants_earth) {
        continue;
      }
      const Place place = place_of(*job.earth, in_frame.back().position_m);
      in_utm.push_back({place.utm_m, point.intensity});
      if (views.utm) {
        views.utm->add(place.utm_m.head<2>(), place.utm_m.z());
      }
      if (views.degrees) {
        views.degrees->add(lon_lat(*job.earth, place.geographic), place.geographic.height_m);
      }
    }
    outputs.append(in_frame, in_utm);
    progress(0.4 + 0.5 * share);
  });
  CloudExportResult result;
  result.written = outputs.finish();
  if (views.utm) {
    write_tiffs(job, *views.utm, result.written);
  }
  result.overlay = std::move(views.degrees);
  progress(1.0);
  return result;
}

}  // namespace trigpoint::exporter
