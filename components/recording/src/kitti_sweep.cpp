// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/log.hpp"

#include "kitti_drive.hpp"

#include <cmath>
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

/// (horizontal distance, z) turned by the angle; the azimuth stays. On the axis there is no azimuth
/// to turn along.
void raise(float* xyz_m, double angle_rad) {
  const double horizontal_m = std::hypot(xyz_m[0], xyz_m[1]);
  if (angle_rad == 0.0 || horizontal_m == 0.0) {
    return;
  }
  const double z_m = xyz_m[2];
  const double scale = std::cos(angle_rad) - std::sin(angle_rad) * z_m / horizontal_m;
  xyz_m[0] = static_cast<float>(scale * xyz_m[0]);
  xyz_m[1] = static_cast<float>(scale * xyz_m[1]);
  xyz_m[2] = static_cast<float>(std::sin(angle_rad) * horizontal_m + std::cos(angle_rad) * z_m);
}

}  // namespace

PointCloudMessage load_kitti_sweep(const KittiSweep& sweep, double elevation_correction_rad) {
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
    raise(values, elevation_correction_rad);
    std::memcpy(cloud.data.data() + i * kCloudStep, values, kCloudStep);
  }
  return cloud;
}

}  // namespace trigpoint::recording
