// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The saved map, rendered from keyframes, and point cloud files. Library trigpoint::export_map,
// apart from trigpoint::export so that only who renders maps links PCL.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/pose.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace trigpoint::exporter {

struct MapReport {
  std::uint64_t keyframes{0};
  std::uint64_t keyframes_left_out{0};  ///< of an epoch without alignment when others have one
  std::uint64_t points_read{0};
  std::uint64_t points_written{0};
  std::uint64_t points_moving{0};  ///< of those read, taken for moving objects and left out
  std::string frame{"map"};        ///< "odom" when nothing was aligned and no fallback given
  Eigen::Vector3d lowest_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d highest_m{Eigen::Vector3d::Zero()};
  std::string
      remark;  ///< what a reader must know, e.g. why the frame is odom; empty when all is well
};

struct CorrectedPoses;

/// What the past is known better by than the keyframes themselves.
struct MapCorrections {
  /// Of the pose graph (correct_session.hpp). Keyframes that it does not hold are left out.
  const CorrectedPoses* corrected{nullptr};
  /// Points that others look through are not rendered (lio_mapper/see_through).
  bool remove_moving{false};
  Eigen::Vector3d lidar_position_base_m{Eigen::Vector3d::Zero()};  ///< where rays begin
};

/// Renders `keyframes_file` into the binary PCD `out_pcd` (x y z intensity, float32, m). Each
/// keyframe is placed by its own T_map_odom; those from before the alignment by that of the first
/// aligned keyframe of the same odom epoch, or by `fallback` (its epoch must match) when none was
/// aligned. Points are averaged in cubes of `voxel_m`. `progress` gets 0 to 1, may be empty.
/// Throws std::runtime_error naming the file and the cause.
MapReport render_map(const std::string& keyframes_file,
                     const std::optional<Alignment>& fallback,
                     double voxel_m,
                     const std::string& out_pcd,
                     const std::function<void(double)>& progress = {},
                     const MapCorrections& corrections = {});

using VisitKeyframe = std::function<void(const Pose& T_frame_base, const PointCloud& points_frame)>;

/// Every keyframe of a session that keyframes.tum places, in order of time, in the frame that it
/// names. False, and nothing visited, when the session holds no keyframes or no keyframes.tum.
bool visit_placed_keyframes(const std::string& session, const VisitKeyframe& visit);

/// Binary PCD with x y z intensity.
void write_pcd(const std::string& file, const PointCloud& cloud);

/// The frame that the map's file names, "map" or "odom"; empty when it names none or there is no
/// such file.
std::string frame_of_pcd(const std::string& file);

/// Hands a file's points over in parts, with the share read so far: memory does not grow with the
/// file when that is binary, as maps are. Points with a coordinate that is not finite are left out.
void visit_pcd(const std::string& file,
               const std::function<void(const PointCloud& points, double share)>& visit);

/// Reads x y z and, when there, intensity, of what visit_pcd hands over.
PointCloud read_pcd(const std::string& file);

}  // namespace trigpoint::exporter
