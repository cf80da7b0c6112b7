// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Files of geographic programs, through GDAL, whose headers stay in the .cpp files. Each function
// throws std::runtime_error naming the file and the cause, and leaves no part of a file behind.
#pragma once

#include "trigpoint/base/time.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include "top_view.hpp"

#include <string>
#include <vector>

namespace trigpoint::exporter {

/// A trajectory on the Earth.
struct Track {
  struct Point {
    Nanoseconds stamp_ns{0};
    geodesy::Geographic place;
  };

  std::string name;
  std::string content;  ///< what it is, a sentence
  std::vector<Point> points;
};

/// One LineString a track with its name, content, and first and last time.
void write_geojson(const std::string& file, const std::vector<Track>& tracks);

/// One trk a track, every point with its time (UTC). ele is above the ellipsoid.
void write_gpx(const std::string& file, const std::vector<Track>& tracks);

/// Highest point of each cell in m above the ellipsoid, float32, NaN where there is none.
void write_height_tiff(const std::string& file, const TopView& view, const std::string& wkt);

/// The picture in red, green, blue, alpha.
void write_picture_tiff(const std::string& file, const TopView& view, const std::string& wkt);
void write_png(const std::string& file, const TopView& view);

/// KML for Google Earth: the tracks, clamped to the ground, over `picture` (a PNG beside the KML,
/// may be empty) that covers `grid` (degrees).
void write_kml(const std::string& file,
               const std::vector<Track>& tracks,
               const std::string& picture,
               const Grid& grid);

/// The same with the picture in one archive; `png_file` is copied into it unless empty.
void write_kmz(const std::string& file,
               const std::vector<Track>& tracks,
               const std::string& png_file,
               const Grid& grid);

/// At most one point per `interval_ns`, and the last one: viewers slow down beyond.
Track thinned(const Track& track, Nanoseconds interval_ns);

}  // namespace trigpoint::exporter
