// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/log.hpp"

#include "kitti_drive.hpp"

#include <cstring>
#include <fstream>

namespace trigpoint::recording {

namespace {

constexpr std::size_t kFileStep = 4 * sizeof(float);   // x y z reflectance
constexpr std::size_t kCloudStep = 5 * sizeof(float);  // and time
constexpr std::uint8_t kFloat32 = 7;

std::vector<char> read_bytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  if (!stream) {
    throw LogError(file.string() + ": cannot be read");
  }
  std::vector<char> bytes(static_cast<std::size_t>(stream.tellg()));
  stream.seekg(0);
  stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!stream || bytes.size() % kFileStep != 0) {
    throw LogError(file.string() + ": " + std::to_string(bytes.size()) +
                   " bytes are not a whole number of points of " + std::to_string(kFileStep) +
                   " bytes; the file is truncated");
  }
  return bytes;
}

PointCloudMessage empty_cloud(const KittiSweep& sweep) {
  PointCloudMessage cloud;
  cloud.stamp_ns = sweep.start_ns;
  cloud.frame_id = "velodyne";
  const char* const names[] = {"x", "y", "z", "intensity", "time"};
  for (std::uint32_t i = 0; i < 5; ++i) {
    cloud.fields.push_back({names[i], i * static_cast<std::uint32_t>(sizeof(float)), kFloat32, 1});
  }
  cloud.point_step = kCloudStep;
  return cloud;
}

}  // namespace

PointCloudMessage load_kitti_sweep(const KittiSweep& sweep) {
  const auto bytes = read_bytes(sweep.file);
  const std::size_t points = bytes.size() / kFileStep;
  const double duration_s = to_seconds(sweep.end_ns - sweep.start_ns);
  PointCloudMessage cloud = empty_cloud(sweep);
  cloud.width = static_cast<std::uint32_t>(points);
  cloud.row_step = cloud.width * cloud.point_step;
  cloud.data.resize(points * kCloudStep);
  for (std::size_t i = 0; i < points; ++i) {
    float values[5];
    std::memcpy(values, bytes.data() + i * kFileStep, kFileStep);
    values[4] = kitti_point_time_s(values[0], values[1], duration_s);
    std::memcpy(cloud.data.data() + i * kCloudStep, values, kCloudStep);
  }
  return cloud;
}

}  // namespace trigpoint::recording
