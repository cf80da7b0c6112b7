// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Recordings of the shared data as inputs of the GPS filters, with the reference that lies beside
// them (see data/README.md and each PROVENANCE.txt).
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace trigpoint {

struct RecordedInput {
  Nanoseconds available_ns{0};
  std::variant<ImuSample, GnssFix> measurement;
};

struct ReferencePoint {
  Nanoseconds stamp_ns{0};
  geodesy::Geographic place;
};

struct RecordedDrive {
  RobotConfig robot;
  std::vector<RecordedInput> inputs;      ///< in order of availability
  std::vector<ReferencePoint> reference;  ///< empty: there is none
};

/// nullopt when the recording is not at hand.
/// u-blox fixes (no covariance in the data: 1.5 m level, 3 m up) and a phone's IMU; reference
/// poses.
std::optional<RecordedDrive> read_comma2k19();

/// Least squares positions between houses (27 m median error; reported: residual over satellites),
/// and an IMU made from wheel speed and yaw rate: the recording has none. Reference: ground truth.
std::optional<RecordedDrive> read_smartloc();

/// The fixes and the IMU (30 Hz, mounted on its side) of a robot; no reference.
std::optional<RecordedDrive> read_parking_lot();

}  // namespace trigpoint
