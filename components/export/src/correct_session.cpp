// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/correct_session.hpp"

#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

namespace fs = std::filesystem;

using lio_mapper::GraphInput;
using lio_mapper::KeyframeReader;

constexpr const char* kCorrectedInOdom = "base_link at keyframes in odom, loops closed";
constexpr const char* kCorrectedInMap = "base_link at keyframes in map, corrected past";

/// A sweep belongs to the epoch of the newest keyframe before it: an epoch begins with one.
void assign_epochs(GraphInput& input) {
  std::size_t next = 0;
  for (lio_mapper::OdomSample& sample : input.trajectory) {
    while (next < input.keyframes.size() && input.keyframes[next].stamp_ns <= sample.stamp_ns) {
      ++next;
    }
    sample.odom_epoch = input.keyframes[next == 0 ? 0 : next - 1].odom_epoch;
  }
}

void write_samples(const std::string& file,
                   const std::string& comment,
                   const std::vector<lio_mapper::MapSample>& samples) {
  TrajectoryWriter writer(file, comment);
  for (const lio_mapper::MapSample& sample : samples) {
    writer.append(sample.stamp_ns, sample.T_map_base);
  }
}

void write_keyframes(const std::string& file,
                     const GraphInput& input,
                     const lio_mapper::CorrectedPast& past) {
  TrajectoryWriter writer(file, past.frame == "map" ? kCorrectedInMap : kCorrectedInOdom);
  for (std::size_t i = 0; i < input.keyframes.size(); ++i) {
    if (past.T_map_base[i]) {
      writer.append(input.keyframes[i].stamp_ns, *past.T_map_base[i]);
    }
  }
}

[[noreturn]] void refuse(const std::string& file,
                         const std::string& key,
                         const std::string& rule,
                         const YAML::Node& found) {
  throw std::runtime_error(file + ":" + std::to_string(found.Mark().line + 1) + ": " + key +
                           " must be " + rule + "; is " + YAML::Dump(found));
}

bool is_there(const YAML::Node& node) {
  return node && !node.IsNull();
}

void widen(const YAML::Node& drift, const char* key, const std::string& file, double& sigma) {
  const YAML::Node entry = drift[key];
  double value = sigma;
  if (is_there(entry) &&
      !(YAML::convert<double>::decode(entry, value) && std::isfinite(value) && value >= 0.0)) {
    refuse(file, std::string("lio_mapper.drift.") + key, "a number, 0 or more", entry);
  }
  sigma = std::max(sigma, value);
}

PastSettings read_past_settings(const std::string& file) {
  PastSettings settings;
  const YAML::Node config = YAML::LoadFile(file);
  if (const YAML::Node mapper = config["lio_mapper"]; is_there(mapper)) {
    if (const YAML::Node drift = mapper["drift"]; is_there(drift)) {
      if (!drift.IsMap()) {
        refuse(file, "lio_mapper.drift", "a mapping of keys to values", drift);
      }
      widen(drift, "position_sigma_m_sqrtm", file, settings.drift.position_sigma_m_sqrtm);
      widen(drift, "yaw_sigma_rad_sqrtm", file, settings.drift.yaw_sigma_rad_sqrtm);
      widen(drift, "tilt_sigma_rad_sqrtm", file, settings.drift.tilt_sigma_rad_sqrtm);
    }
  }
  if (const YAML::Node robot = config["robot"];
      is_there(robot) && is_there(robot["lidar_position_base_m"])) {
    const YAML::Node entry = robot["lidar_position_base_m"];
    std::vector<double> p;
    if (!YAML::convert<std::vector<double>>::decode(entry, p) || p.size() != 3 ||
        !std::all_of(p.begin(), p.end(), [](double each) { return std::isfinite(each); })) {
      refuse(file, "robot.lidar_position_base_m", "three numbers", entry);
    }
    settings.lidar_position_base_m = {p[0], p[1], p[2]};
  }
  return settings;
}

}  // namespace

PastSettings past_settings_of(const std::string& session) {
  const std::string file = path_in(session, session_file::kConfig);
  if (!fs::exists(file)) {
    return {};
  }
  try {
    return read_past_settings(file);
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(file + ": not the configuration of a run: " + error.what());
  }
}

GraphInput graph_input_of(const std::string& session, DamagedAlignment damaged) {
  GraphInput input;
  input.drift = past_settings_of(session).drift;
  KeyframeReader store(path_in(session, session_file::kKeyframes));
  store.visit_places([&](const lio_mapper::Keyframe& keyframe) {
    input.keyframes.push_back(graph_keyframe_of(keyframe));
  });
  store.visit_rows([&](const lio_mapper::StoredRow& row) { input.rows.push_back(row); });
  const std::string alignment = path_in(session, session_file::kAlignment);
  if (fs::exists(alignment)) {
    try {
      input.fallback = read_alignment(alignment).alignment;
    } catch (const std::runtime_error&) {
      if (damaged == DamagedAlignment::kIsError) {
        throw;
      }
    }
  }
  const std::string lio = path_in(session, session_file::kLio);
  if (fs::exists(lio) && !input.keyframes.empty()) {
    for (const StampedPose& pose : read_trajectory(lio)) {
      input.trajectory.push_back({pose.stamp_ns, 0, pose.pose});
    }
    assign_epochs(input);
  }
  return input;
}

lio_mapper::PoseGraphReport correct_session(const std::string& session,
                                            const std::function<void(double)>& progress) {
  const std::string smoothed = path_in(session, session_file::kFusedSmoothed);
  const std::string keyframes = path_in(session, session_file::kKeyframePoses);
  fs::remove(smoothed);
  fs::remove(keyframes);
  const GraphInput input = graph_input_of(session);
  KeyframeReader store(path_in(session, session_file::kKeyframes));
  const lio_mapper::CorrectedPast past = lio_mapper::correct_past(
      input,
      [&](std::size_t index) {
        auto keyframe = store.at(index);
        return keyframe ? std::move(keyframe->points_base) : PointCloud{};
      },
      {},
      progress);
  if (input.keyframes.empty()) {
    return past.report;
  }
  write_keyframes(keyframes, input, past);
  if (past.frame == "map" && !input.trajectory.empty()) {
    write_samples(smoothed,
                  "base_link in map, the corrected past of every sweep",
                  lio_mapper::corrected_trajectory(input, past));
  }
  return past.report;
}

std::optional<CorrectedPoses> read_corrected(const std::string& session) {
  const std::string file = path_in(session, session_file::kKeyframePoses);
  if (!fs::exists(file)) {
    return std::nullopt;
  }
  CorrectedPoses corrected;
  std::string head;
  std::getline(std::ifstream(file), head);
  corrected.frame = head.find(kCorrectedInOdom) == std::string::npos ? "map" : "odom";
  for (const StampedPose& pose : read_trajectory(file)) {
    corrected.T_frame_base[pose.stamp_ns] = pose.pose;
  }
  return corrected;
}

}  // namespace trigpoint::exporter
