// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "session_map.hpp"

#include "trigpoint/export/map.hpp"

#include <exception>
#include <filesystem>

namespace trigpoint::evaluation {

SessionMap read_map(const SessionData& data) {
  SessionMap map;
  const std::string path = data.path(exporter::session_file::kMap);
  if (!std::filesystem::exists(path)) {
    return map;
  }
  const std::string named = exporter::frame_of_pcd(path);
  map.frame = !named.empty() ? named : data.alignment ? "map" : "odom";
  try {
    map.points = exporter::read_pcd(path);
  } catch (const std::exception& error) {
    map.problem = error.what();
  }
  return map;
}

std::string shown_frame(const SessionData& data) {
  return data.fused.empty() && data.gps.empty() && data.truth.empty() ? "odom" : "map";
}

const PointCloud& map_under(const SessionData& data, const SessionMap& map) {
  static const PointCloud kNone;
  return map.frame == shown_frame(data) ? map.points : kNone;
}

}  // namespace trigpoint::evaluation
