// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "kitti_drive.hpp"

#include "trigpoint/base/so3.hpp"
#include "trigpoint/recording/log.hpp"

#include "text_table.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace trigpoint::recording {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kOxtsNumbers = 30;
constexpr Nanoseconds kNanosecondsPerDay = 86'400 * kNanosecondsPerSecond;

// Columns of an OXTS record, oxts/dataformat.txt counted from 0.
enum Oxts : std::size_t {
  kLat = 0,
  kLon = 1,
  kAlt = 2,
  kAx = 11,
  kWx = 17,
  kPosAccuracy = 23,
  kPosMode = 27
};

bool is_sync_folder(const fs::path& path) {
  return fs::is_directory(path / "velodyne_points") || fs::is_directory(path / "oxts");
}

std::vector<Nanoseconds> load_stamps(const fs::path& file) {
  std::vector<Nanoseconds> stamps;
  const auto lines = read_lines(file);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto stamp = parse_kitti_stamp(lines[i]);
    if (!stamp && lines[i].empty() && i + 1 == lines.size()) {
      break;
    }
    // The lines of sweeps that KITTI lost are blank; 0 marks them.
    if (!stamp && !lines[i].empty()) {
      throw LogError(file.string() + ":" + std::to_string(i + 1) + ": '" + lines[i] +
                     "' is not a stamp like 2011-09-26 13:08:24.905593646");
    }
    stamps.push_back(stamp.value_or(0));
  }
  return stamps;
}

fs::path numbered(const fs::path& folder, std::size_t index, const char* extension) {
  char name[32];
  std::snprintf(name, sizeof(name), "%010zu%s", index, extension);
  return folder / name;
}

std::vector<KittiSweep> list_sweeps(const fs::path& folder) {
  if (!fs::is_directory(folder)) {
    return {};
  }
  const auto starts = load_stamps(folder / "timestamps_start.txt");
  const auto ends = load_stamps(folder / "timestamps_end.txt");
  std::vector<KittiSweep> sweeps;
  for (std::size_t i = 0; i < std::min(starts.size(), ends.size()); ++i) {
    const auto file = numbered(folder / "data", i, ".bin");
    if (starts[i] > 0 && ends[i] > starts[i] && fs::is_regular_file(file)) {
      sweeps.push_back({file, starts[i], ends[i]});
    }
  }
  return sweeps;
}

/// OXTS position modes (development kit, gps_mode_to_string): 3 single point, 4 differential,
/// 5 and 6 RTK float and integer, 7 WAAS; below 3 the position is the INS's dead reckoning.
FixStatus status_of(double position_mode) {
  if (position_mode < 3.0) {
    return FixStatus::kNoFix;
  }
  if (position_mode < 4.0) {
    return FixStatus::kFix;
  }
  return position_mode == 7.0 ? FixStatus::kSbas : FixStatus::kGbas;
}

/// pos_accuracy is the root of the sum of the squares of the north and the east sigma (its square
/// is a whole number of mm^2, and vel_accuracy is 18 mm/s times the root of 2): each axis has it
/// over that root. The vertical sigma is not recorded; GNSS is commonly half as
/// bad again in height.
Eigen::Matrix3d covariance_of(double position_accuracy_m) {
  constexpr double kVerticalOverHorizontal = 1.5;
  const Eigen::Vector3d sigma = position_accuracy_m / std::numbers::sqrt2 *
                                Eigen::Vector3d(1.0, 1.0, kVerticalOverHorizontal);
  return sigma.cwiseAbs2().asDiagonal();
}

GnssFix to_fix(const std::vector<double>& record, Nanoseconds stamp_ns) {
  GnssFix fix;
  fix.stamp_ns = stamp_ns;
  fix.frame_id = "imu_link";
  fix.status = status_of(record[kPosMode]);
  fix.service = 1;
  fix.latitude_deg = record[kLat];
  fix.longitude_deg = record[kLon];
  fix.altitude_m = record[kAlt];
  fix.covariance_enu_m2 = covariance_of(record[kPosAccuracy]);
  fix.covariance_type = CovarianceType::kApproximated;
  return fix;
}

ImuSample to_imu(Nanoseconds stamp_ns, const double* gyro_radps, const double* accel_mps2) {
  ImuSample sample;
  sample.stamp_ns = stamp_ns;
  sample.frame_id = "imu_link";
  sample.gyro_radps = Eigen::Map<const Eigen::Vector3d>(gyro_radps);
  sample.accel_mps2 = Eigen::Map<const Eigen::Vector3d>(accel_mps2);
  return sample;
}

void load_oxts(KittiDrive& drive) {
  const auto folder = drive.sync_folder / "oxts";
  const auto stamps = load_stamps(folder / "timestamps.txt");
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    const auto file = numbered(folder / "data", i, ".txt");
    if (stamps[i] == 0 || !fs::is_regular_file(file)) {
      continue;
    }
    const auto lines = read_lines(file);
    const auto record =
        parse_numbers(lines.empty() ? "" : lines.front(), ' ', kOxtsNumbers, file, 1);
    const Nanoseconds stamp_ns = stamps[i] - kOxtsMinusVelodyneClock_ns;
    drive.fixes.push_back(to_fix(record, stamp_ns));
    drive.imu.push_back(to_imu(stamp_ns, &record[kWx], &record[kAx]));
  }
  drive.imu_source = "oxts";
}

/// imu100.csv: every record of the unsynchronised OXTS log, t_sod in seconds of the local day.
void load_imu100(KittiDrive& drive, const fs::path& file) {
  if (drive.fixes.empty()) {
    throw LogError(
        file.string() +
        ": its times are seconds of a day, and there is no OXTS stamp to tell which day");
  }
  const Nanoseconds midnight_ns =
      drive.fixes.front().stamp_ns / kNanosecondsPerDay * kNanosecondsPerDay;
  const auto lines = read_lines(file);
  drive.imu.clear();
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const auto row = parse_numbers(lines[i], ',', 7, file, i + 1);
    drive.imu.push_back(
        to_imu(midnight_ns + from_seconds(row[0]) - kOxtsMinusVelodyneClock_ns, &row[1], &row[4]));
  }
  drive.imu_source = "imu100.csv";
}

/// A line "name: n n n ..." of a calibration file.
std::vector<double> calibration_row(const fs::path& file,
                                    const std::string& name,
                                    std::size_t count) {
  const auto lines = read_lines(file);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].rfind(name + ":", 0) == 0) {
      return parse_numbers(lines[i].substr(name.size() + 1), ' ', count, file, i + 1);
    }
  }
  throw LogError(file.string() + ": has no line '" + name + ":'");
}

/// calib_imu_to_velo.txt holds T_lidar_imu; the robot's description wants its inverse. The OXTS
/// gives the position of its own IMU, so there is no lever arm.
RobotConfig load_robot(const fs::path& calibration) {
  const auto r = calibration_row(calibration, "R", 9);
  const auto t = calibration_row(calibration, "T", 3);
  const Eigen::Matrix3d rotation =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
  const Pose T_lidar_base(Eigen::Quaterniond(rotation).normalized(),
                          Eigen::Vector3d(t[0], t[1], t[2]));
  const Pose T_base_lidar = T_lidar_base.inverse();
  RobotConfig robot;
  robot.lidar_position_base_m = T_base_lidar.p;
  robot.lidar_roll_pitch_yaw_base_rad = roll_pitch_yaw_of(T_base_lidar.q);
  return robot;
}

/// Calibration and imu100.csv lie beside the ..._sync folder or inside it.
std::optional<fs::path> companion(const fs::path& sync_folder, const char* name) {
  for (const auto& folder : {sync_folder, sync_folder.parent_path()}) {
    if (fs::is_regular_file(folder / name)) {
      return folder / name;
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<fs::path> find_kitti_sync_folder(const fs::path& path) {
  if (!fs::is_directory(path)) {
    return std::nullopt;
  }
  const fs::path folder = fs::canonical(path);
  if (is_sync_folder(folder)) {
    return folder;
  }
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory() && is_sync_folder(entry.path())) {
      found.push_back(entry.path());
    }
  }
  if (found.size() > 1) {
    throw LogError(path.string() + ": holds " + std::to_string(found.size()) +
                   " KITTI drives; name one of them, e.g. " + found.front().string());
  }
  return found.empty() ? std::nullopt : std::optional(found.front());
}

std::optional<Nanoseconds> parse_kitti_stamp(const std::string& text) {
  int year = 0;
  unsigned month = 0;
  unsigned day = 0;
  int hour = 0;
  int minute = 0;
  int second = 0;
  char fraction[10] = "";
  if (std::sscanf(text.c_str(),
                  "%4d-%2u-%2u %2d:%2d:%2d.%9[0-9]",
                  &year,
                  &month,
                  &day,
                  &hour,
                  &minute,
                  &second,
                  fraction) != 7) {
    return std::nullopt;
  }
  const std::chrono::year_month_day date{
      std::chrono::year(year), std::chrono::month(month), std::chrono::day(day)};
  if (!date.ok()) {
    return std::nullopt;
  }
  std::string digits = fraction;
  digits.append(9 - digits.size(), '0');
  const auto days = std::chrono::sys_days(date).time_since_epoch().count();
  const Nanoseconds seconds = ((days * 24LL + hour) * 60 + minute) * 60 + second;
  return seconds * kNanosecondsPerSecond + std::stoll(digits);
}

KittiDrive load_kitti_drive(const fs::path& sync_folder) {
  KittiDrive drive;
  drive.sync_folder = sync_folder;
  drive.sweeps = list_sweeps(sync_folder / "velodyne_points");
  if (fs::is_directory(sync_folder / "oxts")) {
    load_oxts(drive);
  }
  if (const auto imu100 = companion(sync_folder, "imu100.csv")) {
    load_imu100(drive, *imu100);
  }
  if (const auto calibration = companion(sync_folder, "calib_imu_to_velo.txt")) {
    drive.robot = load_robot(*calibration);
  }
  return drive;
}

float kitti_point_time_s(float x_m, float y_m, double sweep_duration_s) {
  const double azimuth_rad = std::atan2(static_cast<double>(y_m), static_cast<double>(x_m));
  const double share = (std::numbers::pi - azimuth_rad) / (2.0 * std::numbers::pi);
  return static_cast<float>(std::clamp(share, 0.0, 1.0) * sweep_duration_s);
}

}  // namespace trigpoint::recording
