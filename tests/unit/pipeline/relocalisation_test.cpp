// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Statistics over many restarts; label "long".
#include "trigpoint/base/so3.hpp"

#include "resume_drive.hpp"
#include <gtest/gtest.h>

#include <iostream>
#include <random>

namespace trigpoint::pipeline {
namespace {

constexpr int kRestarts = 20;
constexpr double kRight_m = 0.3;
constexpr double kRight_rad = 0.03;
/// Of restarts within 10 m and 30 degrees; the others begin a new epoch, which is no harm.
constexpr double kLeastSuccess = 0.9;
/// Between the even walls of a corridor nothing tells where along it one is.
constexpr double kLeastSuccessCorridor = 0.75;

struct Tally {
  int right{0};
  int wrong{0};
  int refused{0};
};

/// Restarts at random moments with the checkpoint's place put `least_m` to `most_m` beside the true
/// one.
Tally restart_often(const ResumeDrive& drive, double least_m, double most_m, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Tally tally;
  for (int i = 0; i < kRestarts; ++i) {
    const std::size_t usable = drive.scans.size() - 30;
    const auto at = 20 + static_cast<std::size_t>(unit(random) * static_cast<double>(usable - 20));
    const auto& stopped = drive.scans.at(at);
    lio_mapper::Checkpoint moved = stopped.checkpoint;
    const double away_m =
        std::sqrt(least_m * least_m + unit(random) * (most_m * most_m - least_m * least_m));
    const double direction_rad = 6.283185307 * unit(random);
    const double turn_rad = 1.047 * (unit(random) - 0.5);
    moved.T_odom_base.p +=
        away_m * Eigen::Vector3d(std::cos(direction_rad), std::sin(direction_rad), 0.0);
    moved.T_odom_base.q = (from_yaw(turn_rad) * moved.T_odom_base.q).normalized();
    moved.v_odom_mps.setZero();
    const auto resumed =
        resume(drive, moved, drive.points_until(stopped.checkpoint.stamp_ns), moved.stamp_ns, 2.4);
    if (!said(resumed.events, "lio_resumed")) {
      ++tally.refused;
      for (const Event& e : resumed.events) {
        if (e.code == "lio_not_resumed") {
          std::cout << "restart " << i << ": " << e.text << std::endl;
        }
      }
      continue;
    }
    const Pose& T = resumed.scans.back().odometry.T_frame_child;
    const Pose* truth = drive.pose_at(resumed.scans.back().odometry.stamp_ns);
    const bool right = truth != nullptr && (T.p - truth->p).norm() < kRight_m &&
                       T.q.angularDistance(truth->q) < kRight_rad;
    if (!right) {
      std::cout << "wrong, restart " << i << std::endl;
    }
    ++(right ? tally.right : tally.wrong);
  }
  return tally;
}

void expect_found(const ResumeDrive& drive, double least_success) {
  const Tally tally = restart_often(drive, 0.0, 10.0, 7);
  std::cout << "within 10 m: " << tally.right << " right, " << tally.wrong << " wrong, "
            << tally.refused << " refused" << std::endl;
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.right, least_success * kRestarts);
}

void expect_refused(const ResumeDrive& drive) {
  const Tally tally = restart_often(drive, 20.0, 40.0, 8);
  std::cout << "20 to 40 m away: " << tally.right << " right, " << tally.wrong << " wrong, "
            << tally.refused << " refused" << std::endl;
  EXPECT_EQ(tally.wrong, 0);
}

const ResumeDrive& campus() {
  static const ResumeDrive drive("campus", 1, 60.0);
  return drive;
}

const ResumeDrive& park() {
  static const ResumeDrive drive("park", 1, 60.0);
  return drive;
}

TEST(Relocalisation, finds_the_place_within_10_m_and_30_degrees_and_never_a_wrong_one) {
  expect_found(campus(), kLeastSuccess);
}

TEST(Relocalisation, finds_the_place_among_trees) {
  expect_found(park(), kLeastSuccess);
}

TEST(Relocalisation, takes_no_wrong_place_along_a_corridor) {
  expect_found(ResumeDrive("corridor_gps", 1, 60.0), kLeastSuccessCorridor);
}

TEST(Relocalisation, accepts_no_place_when_the_true_one_is_out_of_reach) {
  expect_refused(campus());
}

TEST(Relocalisation, accepts_no_place_among_trees_when_the_true_one_is_out_of_reach) {
  expect_refused(park());
}

TEST(LostTrack, goes_on_in_the_same_odom_after_a_lidar_that_was_blocked_for_ten_seconds) {
  const ResumeDrive undisturbed("campus", 1, 70.0);
  const ResumeDrive blocked("campus+lidar_blocked", 1, 70.0);
  for (const Event& e : blocked.events) {
    std::cout << e.code << ": " << e.text << std::endl;
  }
  EXPECT_EQ(blocked.scans.back().status.odom_epoch, 0U);
  const auto& last = blocked.scans.back().odometry;
  const Pose* truth = undisturbed.pose_at(last.stamp_ns);
  ASSERT_NE(truth, nullptr);
  const double error_m = (last.T_frame_child.p - truth->p).norm();
  std::cout << "after the blockage " << error_m << " m beside the undisturbed run\n";
  EXPECT_LT(error_m, kRight_m);
}

}  // namespace
}  // namespace trigpoint::pipeline
