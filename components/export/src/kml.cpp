// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// OGC 12-007r2, KML 2.3. Written here because GDAL's drivers write no ground overlay; its archive
// functions make the KMZ.
#include "trigpoint/export/session.hpp"

#include "gdal_errors.hpp"
#include "geo_files.hpp"
#include <cpl_conv.h>
#include <cpl_string.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <fstream>
#include <memory>
#include <vector>

namespace trigpoint::exporter {

namespace {

static_assert(std::endian::native == std::endian::little, "an archive's numbers are little-endian");

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

/// MS-DOS's time and date of an archive's entries (APPNOTE 4.4.6), UTC; before 1980, which it
/// cannot say, its first day.
std::uint32_t dos_time_of(Nanoseconds stamp_ns) {
  constexpr std::uint32_t kFirstDay = (1U << 21U) | (1U << 16U);
  const std::time_t seconds = stamp_ns / kNanosecondsPerSecond;
  std::tm utc{};
  if (gmtime_r(&seconds, &utc) == nullptr || utc.tm_year < 80 || utc.tm_year >= 80 + 128) {
    return kFirstDay;
  }
  const auto bits = [](int value, unsigned shift) {
    return static_cast<std::uint32_t>(value) << shift;
  };
  return bits(utc.tm_year - 80, 25) | bits(utc.tm_mon + 1, 21) | bits(utc.tm_mday, 16) |
         bits(utc.tm_hour, 11) | bits(utc.tm_min, 5) | bits(utc.tm_sec / 2, 0);
}

template <typename Number>
Number number_at(const std::string& bytes, std::size_t at) {
  Number number{};
  std::memcpy(&number, bytes.substr(at, sizeof(Number)).c_str(), sizeof(Number));
  return number;
}

/// GDAL leaves month 0 of 1980 there, which no calendar has. The entries are found by the archive's
/// directory (APPNOTE 4.3); one that is not as GDAL writes it is left as it is.
void set_time_of_entries(std::string& zip, Nanoseconds stamp_ns) {
  const std::uint32_t time = dos_time_of(stamp_ns);
  const std::size_t end = zip.rfind("PK\5\6");
  if (end == std::string::npos || end + 22 > zip.size()) {
    return;
  }
  std::size_t entry = number_at<std::uint32_t>(zip, end + 16);
  for (int left = number_at<std::uint16_t>(zip, end + 10); left > 0; --left) {
    const std::size_t local =
        entry + 46 > zip.size() ? 0 : number_at<std::uint32_t>(zip, entry + 42);
    if (entry + 46 > zip.size() || zip.compare(entry, 4, "PK\1\2") != 0 ||
        local + 30 > zip.size() || zip.compare(local, 4, "PK\3\4") != 0) {
      return;
    }
    std::memcpy(&zip[entry + 12], &time, sizeof(time));
    std::memcpy(&zip[local + 10], &time, sizeof(time));
    entry += 46U + number_at<std::uint16_t>(zip, entry + 28) +
             number_at<std::uint16_t>(zip, entry + 30) + number_at<std::uint16_t>(zip, entry + 32);
  }
}

Nanoseconds end_of(const std::vector<Track>& tracks) {
  Nanoseconds end_ns = 0;
  for (const Track& track : tracks) {
    end_ns = track.points.empty() ? end_ns : std::max(end_ns, track.points.back().stamp_ns);
  }
  return end_ns;
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
  std::string zip = content_of(target.part());
  set_time_of_entries(zip, end_of(tracks));
  write_text(target.part(), zip);
  target.commit();
}

}  // namespace trigpoint::exporter
