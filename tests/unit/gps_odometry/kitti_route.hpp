// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Recorded cars: positions at 10 Hz and the IMU at 100 Hz of three KITTI drives (see PROVENANCE.txt
// beside the data). The positions are the recorder's fused solution: good to a few decimetres, and
// not independent of the IMU; noise and outages are added here.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::gps_odometry {

struct KittiRoute {
  std::vector<ImuSample> imu;  ///< as recorded: gaps and backward steps are in it
  std::vector<Nanoseconds> stamps_ns;
  std::vector<geodesy::Geographic> places;
};

/// nullopt when the recording (or xz) is not at hand.
std::optional<KittiRoute> read_kitti_route(const std::string& number, const std::string& drive);

}  // namespace trigpoint::gps_odometry
