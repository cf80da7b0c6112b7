// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A session's trajectories for other programs, in files of text and as tracks on the Earth.
#pragma once

#include "trigpoint/export/session.hpp"
#include "trigpoint/geodesy/map_on_earth.hpp"

#include "geo_files.hpp"

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::exporter {

struct NamedTrajectory {
  std::string name;      ///< of its file, without extension: "fused"
  std::string content;   ///< a sentence
  bool is_in_map{true};  ///< lio is in odom
  Trajectory poses;
};

/// Every trajectory that the session holds, read strictly; `missing` gets a sentence for each that
/// it does not.
std::vector<NamedTrajectory> read_trajectories(const std::string& session,
                                               std::vector<std::string>& missing);

/// Twelve numbers a line, the upper three rows of T_frame_base; the stamps beside it in
/// `times_file`, seconds.
void write_kitti(const std::string& file,
                 const std::string& times_file,
                 const Trajectory& trajectory);

/// One row a pose: stamp, pose, place on the Earth; `nan` where that is not known. `earth` may be
/// null.
void write_trajectory_csv(const std::string& file,
                          const Trajectory& trajectory,
                          const geodesy::MapOnEarth* earth);

/// Those in map; lio is placed once, at the first published pose, so that its drift shows. Empty
/// trajectories are left out.
std::vector<Track> tracks_of(const std::vector<NamedTrajectory>& trajectories,
                             const geodesy::MapOnEarth& earth);

}  // namespace trigpoint::exporter
