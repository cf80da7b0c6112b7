// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/map.hpp"

#include "pcd_head.hpp"
#include "pcd_writer.hpp"
#include <pcl/PCLPointCloud2.h>
#include <pcl/io/pcd_io.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <vector>

namespace trigpoint::exporter {

namespace {

/// Byte offset of a float32 field; -1 when there is none.
int offset_of(const pcl::PCLPointCloud2& cloud, const std::string& name) {
  const auto field = std::find_if(cloud.fields.begin(), cloud.fields.end(), [&](const auto& f) {
    return f.name == name && f.datatype == pcl::PCLPointField::FLOAT32;
  });
  return field == cloud.fields.end() ? -1 : static_cast<int>(field->offset);
}

float float_at(const std::uint8_t* point, int offset) {
  float value = 0.0F;
  if (offset >= 0) {
    std::memcpy(&value, point + offset, sizeof(value));
  }
  return value;
}

/// Byte offsets of a point's float32 fields; -1: there is none.
struct PointLayout {
  int x{-1};
  int y{-1};
  int z{-1};
  int intensity{-1};

  /// `offset_of` gives the offset of a field by its name.
  template <typename OffsetOf>
  PointLayout(const std::string& file, const OffsetOf& offset_of)
      : x(offset_of("x")), y(offset_of("y")), z(offset_of("z")), intensity(offset_of("intensity")) {
    if (x < 0 || y < 0 || z < 0) {
      throw std::runtime_error(file + ": has no x, y and z of type float32");
    }
  }

  PointXyzi point_at(const std::uint8_t* point) const {
    return {float_at(point, x), float_at(point, y), float_at(point, z), float_at(point, intensity)};
  }
};

void require(const std::string& file) {
  if (!std::filesystem::exists(file)) {
    throw std::runtime_error(file + ": no such file");
  }
}

/// Of a file whose head was read: PCL crashes on one that is none.
PointCloud read_with_pcl(const std::string& file) {
  pcl::PCLPointCloud2 raw;
  if (pcl::PCDReader().read(file, raw) != 0) {
    throw std::runtime_error(file + ": not a readable PCD file");
  }
  const PointLayout layout(file, [&](const char* name) { return offset_of(raw, name); });
  PointCloud cloud;
  for (std::size_t at = 0; at + raw.point_step <= raw.data.size(); at += raw.point_step) {
    cloud.push_back(layout.point_at(raw.data.data() + at));
  }
  return cloud;
}

/// 1 MB of a map.
constexpr std::size_t kPointsAtOnce = 65536;

}  // namespace

void write_pcd(const std::string& file, const PointCloud& cloud) {
  PcdWriter writer(file);
  writer.append(cloud);
  writer.finish();
}

std::string frame_of_pcd(const std::string& file) {
  const std::string key = "# frame ";
  std::ifstream in(file, std::ios::binary);
  for (std::string line; std::getline(in, line) && line.starts_with('#');) {
    if (line.starts_with(key)) {
      return line.substr(key.size());
    }
  }
  return "";
}

PointCloud read_pcd(const std::string& file) {
  PointCloud cloud;
  visit_pcd(file, [&](const PointCloud& points, double) {
    cloud.insert(cloud.end(), points.begin(), points.end());
  });
  return cloud;
}

void visit_pcd(const std::string& file,
               const std::function<void(const PointCloud& points, double share)>& visit) {
  require(file);
  const PcdHead head = read_pcd_head(file);
  if (head.storage != "binary") {
    PointCloud cloud = read_with_pcl(file);
    std::erase_if(cloud, [](const PointXyzi& point) { return !point.position().allFinite(); });
    visit(cloud, 1.0);
    return;
  }
  const PointLayout layout(file, [&](const char* name) { return head.offset_of(name); });
  const std::size_t points = head.points;
  std::ifstream in(file, std::ios::binary);
  in.seekg(static_cast<std::streamoff>(head.data_begin));
  std::vector<char> bytes;
  for (std::size_t done = 0; done < points;) {
    const std::size_t count = std::min(kPointsAtOnce, points - done);
    bytes.resize(count * head.point_bytes);
    if (!in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) {
      throw std::runtime_error(file + ": ends after " + std::to_string(done) + " of " +
                               std::to_string(points) + " points");
    }
    PointCloud cloud;
    for (std::size_t i = 0; i < count; ++i) {
      const auto* at = reinterpret_cast<const std::uint8_t*>(bytes.data() + i * head.point_bytes);
      const PointXyzi point = layout.point_at(at);
      if (point.position().allFinite()) {
        cloud.push_back(point);
      }
    }
    done += count;
    visit(cloud, static_cast<double>(done) / static_cast<double>(points));
  }
}

}  // namespace trigpoint::exporter
