// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gdal_errors.hpp"
#include "geo_files.hpp"
#include "part_file.hpp"
#include <cpl_vsi.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <ctime>
#include <filesystem>
#include <memory>

namespace trigpoint::exporter {

namespace {

struct CloseVectors {
  void operator()(GDALDataset* dataset) const { GDALClose(dataset); }
};

using Vectors = std::unique_ptr<GDALDataset, CloseVectors>;
using Feature = std::unique_ptr<OGRFeature>;

Vectors create(const char* driver_name, const std::string& file) {
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName(driver_name);
  GdalErrors::check(driver != nullptr, file, std::string("find GDAL's driver ") + driver_name);
  Vectors dataset(driver->Create(file.c_str(), 0, 0, 0, GDT_Unknown, nullptr));
  GdalErrors::check(dataset != nullptr, file, "create");
  return dataset;
}

OGRSpatialReference wgs84() {
  OGRSpatialReference reference;
  reference.SetWellKnownGeogCS("WGS84");
  reference.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);  // longitude first, as the formats
  return reference;
}

/// Not negative, also before 1970.
Nanoseconds rest_of(Nanoseconds stamp_ns, Nanoseconds unit_ns) {
  return ((stamp_ns % unit_ns) + unit_ns) % unit_ns;
}

/// To the millisecond, which is all that GDAL prints. Rounded here, since GDAL makes 59.9996 s the
/// 60th second of the same minute, which no reader knows.
void set_time(OGRFeature& feature, const char* field, Nanoseconds stamp_ns) {
  constexpr int kUtc = 100;
  constexpr Nanoseconds kMillisecond_ns = 1'000'000;
  const Nanoseconds half_up_ns = stamp_ns + kMillisecond_ns / 2;
  const Nanoseconds rounded_ns = half_up_ns - rest_of(half_up_ns, kMillisecond_ns);
  const Nanoseconds fraction_ns = rest_of(rounded_ns, kNanosecondsPerSecond);
  const std::time_t second = (rounded_ns - fraction_ns) / kNanosecondsPerSecond;
  std::tm utc{};
  gmtime_r(&second, &utc);
  feature.SetField(feature.GetFieldIndex(field),
                   utc.tm_year + 1900,
                   utc.tm_mon + 1,
                   utc.tm_mday,
                   utc.tm_hour,
                   utc.tm_min,
                   static_cast<float>(utc.tm_sec + to_seconds(fraction_ns)),
                   kUtc);
}

void add_field(OGRLayer& layer, const char* name, OGRFieldType type) {
  OGRFieldDefn field(name, type);
  layer.CreateField(&field);
}

/// A file in memory, since GDAL's drivers for texts do not notice a full disk. Trajectories are
/// small.
class MemoryFile {
 public:
  MemoryFile(const char* driver_name, const std::string& file)
      : file_(file),
        path_("/vsimem/trigpoint/" + std::filesystem::path(file).filename().string()),
        dataset_(create(driver_name, path_)) {}

  ~MemoryFile() {
    dataset_.reset();
    VSIUnlink(path_.c_str());
  }

  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  GDALDataset& dataset() { return *dataset_; }

  void save() {
    dataset_.reset();
    vsi_l_offset size = 0;
    const auto* bytes =
        reinterpret_cast<const char*>(VSIGetMemFileBuffer(path_.c_str(), &size, FALSE));
    GdalErrors::check(bytes != nullptr, file_, "write");
    PartFile part(file_, "");
    part.append(bytes, size);
    part.finish("");
  }

 private:
  std::string file_;
  std::string path_;
  Vectors dataset_;
};

}  // namespace

void write_geojson(const std::string& file, const std::vector<Track>& tracks) {
  const GdalErrors errors;
  MemoryFile memory("GeoJSON", file);
  OGRSpatialReference reference = wgs84();
  // 1e-9 degree is a tenth of a millimetre.
  const char* options[] = {"COORDINATE_PRECISION=9", nullptr};
  OGRLayer* layer = memory.dataset().CreateLayer(
      "trajectories", &reference, wkbLineString25D, const_cast<char**>(options));
  GdalErrors::check(layer != nullptr, file, "create");
  add_field(*layer, "name", OFTString);
  add_field(*layer, "content", OFTString);
  add_field(*layer, "begin", OFTDateTime);
  add_field(*layer, "end", OFTDateTime);
  for (const Track& track : tracks) {
    const Feature feature(OGRFeature::CreateFeature(layer->GetLayerDefn()));
    feature->SetField("name", track.name.c_str());
    feature->SetField("content", track.content.c_str());
    set_time(*feature, "begin", track.points.front().stamp_ns);
    set_time(*feature, "end", track.points.back().stamp_ns);
    OGRLineString line;
    for (const Track::Point& point : track.points) {
      line.addPoint(point.place.longitude_deg, point.place.latitude_deg, point.place.height_m);
    }
    feature->SetGeometry(&line);
    GdalErrors::check(layer->CreateFeature(feature.get()) == OGRERR_NONE, file, "write");
  }
  memory.save();
}

void write_gpx(const std::string& file, const std::vector<Track>& tracks) {
  const GdalErrors errors;
  MemoryFile memory("GPX", file);
  OGRSpatialReference reference = wgs84();
  OGRLayer* layer = memory.dataset().CreateLayer("track_points", &reference, wkbPoint25D, nullptr);
  GdalErrors::check(layer != nullptr, file, "create");
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    bool first = true;
    for (const Track::Point& point : tracks[i].points) {
      const Feature feature(OGRFeature::CreateFeature(layer->GetLayerDefn()));
      feature->SetField("track_fid", static_cast<int>(i));
      feature->SetField("track_seg_id", 0);
      if (first && feature->GetFieldIndex("track_name") >= 0) {
        feature->SetField("track_name", tracks[i].name.c_str());
      }
      first = false;
      feature->SetField("ele", point.place.height_m);
      set_time(*feature, "time", point.stamp_ns);
      OGRPoint place(point.place.longitude_deg, point.place.latitude_deg, point.place.height_m);
      feature->SetGeometry(&place);
      GdalErrors::check(layer->CreateFeature(feature.get()) == OGRERR_NONE, file, "write");
    }
  }
  memory.save();
}

}  // namespace trigpoint::exporter
