// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The files of one KITTI raw drive [1], parsed, on one clock.
//
// [1] A. Geiger, P. Lenz, C. Stiller, R. Urtasun, "Vision meets Robotics: The KITTI Dataset",
//     IJRR 2013, and its development kit's description of the formats.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/robot.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::recording {

/// Stamps of the OXTS minus stamps of the Velodyne at the same moment. The OXTS record that KITTI
/// paired with a sweep is stamped 12 to 22 ms (mean 17) after that sweep's middle, but this is the
/// delay of the camera image to which both were paired, not one of the clocks: with the sweeps of
/// drive 2011_09_26_0009 undistorted and accumulated along the INS's poses, the ground is thinnest
/// at 0 ms (+-7) and facades at -10 ms (+-15). README.md tells how this was measured.
inline constexpr Nanoseconds kOxtsMinusVelodyneClock_ns = 0;

/// A sweep on disk; stamps on the Velodyne's clock.
struct KittiSweep {
  std::filesystem::path file;
  Nanoseconds start_ns{0};
  Nanoseconds end_ns{0};
};

struct KittiDrive {
  std::filesystem::path sync_folder;
  std::vector<KittiSweep> sweeps;  ///< only those whose .bin exists
  std::vector<ImuSample> imu;      ///< in file order; stamps on the Velodyne's clock
  std::string imu_source;          ///< "imu100.csv" or "oxts"
  std::vector<GnssFix> fixes;
  std::optional<RobotConfig> robot;  ///< when calib_imu_to_velo.txt is there
};

/// The drive's ..._sync folder when `path` is one or holds exactly one.
std::optional<std::filesystem::path> find_kitti_sync_folder(const std::filesystem::path& path);

/// Reads everything but the points. Throws LogError naming file and line.
KittiDrive load_kitti_drive(const std::filesystem::path& sync_folder);

/// "2011-09-26 13:08:24.905593646" to nanoseconds since 1970. KITTI's stamps are local time
/// without a zone; they are taken as if they were UTC. nullopt when the text is not a stamp.
std::optional<Nanoseconds> parse_kitti_stamp(const std::string& text);

/// Reads the points and adds their times (see kitti_point_time_s).
/// Every beam is turned upwards by `elevation_correction_rad` in its own vertical plane.
PointCloudMessage load_kitti_sweep(const KittiSweep& sweep, double elevation_correction_rad = 0.0);

/// Seconds after the sweep's start at which a point in direction (x, y) of the LiDAR was measured.
/// The scanner turns clockwise seen from above, and a sweep is cut at the rear: azimuth +180
/// degrees (left of the rear) comes first, 0 (ahead) in the middle, -180 last.
float kitti_point_time_s(float x_m, float y_m, double sweep_duration_s);

}  // namespace trigpoint::recording
