// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rosbag2_metadata.hpp"

#include <yaml-cpp/yaml.h>

#include <numeric>

namespace trigpoint::recording {

namespace {

std::uint64_t total(const std::vector<Rosbag2Topic>& topics) {
  return std::accumulate(
      topics.begin(),
      topics.end(),
      std::uint64_t{0},
      [](std::uint64_t sum, const Rosbag2Topic& topic) { return sum + topic.messages; });
}

void emit_times(YAML::Emitter& out, const Rosbag2Metadata& metadata) {
  out << YAML::Key << "duration" << YAML::Value << YAML::BeginMap << YAML::Key << "nanoseconds"
      << YAML::Value << metadata.duration_ns << YAML::EndMap;
  out << YAML::Key << "starting_time" << YAML::Value << YAML::BeginMap << YAML::Key
      << "nanoseconds_since_epoch" << YAML::Value << metadata.start_ns << YAML::EndMap;
}

void emit_topic(YAML::Emitter& out, const Rosbag2Topic& topic) {
  out << YAML::BeginMap << YAML::Key << "topic_metadata" << YAML::Value << YAML::BeginMap;
  out << YAML::Key << "name" << YAML::Value << topic.name;
  out << YAML::Key << "type" << YAML::Value << topic.type;
  out << YAML::Key << "serialization_format" << YAML::Value << "cdr";
  out << YAML::Key << "offered_qos_profiles" << YAML::Value << YAML::DoubleQuoted
      << topic.offered_qos_profiles;
  out << YAML::EndMap << YAML::Key << "message_count" << YAML::Value << topic.messages
      << YAML::EndMap;
}

void emit_file(YAML::Emitter& out, const Rosbag2Metadata& metadata, const std::string& file) {
  out << YAML::BeginMap << YAML::Key << "path" << YAML::Value << file;
  emit_times(out, metadata);
  out << YAML::Key << "message_count" << YAML::Value << total(metadata.topics) << YAML::EndMap;
}

void emit(YAML::Emitter& out, const Rosbag2Metadata& metadata) {
  out << YAML::BeginMap;
  out << YAML::Key << "version" << YAML::Value << 5;
  out << YAML::Key << "storage_identifier" << YAML::Value << metadata.storage;
  emit_times(out, metadata);
  out << YAML::Key << "message_count" << YAML::Value << total(metadata.topics);
  out << YAML::Key << "topics_with_message_count" << YAML::Value << YAML::BeginSeq;
  for (const auto& topic : metadata.topics) {
    emit_topic(out, topic);
  }
  out << YAML::EndSeq;
  out << YAML::Key << "compression_format" << YAML::Value << YAML::DoubleQuoted
      << metadata.compression_format;
  out << YAML::Key << "compression_mode" << YAML::Value << YAML::DoubleQuoted << "";
  out << YAML::Key << "relative_file_paths" << YAML::Value << metadata.files;
  out << YAML::Key << "files" << YAML::Value << YAML::BeginSeq;
  for (const auto& file : metadata.files) {
    emit_file(out, metadata, file);
  }
  out << YAML::EndSeq << YAML::EndMap;
}

}  // namespace

Rosbag2Metadata read_metadata(const std::filesystem::path& file) {
  try {
    const YAML::Node node = YAML::LoadFile(file.string())["rosbag2_bagfile_information"];
    Rosbag2Metadata metadata;
    metadata.storage = node["storage_identifier"].as<std::string>();
    metadata.compression_format = node["compression_format"].as<std::string>("");
    metadata.files = node["relative_file_paths"].as<std::vector<std::string>>();
    return metadata;
  } catch (const YAML::Exception& error) {
    throw LogError(file.string() + ": is no metadata of rosbag2: " + error.what());
  }
}

std::string to_yaml(const Rosbag2Metadata& metadata) {
  YAML::Emitter out;
  out << YAML::BeginMap << YAML::Key << "rosbag2_bagfile_information" << YAML::Value;
  emit(out, metadata);
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

std::string to_bare_yaml(const Rosbag2Metadata& metadata) {
  YAML::Emitter out;
  emit(out, metadata);
  return std::string(out.c_str()) + "\n";
}

std::string offered_qos(Durability durability) {
  // Enumerators of rmw_qos_profile_t: history keep last 1, reliability reliable 1, durability
  // transient local 1, volatile 2, liveliness automatic 1; 9223372036.854775807 s is "infinite".
  const std::string forever = "\n    sec: 9223372036\n    nsec: 854775807";
  return "- history: 1\n  depth: 10\n  reliability: 1\n  durability: " +
         std::string(durability == Durability::kTransientLocal ? "1" : "2") +
         "\n  deadline:" + forever + "\n  lifespan:" + forever +
         "\n  liveliness: 1\n  liveliness_lease_duration:" + forever +
         "\n  avoid_ros_namespace_conventions: false";
}

}  // namespace trigpoint::recording
