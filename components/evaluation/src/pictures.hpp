// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The pictures of a session. Each returns the PNG's path and throws std::runtime_error naming what
// failed.
#pragma once

#include "trigpoint/base/measurements.hpp"

#include "session_data.hpp"

#include <string>

namespace trigpoint::evaluation {

/// Top view of all trajectories and fixes over the points of `map` (may be empty), in metres east
/// and north.
std::string draw_trajectories(const SessionData& data,
                              const PointCloud& map,
                              const std::string& gnuplot);

/// Sigma of the GPS odometry per axis with threshold, the gate's choice as the background and the
/// outages; height and, with truth, error over time below.
std::string draw_uncertainty(const SessionData& data, const std::string& gnuplot);

std::string draw_scan_times(const SessionData& data, const std::string& gnuplot);

/// T that brings lio.tum into map by yaw + translation, onto truth or else onto fused.tum; none
/// when there is nothing to bring it onto.
std::optional<Pose> lio_placement(const SessionData& data);

/// What every legend calls lio.tum, laid onto map by lio_placement or not.
const char* lio_title(bool is_placed);

/// Seconds since the session's first stamp.
double seconds_since(Nanoseconds begin_ns, Nanoseconds stamp_ns);

/// Every n-th pose, so that a picture has at most about `most` of each curve.
Trajectory thinned(const Trajectory& trajectory, std::size_t most = 10'000);

}  // namespace trigpoint::evaluation
