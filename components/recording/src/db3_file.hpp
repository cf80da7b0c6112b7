// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "bag_file.hpp"

#include <filesystem>
#include <memory>

namespace trigpoint::recording {

/// The sqlite3 database of a rosbag2. Throws LogError when the file is none; one that is cut off is
/// read up to where it breaks.
std::unique_ptr<BagFile> open_db3_file(const std::filesystem::path& file);

}  // namespace trigpoint::recording
