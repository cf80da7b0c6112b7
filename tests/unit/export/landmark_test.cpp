// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One landmark, which is a point of the map and a pose of the trajectory, has the same coordinates
// in every file. What they must be is worked out apart from the code under test: the ellipsoid's
// equations from map to Earth-centred coordinates, PROJ from there; files are read by GDAL, PCL,
// and LAS by the offsets that its specification prints.
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/export/export_session.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include "scratch_folder.hpp"
#include <gdal_priv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>
#include <ogrsf_frmts.h>
#include <pcl/PCLPointCloud2.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <numbers>
#include <sstream>
#include <vector>

namespace trigpoint::exporter {
namespace {

using test::read_all;
using test::ScratchFolder;

constexpr Nanoseconds kStamp_ns = 1'700'000'000'250'000'000;
const Eigen::Vector3d kLandmark_map_m{1234.5, -876.25, 42.125};
const Eigen::Vector3d kOther_map_m{1194.5, -886.25, 40.125};

constexpr double kMicrometre = 1e-6;
/// PROJ's and GeographicLib's series, and 1e-6 m of TUM files.
constexpr double kSeries_m = 2e-5;
constexpr double kLasStep_m = 0.5e-3 + kSeries_m;
/// GeoJSON and KML have 1e-9 degree.
constexpr double kNinthDecimal_deg = 1e-9;
constexpr double kHeight_m = 1e-4 + kSeries_m;

/// Geodetic to Earth-centred on WGS 84, and east, north, up at the place (EPSG guidance note 7-2,
/// 4.1.1 and 4.1.2).
Eigen::Vector3d geocentric_of(const Datum& datum, const Eigen::Vector3d& p_map_m) {
  constexpr double kA = 6378137.0;
  constexpr double kF = 1.0 / 298.257223563;
  constexpr double kE2 = kF * (2.0 - kF);
  constexpr double kRadians = std::numbers::pi / 180.0;
  const double s = std::sin(datum.latitude_deg * kRadians);
  const double c = std::cos(datum.latitude_deg * kRadians);
  const double sl = std::sin(datum.longitude_deg * kRadians);
  const double cl = std::cos(datum.longitude_deg * kRadians);
  const double n = kA / std::sqrt(1.0 - kE2 * s * s);
  const Eigen::Vector3d origin((n + datum.height_m) * c * cl,
                               (n + datum.height_m) * c * sl,
                               (n * (1.0 - kE2) + datum.height_m) * s);
  return origin + p_map_m.x() * Eigen::Vector3d(-sl, cl, 0.0) +
         p_map_m.y() * Eigen::Vector3d(-s * cl, -s * sl, c) +
         p_map_m.z() * Eigen::Vector3d(c * cl, c * sl, s);
}

Eigen::Vector3d transformed(int from_epsg, int to_epsg, const Eigen::Vector3d& p) {
  OGRSpatialReference from;
  OGRSpatialReference to;
  from.importFromEPSG(from_epsg);
  to.importFromEPSG(to_epsg);
  from.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  to.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  const std::unique_ptr<OGRCoordinateTransformation> transformation(
      OGRCreateCoordinateTransformation(&from, &to));
  Eigen::Vector3d q = p;
  EXPECT_TRUE(transformation->Transform(1, &q.x(), &q.y(), &q.z()));
  return q;
}

struct Place {
  const char* name;
  Datum datum;
  int utm_epsg;
};

class Landmark : public testing::TestWithParam<Place> {
 protected:
  Landmark() {
    GDALAllRegister();
    CPLSetConfigOption("GPX_ELE_AS_25D", "YES");
    const Datum& datum = GetParam().datum;
    constexpr int kGeographic3d = 4979;
    constexpr int kGeocentric = 4978;
    lon_lat_h_ = transformed(kGeocentric, kGeographic3d, geocentric_of(datum, kLandmark_map_m));
    utm_ = transformed(kGeographic3d, GetParam().utm_epsg, lon_lat_h_);
    utm_.z() = lon_lat_h_.z();
    write_session();
    ExportOptions options;
    options.formats = {
        "pcd", "ply", "las", "kitti", "csv", "geojson", "gpx", "kml", "kmz", "geotiff"};
    export_session(folder_.file("session"), folder_.file("out"), options);
  }

  void write_session() const {
    const std::string session = folder_.file("session");
    create_session_folder(session);
    write_datum(path_in(session, session_file::kDatum), GetParam().datum);
    AlignmentRecord record;
    record.admitted = true;
    write_alignment(path_in(session, session_file::kAlignment), record);
    TrajectoryWriter fused(path_in(session, session_file::kFused), "base_link in map");
    fused.append(kStamp_ns - 1'000'000'000, Pose{});
    fused.append(kStamp_ns, Pose(Eigen::Quaterniond::Identity(), kLandmark_map_m));
    lio_mapper::KeyframeWriter writer(path_in(session, session_file::kKeyframes));
    lio_mapper::Keyframe keyframe;
    keyframe.stamp_ns = kStamp_ns;
    // The other point makes bounds and pictures that are not square; it is first in every file.
    for (const Eigen::Vector3d& p_map_m : {kOther_map_m, kLandmark_map_m}) {
      const Eigen::Vector3f p = p_map_m.cast<float>();
      keyframe.points_base.push_back({p.x(), p.y(), p.z(), 100.0F});
    }
    writer.append(keyframe);
  }

  std::string out(const std::string& name) const { return folder_.file("out/" + name); }

  /// Degrees as metres, so that one tolerance holds for both.
  void expect_at(const Eigen::Vector3d& lon_lat_h, const std::string& what) const {
    EXPECT_NEAR(lon_lat_h.x(), lon_lat_h_.x(), kNinthDecimal_deg) << what;
    EXPECT_NEAR(lon_lat_h.y(), lon_lat_h_.y(), kNinthDecimal_deg) << what;
    EXPECT_NEAR(lon_lat_h.z(), lon_lat_h_.z(), kHeight_m) << what;
  }

  /// The last vertex of the only line of a vector file.
  Eigen::Vector3d last_vertex(const std::string& file, const char* layer_name) const {
    const std::unique_ptr<GDALDataset> dataset(GDALDataset::Open(file.c_str(), GDAL_OF_VECTOR));
    EXPECT_TRUE(dataset) << file;
    OGRLayer* layer =
        layer_name == nullptr ? dataset->GetLayer(0) : dataset->GetLayerByName(layer_name);
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
    for (const auto& feature : *layer) {
      const OGRGeometry* geometry = feature->GetGeometryRef();
      OGRPoint point;
      if (wkbFlatten(geometry->getGeometryType()) == wkbPoint) {
        point = *geometry->toPoint();
      } else {
        geometry->toLineString()->EndPoint(&point);
      }
      last = {point.getX(), point.getY(), point.getZ()};
    }
    return last;
  }

  ScratchFolder folder_;
  Eigen::Vector3d lon_lat_h_;
  Eigen::Vector3d utm_;
};

double double_at(const std::string& bytes, std::size_t offset) {
  double value = 0.0;
  std::memcpy(&value, bytes.data() + offset, sizeof(value));
  return value;
}

template <typename Integer>
Integer integer_at(const std::string& bytes, std::size_t offset) {
  Integer value = 0;
  std::memcpy(&value, bytes.data() + offset, sizeof(value));
  return value;
}

TEST_P(Landmark, is_in_the_pcd_at_its_place_in_map) {
  pcl::PCLPointCloud2 cloud;
  ASSERT_EQ(pcl::PCDReader().read(out("map.pcd"), cloud), 0);
  ASSERT_EQ(cloud.width, 2U);
  float xyz[3];
  std::memcpy(xyz, cloud.data.data() + cloud.point_step, sizeof(xyz));
  EXPECT_EQ(Eigen::Vector3f(xyz[0], xyz[1], xyz[2]), kLandmark_map_m.cast<float>());
}

TEST_P(Landmark, is_in_the_ply_in_utm) {
  pcl::PCLPointCloud2 cloud;
  ASSERT_EQ(pcl::PLYReader().read(out("map.ply"), cloud), 0);
  ASSERT_EQ(cloud.width * cloud.height, 2U);
  ASSERT_EQ(cloud.fields.at(0).datatype, pcl::PCLPointField::FLOAT64);
  double xyz[3];
  std::memcpy(xyz, cloud.data.data() + cloud.point_step, sizeof(xyz));
  EXPECT_LT((Eigen::Vector3d(xyz[0], xyz[1], xyz[2]) - utm_).norm(), kSeries_m);
}

TEST_P(Landmark, is_in_the_las_in_utm) {
  const std::string las = read_all(out("map.las"));
  ASSERT_GT(las.size(), 375U);
  EXPECT_EQ(las.substr(0, 4), "LASF");
  EXPECT_EQ(integer_at<std::uint8_t>(las, 24), 1);
  EXPECT_EQ(integer_at<std::uint8_t>(las, 25), 4);
  EXPECT_EQ(integer_at<std::uint16_t>(las, 6), 16) << "the WKT bit alone";
  EXPECT_EQ(integer_at<std::uint64_t>(las, 247), 2U);
  EXPECT_EQ(integer_at<std::uint64_t>(las, 255), 2U) << "all are first returns";
  const auto data = integer_at<std::uint32_t>(las, 96);
  ASSERT_EQ(las.size(), data + 60U);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto steps = integer_at<std::int32_t>(las, data + 30 + 4 * axis);
    const double value = steps * double_at(las, 131 + 8 * axis) + double_at(las, 155 + 8 * axis);
    EXPECT_NEAR(value, utm_[static_cast<Eigen::Index>(axis)], kLasStep_m);
    EXPECT_NEAR(double_at(las, 179 + 16 * axis), value, kMicrometre) << "highest";
    const double other =
        integer_at<std::int32_t>(las, data + 4 * axis) * 0.001 + double_at(las, 155 + 8 * axis);
    EXPECT_NEAR(double_at(las, 187 + 16 * axis), other, kMicrometre) << "lowest";
  }
  EXPECT_EQ(integer_at<std::uint16_t>(las, data + 30 + 12), 100 * 257) << "of 255";
  OGRSpatialReference reference;
  ASSERT_EQ(reference.importFromWkt(las.substr(375 + 54, data - 375 - 54 - 1).c_str()),
            OGRERR_NONE);
  OGRSpatialReference flat;
  flat.importFromEPSG(GetParam().utm_epsg);
  EXPECT_EQ(reference.GetAxesCount(), 3) << "heights are told too";
  reference.DemoteTo2D(nullptr);
  EXPECT_TRUE(reference.IsSame(&flat));
}

TEST_P(Landmark, is_in_csv_and_kitti) {
  std::istringstream csv(read_all(out("fused.csv")));
  std::string line;
  for (std::string next; std::getline(csv, next);) {
    line = next;
  }
  std::vector<double> cells;
  std::istringstream row(line);
  for (std::string cell; std::getline(row, cell, ',');) {
    cells.push_back(std::stod(cell));
  }
  ASSERT_EQ(cells.size(), 13U);
  EXPECT_EQ(line.substr(0, line.find(',')), std::to_string(kStamp_ns));
  EXPECT_LT((Eigen::Vector3d(cells[1], cells[2], cells[3]) - kLandmark_map_m).norm(), kMicrometre);
  expect_at({cells[9], cells[8], cells[10]}, "csv");
  EXPECT_LT((Eigen::Vector2d(cells[11], cells[12]) - utm_.head<2>()).norm(), kSeries_m);
  std::istringstream kitti(read_all(out("fused.kitti.txt")));
  std::array<double, 24> m{};
  for (double& value : m) {
    kitti >> value;
  }
  EXPECT_LT((Eigen::Vector3d(m[15], m[19], m[23]) - kLandmark_map_m).norm(), kMicrometre);
}

TEST_P(Landmark, is_in_geojson_gpx_kml_and_kmz) {
  expect_at(last_vertex(out("trajectories.geojson"), nullptr), "GeoJSON");
  expect_at(last_vertex(out("trajectories.gpx"), "track_points"), "GPX");
  expect_at(last_vertex(out("session.kml"), nullptr), "KML");
  expect_at(last_vertex("/vsizip/" + out("session.kmz") + "/doc.kml", nullptr), "KMZ");
  EXPECT_THAT(read_all(out("trajectories.gpx")),
              testing::HasSubstr("<time>2023-11-14T22:13:20.250Z</time>"));
}

TEST_P(Landmark, is_in_its_cell_of_the_geotiffs) {
  for (const char* name : {"height.tif", "top_view.tif"}) {
    const std::unique_ptr<GDALDataset> tiff(GDALDataset::Open(out(name).c_str(), GDAL_OF_RASTER));
    ASSERT_TRUE(tiff) << name;
    EXPECT_STREQ(tiff->GetSpatialRef()->GetAuthorityCode(nullptr),
                 std::to_string(GetParam().utm_epsg).c_str());
    std::array<double, 6> t{};
    tiff->GetGeoTransform(t.data());
    const int column = static_cast<int>(std::floor((utm_.x() - t[0]) / t[1]));
    const int row = static_cast<int>(std::floor((utm_.y() - t[3]) / t[5]));
    float value = 0.0F;
    const bool is_height = tiff->GetRasterCount() == 1;
    ASSERT_EQ(tiff->GetRasterBand(is_height ? 1 : 4)
                  ->RasterIO(GF_Read, column, row, 1, 1, &value, 1, 1, GDT_Float32, 0, 0),
              CE_None);
    EXPECT_NEAR(value, is_height ? utm_.z() : 255.0, kHeight_m) << name;
  }
}

TEST_P(Landmark, and_the_other_point_are_the_opaque_cells_of_the_overlay) {
  const std::string kml = read_all(out("session.kml"));
  const auto border = [&](const std::string& name) {
    const auto at = kml.find("<" + name + ">") + name.size() + 2;
    return std::stod(kml.substr(at));
  };
  const std::unique_ptr<GDALDataset> png(
      GDALDataset::Open(out("top_view.png").c_str(), GDAL_OF_RASTER));
  ASSERT_TRUE(png);
  const int columns = png->GetRasterXSize();
  const int rows = png->GetRasterYSize();
  std::vector<std::uint8_t> alpha(static_cast<std::size_t>(columns) *
                                  static_cast<std::size_t>(rows));
  ASSERT_EQ(png->GetRasterBand(4)->RasterIO(
                GF_Read, 0, 0, columns, rows, alpha.data(), columns, rows, GDT_Byte, 0, 0),
            CE_None);
  EXPECT_EQ(std::count(alpha.begin(), alpha.end(), 255), 2);
  constexpr int kGeographic3d = 4979;
  constexpr int kGeocentric = 4978;
  for (const Eigen::Vector3d& p_map_m : {kLandmark_map_m, kOther_map_m}) {
    const Eigen::Vector3d place =
        transformed(kGeocentric, kGeographic3d, geocentric_of(GetParam().datum, p_map_m));
    // A box over the antimeridian goes on beyond 180 degrees.
    const double from_west_deg = std::remainder(place.x() - border("west"), 360.0);
    const double across = from_west_deg / (border("east") - border("west"));
    const double down = (border("north") - place.y()) / (border("north") - border("south"));
    ASSERT_TRUE(across >= 0.0 && across < 1.0 && down >= 0.0 && down < 1.0);
    const auto cell = static_cast<std::size_t>(down * rows) * static_cast<std::size_t>(columns) +
                      static_cast<std::size_t>(across * columns);
    ASSERT_LT(cell, alpha.size());
    EXPECT_EQ(alpha[cell], 255) << p_map_m.transpose();
  }
}

INSTANTIATE_TEST_SUITE_P(
    OnEarth,
    Landmark,
    testing::Values(Place{"north", {43.9456, -78.8968, 100.0}, 32617},
                    Place{"south", {-33.8568, 151.2153, 20.0}, 32756},
                    Place{"south_of_the_equator_from_north_of_it", {0.003, 8.999, 5.0}, 32632},
                    Place{"over_the_edge_of_the_zone", {48.1, 5.995, 300.0}, 32631},
                    Place{"over_the_antimeridian", {-17.0, 179.99, 5.0}, 32760},
                    Place{"in_norway_s_wide_zone", {60.4, 5.3, 50.0}, 32632},
                    Place{"on_svalbard", {78.2, 15.6, 50.0}, 32633}),
    [](const auto& place) { return std::string(place.param.name); });

}  // namespace
}  // namespace trigpoint::exporter
