// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "recorded_drives.hpp"

#include "trigpoint/recording/log.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

namespace trigpoint {

namespace {

using Row = std::vector<double>;

constexpr double kGravity_mps2 = 9.80665;
/// The recorders count from their own start; a filter expects a date.
constexpr Nanoseconds kDate_ns = 1'600'000'000LL * kNanosecondsPerSecond;
constexpr Nanoseconds kFixDelay_ns = 100'000'000;

std::string path_of(const std::string& name) {
  return std::string(TRIGPOINT_SHARED_DATA) + "/" + name;
}

std::vector<Row> rows_of(const std::string& file) {
  std::ifstream in(file);
  std::vector<Row> rows;
  std::string line;
  std::getline(in, line);  // header
  while (std::getline(in, line)) {
    Row row;
    std::stringstream text(line);
    for (std::string cell; std::getline(text, cell, ',');) {
      row.push_back(std::stod(cell));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

Nanoseconds stamp_of(double time_s) {
  return kDate_ns + from_seconds(time_s);
}

GnssFix fix_of(Nanoseconds stamp_ns,
               double lat_deg,
               double lon_deg,
               double height_m,
               double sigma_m) {
  GnssFix fix;
  fix.stamp_ns = stamp_ns;
  fix.status = FixStatus::kFix;
  fix.latitude_deg = lat_deg;
  fix.longitude_deg = lon_deg;
  fix.altitude_m = height_m;
  fix.covariance_enu_m2 = Eigen::Vector3d(sigma_m, sigma_m, 2.0 * sigma_m).cwiseAbs2().asDiagonal();
  fix.covariance_type = CovarianceType::kApproximated;
  return fix;
}

void sort_by_availability(RecordedDrive& drive) {
  std::stable_sort(
      drive.inputs.begin(), drive.inputs.end(), [](const RecordedInput& a, const RecordedInput& b) {
        return a.available_ns < b.available_ns;
      });
}

/// Latitude, longitude, height from Earth-centred coordinates on WGS 84: Bowring's start, Newton's
/// steps on the height (Heiskanen and Moritz, "Physical geodesy", 1967, 5-3).
geodesy::Geographic geographic_of(const Eigen::Vector3d& ecef_m) {
  constexpr double kA_m = 6378137.0;
  constexpr double kE2 = 6.69437999014e-3;
  const double level_m = ecef_m.head<2>().norm();
  double latitude = std::atan2(ecef_m.z(), level_m * (1.0 - kE2));
  double height_m = 0.0;
  for (int i = 0; i < 6; ++i) {
    const double s = std::sin(latitude);
    const double n_m = kA_m / std::sqrt(1.0 - kE2 * s * s);
    height_m = level_m / std::cos(latitude) - n_m;
    latitude = std::atan2(ecef_m.z(), level_m * (1.0 - kE2 * n_m / (n_m + height_m)));
  }
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  return {latitude * kDegrees, std::atan2(ecef_m.y(), ecef_m.x()) * kDegrees, height_m};
}

}  // namespace

std::optional<RecordedDrive> read_comma2k19() {
  const std::string folder = path_of("comma2k19_example1/");
  if (!std::filesystem::exists(folder + "imu.csv")) {
    return std::nullopt;
  }
  RecordedDrive drive;
  // How the phone hangs in the car: its reference attitudes and velocities have the motion 3.8
  // degrees above and 0.8 degrees right of its forward axis (medians; spread 0.3 and 0.1).
  constexpr double kDegree = std::numbers::pi / 180.0;
  drive.robot.imu_roll_pitch_yaw_base_rad = {0.0, 3.8 * kDegree, 0.8 * kDegree};
  for (const Row& row : rows_of(folder + "imu.csv")) {
    ImuSample sample;  // forward right down, to forward left up
    sample.stamp_ns = stamp_of(row.at(0));
    sample.gyro_radps = {row.at(1), -row.at(2), -row.at(3)};
    sample.accel_mps2 = {row.at(4), -row.at(5), -row.at(6)};
    drive.inputs.push_back({sample.stamp_ns, sample});
  }
  constexpr double kSigma_m = 1.5;
  for (const Row& row : rows_of(folder + "gnss_ublox.csv")) {
    const Nanoseconds stamp_ns = stamp_of(row.at(0));
    drive.inputs.push_back(
        {stamp_ns + kFixDelay_ns, fix_of(stamp_ns, row.at(1), row.at(2), row.at(5), kSigma_m)});
  }
  for (const Row& row : rows_of(folder + "reference_ecef.csv")) {
    drive.reference.push_back(
        {stamp_of(row.at(0)), geographic_of({row.at(1), row.at(2), row.at(3)})});
  }
  sort_by_availability(drive);
  return drive;
}

std::optional<RecordedDrive> read_smartloc() {
  const std::string file = path_of("smartloc_potsdamer_platz/lsq_fixes.csv");
  if (!std::filesystem::exists(file)) {
    return std::nullopt;
  }
  RecordedDrive drive;
  const std::vector<Row> rows = rows_of(file);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    const Nanoseconds stamp_ns = stamp_of(row.at(0));
    // What a receiver would say of itself: residuals of all satellites, averaged by the geometry.
    const double sigma_m = row.at(5) * row.at(6);
    drive.inputs.push_back(
        {stamp_ns + kFixDelay_ns, fix_of(stamp_ns, row.at(1), row.at(2), row.at(3), sigma_m)});
    drive.reference.push_back({stamp_ns, {row.at(7), row.at(8), row.at(9)}});
    if (i + 1 == rows.size()) {
      break;
    }
    // A level vehicle without bias or noise, its speed and yaw rate interpolated to 100 Hz.
    const Row& next = rows[i + 1];
    const double step_s = next.at(0) - row.at(0);
    const double forward_mps2 = (next.at(10) - row.at(10)) / step_s;
    for (double t_s = 0.0; t_s < step_s - 1e-3; t_s += 0.01) {
      const double share = t_s / step_s;
      const double speed_mps = row.at(10) + forward_mps2 * t_s;
      const double rate_radps = row.at(11) + share * (next.at(11) - row.at(11));
      ImuSample sample;
      sample.stamp_ns = stamp_ns + from_seconds(t_s);
      // The last digit differs from sample to sample, as a sensor's does.
      sample.gyro_radps = {0.0, 0.0, rate_radps + (drive.inputs.size() % 2 == 0 ? 1e-6 : -1e-6)};
      sample.accel_mps2 = {forward_mps2, speed_mps * rate_radps, kGravity_mps2};
      drive.inputs.push_back({sample.stamp_ns, sample});
    }
  }
  sort_by_availability(drive);
  return drive;
}

std::optional<RecordedDrive> read_parking_lot() {
  const std::string file = path_of("robot_localization/test1.bag");
  if (!std::filesystem::exists(file)) {
    return std::nullopt;
  }
  RecordedDrive drive;
  // Static transform of the recording: yaw -90, pitch 0, roll 90 degrees.
  drive.robot.imu_roll_pitch_yaw_base_rad = {std::numbers::pi / 2.0, 0.0, -std::numbers::pi / 2.0};
  drive.robot.fix_topic = "/fix";
  drive.robot.imu_topic = "/imu/data";
  recording::LogOptions options;
  options.require_points = false;
  const auto log = recording::open_log(file, drive.robot, options);
  while (const auto entry = log->next()) {
    if (const auto* imu = std::get_if<ImuSample>(&entry->measurement)) {
      drive.inputs.push_back({entry->receive_ns, *imu});
    } else if (const auto* fix = std::get_if<GnssFix>(&entry->measurement)) {
      drive.inputs.push_back({entry->receive_ns, *fix});
    }
  }
  return drive;
}

}  // namespace trigpoint
