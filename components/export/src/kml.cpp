// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// OGC 12-007r2, KML 2.3. Written here because GDAL's drivers write no ground overlay; its archive
// functions make the KMZ.
#include "trigpoint/export/session.hpp"

#include "gdal_errors.hpp"
#include "geo_files.hpp"
#include <cpl_conv.h>
#include <cpl_string.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <memory>
#include <vector>

namespace trigpoint::exporter {

namespace {

constexpr const char* kPictureInArchive = "files/top_view.png";

/// Line colours in KML's order alpha, blue, green, red; the report's pictures have the same.
std::string colour_of(const std::string& name) {
  const std::array<std::array<const char*, 2>, 4> colours{{{"truth", "ff30c2f2"},
                                                           {"gps", "ffbf6f1f"},
                                                           {"fused_smoothed", "ff7fd44f"},
                                                           {"lio", "ff2e77e8"}}};
  for (const auto& [of, colour] : colours) {
    if (name == of) {
      return colour;
    }
  }
  return "ff3c8517";  // fused
}

std::string escaped(const std::string& text) {
  char* xml = CPLEscapeString(text.c_str(), -1, CPLES_XML);
  std::string result(xml);
  CPLFree(xml);
  return result;
}

std::string number(double value, int decimals) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string overlay_of(const std::string& picture, const Grid& grid) {
  const double south = grid.north_west.y() - grid.rows * grid.cell.y();
  const double east = grid.north_west.x() + grid.columns * grid.cell.x();
  return "<GroundOverlay><name>map from above</name><color>e6ffffff</color><Icon><href>" +
         escaped(picture) + "</href></Icon><LatLonBox><north>" + number(grid.north_west.y(), 12) +
         "</north><south>" + number(south, 12) + "</south><east>" + number(east, 12) +
         "</east><west>" + number(grid.north_west.x(), 12) +
         "</west></LatLonBox></GroundOverlay>\n";
}

std::string placemark_of(const Track& track) {
  std::string text = "<Placemark><name>" + escaped(track.name) + "</name><description>" +
                     escaped(track.content) + "</description><Style><LineStyle><color>" +
                     colour_of(track.name) +
                     "</color><width>3</width></LineStyle></Style><LineString>"
                     "<tessellate>1</tessellate><altitudeMode>clampToGround</altitudeMode>"
                     "<coordinates>";
  for (const Track::Point& point : track.points) {
    text += number(point.place.longitude_deg, 9) + "," + number(point.place.latitude_deg, 9) + "," +
            number(point.place.height_m, 4) + " ";
  }
  text.back() = '<';
  return text + "/coordinates></LineString></Placemark>\n";
}

std::string document_of(const std::vector<Track>& tracks,
                        const std::string& picture,
                        const Grid& grid) {
  std::string text =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document><name>Trigpoint</name>\n";
  if (!picture.empty()) {
    text += overlay_of(picture, grid);
  }
  for (const Track& track : tracks) {
    text += placemark_of(track);
  }
  return text + "</Document></kml>\n";
}

void add_to_archive(void* archive,
                    const char* name,
                    const std::string& content,
                    const std::string& file) {
  const bool done =
      CPLCreateFileInZip(archive, name, nullptr) == CE_None &&
      CPLWriteFileInZip(archive, content.data(), static_cast<int>(content.size())) == CE_None &&
      CPLCloseFileInZip(archive) == CE_None;
  GdalErrors::check(done, file, "write");
}

std::string content_of(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

}  // namespace

Track thinned(const Track& track, Nanoseconds interval_ns) {
  Track thin{track.name, track.content, {}};
  for (const Track::Point& point : track.points) {
    if (thin.points.empty() || point.stamp_ns - thin.points.back().stamp_ns >= interval_ns) {
      thin.points.push_back(point);
    }
  }
  if (!track.points.empty() && thin.points.back().stamp_ns != track.points.back().stamp_ns) {
    thin.points.push_back(track.points.back());
  }
  return thin;
}

void write_kml(const std::string& file,
               const std::vector<Track>& tracks,
               const std::string& picture,
               const Grid& grid) {
  write_text(file, document_of(tracks, picture, grid));
}

void write_kmz(const std::string& file,
               const std::vector<Track>& tracks,
               const std::string& png_file,
               const Grid& grid) {
  const GdalErrors errors;
  GdalTarget target(file);
  using Archive = std::unique_ptr<void, int (*)(void*)>;
  const auto close = [](void* zip) { return static_cast<int>(CPLCloseZip(zip)); };
  Archive archive(CPLCreateZip(target.part().c_str(), nullptr), close);
  GdalErrors::check(archive != nullptr, file, "create");
  // The document is the archive's first entry: that one Google Earth opens.
  const std::string picture = png_file.empty() ? "" : kPictureInArchive;
  add_to_archive(archive.get(), "doc.kml", document_of(tracks, picture, grid), file);
  if (!png_file.empty()) {
    add_to_archive(archive.get(), kPictureInArchive, content_of(png_file), file);
  }
  archive.reset();
  GdalErrors::check(true, file, "write");
  target.commit();
}

}  // namespace trigpoint::exporter
