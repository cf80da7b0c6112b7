// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the mapper finds out about its sensors, on simulated drives whose truth is known.
#include "trigpoint/base/so3.hpp"

#include "lio_drives.hpp"
#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <cstdio>

namespace trigpoint {

namespace {

constexpr int kSeeds = 3;
constexpr double kClockTolerance_ms = 2.0;
constexpr double kDegree = 3.14159265358979 / 180.0;

Eigen::Matrix<double, 6, 1> extrinsic_error(const lio_mapper::Calibration& calibration,
                                            const Pose& truth) {
  Eigen::Matrix<double, 6, 1> e;
  e.head<3>() = calibration.T_base_lidar.p - truth.p;
  e.tail<3>() = so3_log(truth.q.conjugate() * calibration.T_base_lidar.q);
  return e;
}

LioDriveOptions estimating(bool estimate, bool wrong) {
  LioDriveOptions options;
  options.config.extrinsic.estimate = estimate;
  if (wrong) {
    options.change_robot = [](RobotConfig& robot) {
      const double turn = 2.0 * kDegree / std::sqrt(3.0);
      const double shift = 0.05 / std::sqrt(3.0);
      robot.lidar_roll_pitch_yaw_base_rad += Eigen::Vector3d(turn, -turn, turn);
      robot.lidar_position_base_m += Eigen::Vector3d(shift, -shift, shift);
    };
  }
  return options;
}

constexpr double kRollPitchTolerance_deg = 0.15;
constexpr double kYawTolerance_deg = 0.75;  // turns do not show it
constexpr double kMostNees = 3.0;
constexpr double kLeastNees = 0.05;

/// Roll, pitch and yaw about base's axes.
Eigen::Vector3d turn_error_deg(const lio_mapper::Calibration& calibration, const Pose& truth) {
  return so3_log(calibration.T_base_lidar.q * truth.q.conjugate()) / kDegree;
}

double rotation_nees(const lio_mapper::Calibration& calibration, const Pose& truth) {
  const Eigen::Vector3d e = extrinsic_error(calibration, truth).tail<3>();
  const Eigen::Matrix3d P = calibration.extrinsic_covariance.bottomRightCorner<3, 3>();
  return e.dot(P.ldlt().solve(e)) / 3.0;
}

TEST(Extrinsic, rotation_is_found_and_a_right_configuration_costs_nothing) {
  const simulator::Scenario scenario = simulator::load_scenario("campus");
  std::printf(
      "right/wrong est  seed  mean m   level   up  | roll pitch yaw deg (sigma) | x y z cm "
      "(sigma) | rotation's nees/3\n");
  double nees = 0.0;
  double exact_m = 0.0;
  double estimated_m = 0.0;
  for (const bool wrong : {false, true}) {
    for (const bool estimate : {false, true}) {
      const auto drives = drive_lio_all(kSeeds, [&](int i) {
        return drive_lio(scenario, static_cast<std::uint64_t>(i + 1), estimating(estimate, wrong));
      });
      for (int i = 0; i < kSeeds; ++i) {
        const LioDrive& drive = drives[static_cast<std::size_t>(i)];
        const evaluation::AbsoluteError error = aligned_error(drive);
        std::printf("%s %d %d  %6.3f %6.3f %6.3f",
                    wrong ? "wrong" : "right",
                    estimate,
                    i + 1,
                    error.position_m.mean,
                    error.horizontal_m.rmse,
                    error.axes_m[2].rmse);
        if (estimate) {
          for (const double at_s : {10.0, 40.0, 80.0, 200.0}) {
            const LioSample* at = &drive.samples.front();
            for (const LioSample& s : drive.samples) {
              if (s.time_s <= at_s) {
                at = &s;
              }
            }
            const auto e = extrinsic_error(at->calibration, scenario.robot.T_base_lidar());
            const Matrix6d& P = at->calibration.extrinsic_covariance;
            const Eigen::Matrix<double, 6, 1> s = P.diagonal().cwiseSqrt();
            std::printf(
                "\n   t %3.0f | %6.3f %6.3f %6.3f (%5.3f %5.3f %5.3f) | %5.2f %5.2f %5.2f (%5.2f "
                "%5.2f %5.2f) | %.2f",
                at_s,
                e[3] / kDegree,
                e[4] / kDegree,
                e[5] / kDegree,
                s[3] / kDegree,
                s[4] / kDegree,
                s[5] / kDegree,
                100 * e[0],
                100 * e[1],
                100 * e[2],
                100 * s[0],
                100 * s[1],
                100 * s[2],
                rotation_nees(at->calibration, scenario.robot.T_base_lidar()));
          }
          const Eigen::Vector3d turn_deg =
              turn_error_deg(drive.calibration, scenario.robot.T_base_lidar());
          EXPECT_LT(turn_deg.head<2>().cwiseAbs().maxCoeff(), kRollPitchTolerance_deg);
          EXPECT_LT(std::abs(turn_deg[2]), kYawTolerance_deg);
          EXPECT_EQ(drive.said("extrinsic_differs"), wrong);
          EXPECT_TRUE(drive.said("extrinsic_settled"));
          nees += rotation_nees(drive.calibration, scenario.robot.T_base_lidar()) / (2.0 * kSeeds);
        }
        if (!wrong) {
          (estimate ? estimated_m : exact_m) += error.position_m.mean;
        }
        std::printf("\n");
      }
    }
  }
  EXPECT_GT(nees, kLeastNees);
  EXPECT_LT(nees, kMostNees);
  EXPECT_LT(estimated_m, 1.1 * exact_m);
}

TEST(LidarClock, offset_is_found_within_two_milliseconds_and_warned_about_only_when_there_is_one) {
  const std::vector<double> offsets_ms{-30.0, -10.0, 0.0, 10.0, 30.0};
  const auto drives = drive_lio_all(static_cast<int>(offsets_ms.size()), [&](int i) {
    LioDriveOptions options;
    options.config.sweep.time_offset_s = -1e-3 * offsets_ms[static_cast<std::size_t>(i)];
    return drive_lio(
        simulator::load_scenario("campus"), static_cast<std::uint64_t>(i + 1), options);
  });
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const LioDrive& drive = drives[i];
    std::printf("offset %5.1f ms:", offsets_ms[i]);
    for (const double at_s : {20.0, 30.0, 50.0, 80.0, 200.0}) {
      const LioSample* at = &drive.samples.front();
      for (const LioSample& s : drive.samples) {
        if (s.time_s <= at_s) {
          at = &s;
        }
      }
      std::printf("  %6.2f (%4.2f)",
                  1e3 * at->calibration.clock_offset_s,
                  1e3 * at->calibration.clock_offset_sigma_s);
    }
    std::printf("  %s\n", drive.said("lidar_clock_offset") ? "warned" : "");
    EXPECT_NEAR(1e3 * drive.calibration.clock_offset_s, offsets_ms[i], kClockTolerance_ms);
    EXPECT_EQ(drive.said("lidar_clock_offset"), offsets_ms[i] != 0.0);
  }
}

}  // namespace

}  // namespace trigpoint
