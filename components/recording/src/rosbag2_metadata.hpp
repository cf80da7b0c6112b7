// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// metadata.yaml of a rosbag2 folder, version 5 (ROS 2 Humble).
#pragma once

#include "trigpoint/recording/log.hpp"
#include "trigpoint/recording/rosbag2_writer.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace trigpoint::recording {

struct Rosbag2Topic {
  std::string name;  ///< with leading slash
  std::string type;
  std::string offered_qos_profiles;  ///< YAML
  std::uint64_t messages{0};
};

struct Rosbag2Metadata {
  std::string storage{"sqlite3"};
  std::string compression_format;
  Nanoseconds start_ns{0};
  Nanoseconds duration_ns{0};
  std::vector<std::string> files;  ///< relative to the folder
  std::vector<Rosbag2Topic> topics;
};

/// Reads what is needed to find the data; throws LogError when it is no metadata of rosbag2.
Rosbag2Metadata read_metadata(const std::filesystem::path& file);

std::string to_yaml(const Rosbag2Metadata& metadata);

/// Without the key in front of all, as rosbag2 puts it into an MCAP file.
std::string to_bare_yaml(const Rosbag2Metadata& metadata);

/// One writer's QoS as rosbag2 Humble stores it: reliable, keep last 10.
std::string offered_qos(Durability durability);

}  // namespace trigpoint::recording
