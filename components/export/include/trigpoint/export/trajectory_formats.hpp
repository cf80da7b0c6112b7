// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Trajectory files that others bring: TUM (session.hpp) and KITTI.
#pragma once

#include "trigpoint/export/session.hpp"

#include <string>

namespace trigpoint::exporter {

enum class TrajectoryFormat { kTum, kKitti };

/// By the number of columns of the first line that is no comment: 12 are KITTI's, all else is for
/// the reader of TUM files to judge.
TrajectoryFormat format_of(const std::string& file);

/// KITTI: the upper three rows of T_world_body, row by row. Stamps are the lines of `times_file`
/// (seconds); without one, pose i is at i * 0.1 s, which only tells it from the others. Strict as
/// read_trajectory; throws std::runtime_error with file, line and cause.
Trajectory read_kitti(const std::string& file, const std::string& times_file = {});

/// For NAME.txt NAME_times.txt (so for fused.kitti.txt fused.kitti_times.txt), else times.txt in
/// the same folder; empty when none is there.
std::string times_file_of(const std::string& kitti_file);

}  // namespace trigpoint::exporter
