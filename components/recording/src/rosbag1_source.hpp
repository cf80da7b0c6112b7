// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "bag_source.hpp"

#include <filesystem>
#include <memory>

namespace trigpoint::recording {

/// A ROS 1 bag (format 2.0). One without an index, because its recorder was killed or its end is
/// cut off, is read record by record up to where it breaks off. Throws LogError.
std::unique_ptr<BagSource> open_rosbag1(const std::filesystem::path& file);

/// The record-by-record reading alone.
std::unique_ptr<BagSource> salvage_rosbag1(const std::filesystem::path& file);

}  // namespace trigpoint::recording
