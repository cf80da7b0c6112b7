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
  if (!std::filesystem::exists(file)) {
    throw std::runtime_error(file + ": no such file");
  }
  pcl::PCLPointCloud2 raw;
  if (pcl::PCDReader().read(file, raw) != 0) {
    throw std::runtime_error(file + ": not a readable PCD file");
  }
  const int x = offset_of(raw, "x");
  const int y = offset_of(raw, "y");
  const int z = offset_of(raw, "z");
  if (x < 0 || y < 0 || z < 0) {
    throw std::runtime_error(file + ": has no x, y and z of type float32");
  }
  const int intensity = offset_of(raw, "intensity");
  PointCloud cloud;
  for (std::size_t at = 0; at + raw.point_step <= raw.data.size(); at += raw.point_step) {
    const std::uint8_t* point = raw.data.data() + at;
    cloud.push_back(
        {float_at(point, x), float_at(point, y), float_at(point, z), float_at(point, intensity)});
  }
  return cloud;
}

}  // namespace trigpoint::exporter
