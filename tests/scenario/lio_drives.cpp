// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "lio_drives.hpp"

#include "trigpoint/base/so3.hpp"
#include "trigpoint/lio_mapper/relative_covariance.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <future>
#include <variant>

namespace trigpoint {

using Eigen::Matrix3d;
using Eigen::Vector3d;

bool LioDrive::said(const std::string& code) const {
  return std::any_of(
      events.begin(), events.end(), [&](const Event& event) { return event.code == code; });
}

LioDrive drive_lio(const simulator::Scenario& scenario,
                   std::uint64_t seed,
                   const LioDriveOptions& options) {
  const auto reader = simulator::open_scenario(scenario, seed, options.duration_s);
  const auto truth = reader->truth();
  RobotConfig robot = scenario.robot;
  if (options.change_robot) {
    options.change_robot(robot);
  }
  lio_mapper::LioMapper mapper(options.config, robot);
  LioDrive drive;
  drive.end_s = to_seconds(truth->last_ns() - truth->first_ns());
  const auto take = [&](lio_mapper::Output output) {
    drive.events.insert(drive.events.end(), output.events.begin(), output.events.end());
    for (lio_mapper::ScanResult& scan : output.scans) {
      LioSample sample;
      sample.time_s = to_seconds(scan.odometry.stamp_ns - scenario.start_ns());
      sample.truth = truth->at(scan.odometry.stamp_ns).T_map_base;
      sample.odometry = scan.odometry;
      sample.status = scan.status;
      sample.calibration = mapper.calibration();
      sample.keyframe = scan.keyframe.has_value();
      if (!drive.samples.empty()) {
        drive.true_length_m += (sample.truth.p - drive.samples.back().truth.p).norm();
      }
      drive.samples.push_back(std::move(sample));
    }
  };
  while (const auto entry = reader->next()) {
    if (const auto* imu = std::get_if<ImuSample>(&entry->measurement)) {
      take(mapper.on_imu(*imu));
    } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry->measurement)) {
      take(mapper.on_cloud(*cloud));
    }
  }
  take(mapper.finish());
  drive.status = mapper.status();
  drive.calibration = mapper.calibration();
  return drive;
}

std::vector<LioDrive> drive_lio_all(int runs, const std::function<LioDrive(int)>& drive) {
  std::vector<LioDrive> results(static_cast<std::size_t>(runs));
  const auto every_second = [&](int first) {
    for (int i = first; i < runs; i += 2) {
      results[static_cast<std::size_t>(i)] = drive(i);
    }
  };
  auto other = std::async(std::launch::async, every_second, 1);
  every_second(0);
  other.get();
  return results;
}

evaluation::AbsoluteError aligned_error(const LioDrive& drive) {
  std::vector<evaluation::PosePair> pairs;
  for (const LioSample& s : drive.samples) {
    pairs.push_back({s.odometry.stamp_ns, s.odometry.T_frame_child, s.truth});
  }
  const auto T = evaluation::align(pairs, evaluation::AlignmentKind::kYawTranslation);
  return evaluation::absolute_error(T ? evaluation::place_estimates(*T, pairs) : pairs);
}

double RelativeError::nees_per_axis() const {
  return error.dot(covariance.ldlt().solve(error)) / 6.0;
}

RelativeError relative_error(const LioSample& from, const LioSample& to) {
  const Pose& a = from.odometry.T_frame_child;
  const Pose estimated = a.inverse() * to.odometry.T_frame_child;
  const Pose true_change = from.truth.inverse() * to.truth;
  RelativeError result;
  result.error.head<3>() = a.q * (estimated.p - true_change.p);
  result.error.tail<3>() = a.q * so3_log(estimated.q * true_change.q.conjugate());
  result.covariance = lio_mapper::relative_pose_covariance(
      {a, from.odometry.pose_covariance, from.status.sigma},
      {to.odometry.T_frame_child, to.odometry.pose_covariance, to.status.sigma});
  return result;
}

std::vector<RelativeError> relative_errors(const LioDrive& drive,
                                           double distance_m,
                                           double step_m) {
  std::vector<double> way_m;
  for (std::size_t i = 0; i < drive.samples.size(); ++i) {
    way_m.push_back(i == 0 ? 0.0
                           : way_m.back() +
                                 (drive.samples[i].truth.p - drive.samples[i - 1].truth.p).norm());
  }
  std::vector<RelativeError> errors;
  std::size_t from = 0;
  for (double begin_m = 0.0; from < way_m.size(); begin_m += step_m) {
    while (from < way_m.size() && way_m[from] < begin_m) {
      ++from;
    }
    const auto to = std::lower_bound(way_m.begin(), way_m.end(), begin_m + distance_m);
    if (from >= way_m.size() || to == way_m.end()) {
      break;
    }
    errors.push_back(relative_error(drive.samples[from],
                                    drive.samples[static_cast<std::size_t>(to - way_m.begin())]));
  }
  return errors;
}

}  // namespace trigpoint
