// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "kitti_route.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <sstream>
#include <utility>

namespace trigpoint::gps_odometry {

namespace {

using Row = std::vector<double>;

/// Rows of numbers of what a command prints, without the header.
std::vector<Row> rows_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::vector<Row> rows;
  std::array<char, 1024> line{};
  bool header = true;
  while (pipe && std::fgets(line.data(), line.size(), pipe.get()) != nullptr) {
    if (std::exchange(header, false)) {
      continue;
    }
    Row row;
    std::stringstream text(line.data());
    for (std::string cell; std::getline(text, cell, ',');) {
      row.push_back(std::stod(cell));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

std::optional<KittiRoute> read_kitti_route(const std::string& number, const std::string& drive) {
  const std::string folder = std::string(TRIGPOINT_SHARED_DATA) + "/kitti_gnss_imu/";
  const std::string positions = folder + number + "_" + drive + ".csv";
  if (!std::filesystem::exists(positions)) {
    return std::nullopt;
  }
  KittiRoute route;
  for (const Row& row : rows_of("cat '" + positions + "'")) {
    route.stamps_ns.push_back(from_seconds(row.at(0)));
    route.places.push_back({row.at(1), row.at(2), row.at(3)});
  }
  for (const Row& row : rows_of("xz -dc '" + folder + drive + ".csv.xz'")) {
    ImuSample sample;
    sample.stamp_ns = from_seconds(row.at(0));
    sample.gyro_radps = {row.at(1), row.at(2), row.at(3)};
    sample.accel_mps2 = {row.at(4), row.at(5), row.at(6)};
    route.imu.push_back(sample);
  }
  if (route.imu.empty() || route.places.empty()) {
    return std::nullopt;
  }
  return route;
}

}  // namespace trigpoint::gps_odometry
