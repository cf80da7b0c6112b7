// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/messages.hpp"

#include <cstdio>
#include <cstring>

namespace trigpoint {

std::string Datum::id() const {
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "%.9f %.9f %.4f", latitude_deg, longitude_deg, height_m);
  return text.data();
}

PointCloudMessage to_cloud_message(const PointCloud& cloud,
                                   Nanoseconds stamp_ns,
                                   const std::string& frame_id) {
  constexpr std::uint8_t kFloat32 = 7;
  PointCloudMessage message;
  message.stamp_ns = stamp_ns;
  message.frame_id = frame_id;
  message.width = static_cast<std::uint32_t>(cloud.size());
  message.fields = {{"x", 0, kFloat32, 1},
                    {"y", 4, kFloat32, 1},
                    {"z", 8, kFloat32, 1},
                    {"intensity", 12, kFloat32, 1}};
  message.point_step = sizeof(PointXyzi);
  message.row_step = message.point_step * message.width;
  message.data.resize(message.row_step);
  if (!cloud.empty()) {
    std::memcpy(message.data.data(), cloud.data(), message.data.size());
  }
  return message;
}

}  // namespace trigpoint
