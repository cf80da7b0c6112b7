// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/log.hpp"

#include "bag_source.hpp"
#include "kitti_drive.hpp"
#include "kitti_reader.hpp"
#include "log_window.hpp"
#include "mcap_file.hpp"
#include "rosbag1_source.hpp"
#include "rosbag2_source.hpp"
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>

namespace trigpoint::recording {

namespace fs = std::filesystem;

namespace {

/// By its first line, or by its name when it is cut off in there.
bool is_rosbag1(const fs::path& path) {
  constexpr std::string_view kMagic = "#ROSBAG V";
  std::string begin(kMagic.size(), ' ');
  std::ifstream(path, std::ios::binary)
      .read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return begin == kMagic || path.filename().string().find(".bag") != std::string::npos;
}

/// A hint for files that lie near a log.
std::string hint_for(const fs::path& path) {
  const fs::path inner = path.stem().extension();
  if (path.extension() == ".zstd" && (inner == ".db3" || inner == ".mcap")) {
    return "; rosbag2 has compressed the file: `zstd -d " + path.filename().string() + " -o " +
           path.stem().string() + "` makes one of it that can be read";
  }
  if (path.filename() == "metadata.yaml") {
    return "; it describes a rosbag2: name the folder that it lies in";
  }
  return fs::is_directory(path) ? "; the folder holds none of these" : "";
}

std::unique_ptr<LogReader> open_by_kind(const fs::path& path,
                                        const RobotConfig& robot,
                                        const LogOptions& options) {
  if (fs::is_regular_file(path) && is_rosbag1(path)) {
    return read_bag(open_rosbag1(path), robot, options);
  }
  if (fs::is_directory(path) || path.extension() == ".db3" || is_mcap(path)) {
    if (const auto files = find_rosbag2_files(path); !files.empty()) {
      return read_bag(open_rosbag2(path, files), robot, options);
    }
  }
  if (const auto sync_folder = find_kitti_sync_folder(path)) {
    return open_kitti_drive(*sync_folder, robot, options);
  }
  throw LogError(path.string() +
                 ": is no log that is known here; expected a ROS 1 bag (.bag), an MCAP file "
                 "(.mcap), a rosbag2 folder (metadata.yaml; .db3 or .mcap) or a .db3 of one, a "
                 "KITTI raw drive (velodyne_points, "
                 "oxts), a folder made by trigpoint simulate, or a scenario" +
                 hint_for(path));
}

}  // namespace

std::unique_ptr<LogReader> open_log(const std::string& path,
                                    const RobotConfig& robot,
                                    const LogOptions& options) {
  if (!fs::exists(path)) {
    throw LogError(path + ": does not exist");
  }
  if (fs::is_directory(path) && ::faccessat(AT_FDCWD, path.c_str(), R_OK | X_OK, AT_EACCESS) != 0) {
    throw LogError(path + ": cannot be read: " + std::strerror(errno));
  }
  return apply_options(open_by_kind(path, robot, options), options);
}

std::unique_ptr<LogReader> open_log(const std::string& path, const RobotConfig& robot) {
  return open_log(path, robot, LogOptions{});
}

}  // namespace trigpoint::recording
