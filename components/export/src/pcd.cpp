// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/map.hpp"

#include "line_file.hpp"
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

/// Where a point has what.
class PointLayout {
 public:
  PointLayout(const pcl::PCLPointCloud2& cloud, const std::string& file)
      : x_(offset_of(cloud, "x")),
        y_(offset_of(cloud, "y")),
        z_(offset_of(cloud, "z")),
        intensity_(offset_of(cloud, "intensity")) {
    if (x_ < 0 || y_ < 0 || z_ < 0) {
      throw std::runtime_error(file + ": has no x, y and z of type float32");
    }
  }

  PointXyzi point_at(const std::uint8_t* point) const {
    return {
        float_at(point, x_), float_at(point, y_), float_at(point, z_), float_at(point, intensity_)};
  }

 private:
  int x_;
  int y_;
  int z_;
  int intensity_;
};

void require(const std::string& file) {
  if (!std::filesystem::exists(file)) {
    throw std::runtime_error(file + ": no such file");
  }
}

/// PCL's number for "DATA binary".
constexpr int kBinary = 1;
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
  require(file);
  pcl::PCLPointCloud2 raw;
  if (pcl::PCDReader().read(file, raw) != 0) {
    throw std::runtime_error(file + ": not a readable PCD file");
  }
  const PointLayout layout(raw, file);
  PointCloud cloud;
  for (std::size_t at = 0; at + raw.point_step <= raw.data.size(); at += raw.point_step) {
    cloud.push_back(layout.point_at(raw.data.data() + at));
  }
  return cloud;
}

void visit_pcd(const std::string& file,
               const std::function<void(const PointCloud& points, double share)>& visit) {
  require(file);
  pcl::PCLPointCloud2 head;
  Eigen::Vector4f origin;
  Eigen::Quaternionf orientation;
  int version = 0;
  int storage = 0;
  unsigned int data_begin = 0;
  if (pcl::PCDReader().readHeader(file, head, origin, orientation, version, storage, data_begin) !=
      0) {
    throw std::runtime_error(file + ": not a readable PCD file");
  }
  if (storage != kBinary) {
    PointCloud cloud = read_pcd(file);
    std::erase_if(cloud, [](const PointXyzi& point) { return !point.position().allFinite(); });
    visit(cloud, 1.0);
    return;
  }
  const PointLayout layout(head, file);
  const std::size_t points = static_cast<std::size_t>(head.width) * head.height;
  std::ifstream in(file, std::ios::binary);
  in.seekg(data_begin);
  std::vector<char> bytes;
  for (std::size_t done = 0; done < points;) {
    const std::size_t count = std::min(kPointsAtOnce, points - done);
    bytes.resize(count * head.point_step);
    if (!in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) {
      throw std::runtime_error(file + ": ends after " + std::to_string(done) + " of " +
                               std::to_string(points) + " points");
    }
    PointCloud cloud;
    for (std::size_t i = 0; i < count; ++i) {
      const auto* at = reinterpret_cast<const std::uint8_t*>(bytes.data() + i * head.point_step);
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
