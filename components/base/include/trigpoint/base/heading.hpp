// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A heading measured as such, by two antennas or a magnetometer: what such a message must be before
// it is used.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/robot.hpp"

#include <optional>
#include <string>

namespace trigpoint {

/// Of base_link, counter-clockwise from map's east.
struct Heading {
  Nanoseconds stamp_ns{0};
  double yaw_map_rad{0.0};
  double sigma_rad{0.0};
};

struct HeadingVerdict {
  std::optional<Heading> measurement;  ///< nullopt: refused
  std::string reason;                  ///< name of the counter
  std::string text;                    ///< a sentence with the value and what was expected
};

/// Turns by `robot.yaw_offset_rad`; sigma is what the message reports, at least
/// `robot.yaw_floor_sigma_rad`, `robot.yaw_default_sigma_rad` where it reports none.
HeadingVerdict check_heading(const YawMeasurement& yaw, const RobotConfig& robot);

}  // namespace trigpoint
