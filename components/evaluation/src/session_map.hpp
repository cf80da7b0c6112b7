// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// map.pcd of a session, read once for everything that shows or measures it.
#pragma once

#include "trigpoint/base/measurements.hpp"

#include "session_data.hpp"

#include <string>

namespace trigpoint::evaluation {

struct SessionMap {
  PointCloud points;    ///< none when there is no file, or it cannot be read
  std::string frame;    ///< map or odom; what the file says goes before what other files let expect
  std::string problem;  ///< why it cannot be read, without a full stop; mostly empty
};

SessionMap read_map(const SessionData& data);

/// The frame in which the session's trajectories are shown: odom only when lio.tum is all there is.
std::string shown_frame(const SessionData& data);

/// The points over which the trajectories can be drawn: none of a map in another frame.
const PointCloud& map_under(const SessionData& data, const SessionMap& map);

}  // namespace trigpoint::evaluation
