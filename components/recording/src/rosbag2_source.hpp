// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "bag_source.hpp"

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

namespace trigpoint::recording {

/// The files of a rosbag2 folder (.db3 or .mcap), or the file itself, in order; empty when `path`
/// is neither. A folder without metadata.yaml (the recorder was killed) is taken with all its .db3
/// files or, when it has none, with all its .mcap files. Throws LogError for bags in storage
/// formats that can't be read here.
std::vector<std::filesystem::path> find_rosbag2_files(const std::filesystem::path& path);

/// Throws LogError when a file is neither a rosbag2 nor MCAP. A file that is cut off is read up to
/// where it breaks.
std::unique_ptr<BagSource> open_rosbag2(const std::filesystem::path& path,
                                        const std::vector<std::filesystem::path>& files);

}  // namespace trigpoint::recording
