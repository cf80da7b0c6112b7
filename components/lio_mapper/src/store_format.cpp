// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "store_format.hpp"

#include <algorithm>
#include <sstream>

namespace trigpoint::lio_mapper::store {

StateNumbers state_numbers_of(const Checkpoint& c) {
  StateNumbers numbers{};
  auto* at = numbers.data();
  const auto put = [&](const auto& values) { at = std::copy(values.begin(), values.end(), at); };
  put(numbers_of(c.T_odom_base));
  put(c.v_odom_mps);
  put(c.gyro_bias_radps);
  put(c.accel_bias_mps2);
  put(c.gravity_odom_mps2);
  put(numbers_of(c.T_map_odom));
  put(numbers_of(c.reset.delta));
  return numbers;
}

void set_state(const StateNumbers& numbers, Checkpoint& c) {
  const auto* at = numbers.data();
  const auto take = [&](auto& values) {
    std::copy_n(at, values.size(), values.data());
    at += values.size();
  };
  PoseNumbers pose{};
  YawPoseNumbers T_map_odom{};
  YawPoseNumbers reset{};
  take(pose);
  take(c.v_odom_mps);
  take(c.gyro_bias_radps);
  take(c.accel_bias_mps2);
  take(c.gravity_odom_mps2);
  take(T_map_odom);
  take(reset);
  c.T_odom_base = pose_of(pose);
  c.T_map_odom = yaw_pose_of(T_map_odom);
  c.reset.delta = yaw_pose_of(reset);
}

std::string text_of(const std::vector<NamedCount>& counts) {
  std::string text;
  for (const NamedCount& count : counts) {
    text += count.name + " " + std::to_string(count.count) + "\n";
  }
  return text;
}

std::vector<NamedCount> counts_of(const std::string& text) {
  std::vector<NamedCount> counts;
  std::istringstream lines(text);
  NamedCount count;
  while (lines >> count.name >> count.count) {
    counts.push_back(count);
  }
  return counts;
}

}  // namespace trigpoint::lio_mapper::store
