// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "cloud_layout.hpp"

#include "trigpoint/base/time.hpp"

#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace trigpoint::simulator {

namespace {

// sensor_msgs/PointField
constexpr std::uint8_t kUint8 = 2;
constexpr std::uint8_t kUint16 = 4;
constexpr std::uint8_t kUint32 = 6;
constexpr std::uint8_t kFloat32 = 7;
constexpr std::uint8_t kFloat64 = 8;

template <typename Value>
void put(std::uint8_t* point, std::size_t offset, Value value) {
  std::memcpy(point + offset, &value, sizeof value);
}

void put_place(std::uint8_t* to, const CloudPoint& point, std::size_t intensity_offset) {
  std::memcpy(to, point.p_lidar_m.data(), 12);
  put(to, intensity_offset, point.intensity);
}

struct Layout {
  std::string name;
  std::uint32_t point_bytes;
  std::vector<PointField> fields;
  void (*write)(std::uint8_t*, const CloudPoint&, Nanoseconds);
};

void write_velodyne(std::uint8_t* to, const CloudPoint& point, Nanoseconds) {
  put_place(to, point, 12);
  put(to, 16, point.ring);
  put(to, 18, static_cast<float>(point.time_s));
}

void write_no_time(std::uint8_t* to, const CloudPoint& point, Nanoseconds) {
  put_place(to, point, 12);
  put(to, 16, point.ring);
}

void write_ouster(std::uint8_t* to, const CloudPoint& point, Nanoseconds) {
  put_place(to, point, 16);
  put(to, 20, static_cast<std::uint32_t>(std::lround(point.time_s * 1e9)));
  put(to, 24, static_cast<std::uint16_t>(point.intensity));
  put(to, 26, point.ring);
  const float range_mm = 1000.0F * point.p_lidar_m.norm();
  put(to, 32, std::isfinite(range_mm) ? static_cast<std::uint32_t>(range_mm) : 0U);
}

void write_hesai(std::uint8_t* to, const CloudPoint& point, Nanoseconds stamp_ns) {
  put_place(to, point, 16);
  put(to, 24, to_seconds(stamp_ns) + point.time_s);
  put(to, 32, point.ring);
}

void write_livox(std::uint8_t* to, const CloudPoint& point, Nanoseconds stamp_ns) {
  put_place(to, point, 12);
  put(to, 17, static_cast<std::uint8_t>(point.ring));
  put(to, 18, static_cast<double>(stamp_ns) + 1e9 * point.time_s);
}

const std::array<Layout, 5>& layouts() {
  static const PointField x{"x", 0, kFloat32, 1};
  static const PointField y{"y", 4, kFloat32, 1};
  static const PointField z{"z", 8, kFloat32, 1};
  static const std::array<Layout, 5> all{{
      {"velodyne",
       22,
       {x,
        y,
        z,
        {"intensity", 12, kFloat32, 1},
        {"ring", 16, kUint16, 1},
        {"time", 18, kFloat32, 1}},
       &write_velodyne},
      {"ouster",
       48,
       {x,
        y,
        z,
        {"intensity", 16, kFloat32, 1},
        {"t", 20, kUint32, 1},
        {"reflectivity", 24, kUint16, 1},
        {"ring", 26, kUint16, 1},
        {"ambient", 28, kUint16, 1},
        {"range", 32, kUint32, 1}},
       &write_ouster},
      {"hesai",
       48,
       {x,
        y,
        z,
        {"intensity", 16, kFloat32, 1},
        {"timestamp", 24, kFloat64, 1},
        {"ring", 32, kUint16, 1}},
       &write_hesai},
      {"livox",
       26,
       {x,
        y,
        z,
        {"intensity", 12, kFloat32, 1},
        {"tag", 16, kUint8, 1},
        {"line", 17, kUint8, 1},
        {"timestamp", 18, kFloat64, 1}},
       &write_livox},
      {"no_time",
       18,
       {x, y, z, {"intensity", 12, kFloat32, 1}, {"ring", 16, kUint16, 1}},
       &write_no_time},
  }};
  return all;
}

const Layout& layout_called(const std::string& name) {
  for (const Layout& layout : layouts()) {
    if (layout.name == name) {
      return layout;
    }
  }
  throw std::invalid_argument("no cloud layout is called '" + name + "'");
}

}  // namespace

std::vector<std::string> cloud_layout_names() {
  std::vector<std::string> names;
  for (const Layout& layout : layouts()) {
    names.push_back(layout.name);
  }
  return names;
}

PointCloudMessage pack_cloud(const std::string& layout_name,
                             Nanoseconds stamp_ns,
                             const std::vector<CloudPoint>& points) {
  const Layout& layout = layout_called(layout_name);
  PointCloudMessage message;
  message.stamp_ns = stamp_ns;
  message.frame_id = "lidar";
  message.fields = layout.fields;
  message.point_step = layout.point_bytes;
  message.width = static_cast<std::uint32_t>(points.size());
  message.row_step = message.width * message.point_step;
  message.data.resize(message.row_step);
  std::uint8_t* at = message.data.data();
  for (const CloudPoint& point : points) {
    layout.write(at, point, stamp_ns);
    at += layout.point_bytes;
  }
  return message;
}

}  // namespace trigpoint::simulator
