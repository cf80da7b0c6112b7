// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/recording/log.hpp"

#include <filesystem>
#include <memory>

namespace trigpoint::recording {

/// Sweeps, IMU and fixes of a KITTI raw drive in order of arrival. Only the span with sweeps is
/// delivered, with `options.lead_in_s` of IMU and fixes before it, so that filters have started,
/// and a moment after it, so that IMU samples cover the last sweep. IMU samples keep their file
/// order and stamps, also where the recording's stamps step back; they arrive when the newest
/// stamp so far says, so that the order of arrival never runs backwards.
std::unique_ptr<LogReader> open_kitti_drive(const std::filesystem::path& sync_folder,
                                            const RobotConfig& robot,
                                            const LogOptions& options);

}  // namespace trigpoint::recording
