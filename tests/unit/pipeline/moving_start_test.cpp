// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Mappers that are switched on while the robot drives along a street.
#include "resume_drive.hpp"
#include <gtest/gtest.h>

#include <iostream>

namespace trigpoint::pipeline {
namespace {

constexpr double kFor_s = 3.0;
/// The first metres of a map that begins in motion: the speed is known to some centimetres a
/// second.
constexpr double kSameWay_m = 0.3;

/// A mapper that is switched on at scan `at` must find the way driven that the one knows that
/// started with the robot.
void expect_same_way(const ResumeDrive& drive, std::size_t at) {
  ASSERT_LT(at, drive.scans.size());
  lio_mapper::LioMapper mapper({}, drive.robot);
  std::vector<lio_mapper::ScanResult> scans;
  Events events;
  feed_from(mapper, drive, drive.scans[at].odometry.stamp_ns, kFor_s, scans, events);
  ASSERT_GT(scans.size(), 20U);
  const lio_mapper::ScanResult& first = scans.front();
  const lio_mapper::ScanResult& last = scans.back();
  const Pose* from = drive.pose_at(first.odometry.stamp_ns);
  const Pose* to = drive.pose_at(last.odometry.stamp_ns);
  ASSERT_TRUE(from != nullptr && to != nullptr);
  const Eigen::Vector3d way_m =
      (first.odometry.T_frame_child.inverse() * last.odometry.T_frame_child).p;
  const Eigen::Vector3d expected_m = (from->inverse() * *to).p;
  std::cout << "from scan " << at << ": " << (way_m - expected_m).norm() << " m off after "
            << expected_m.norm() << " m\n";
  EXPECT_LT((way_m - expected_m).norm(), kSameWay_m) << "from scan " << at;
}

/// Beside long walls most of a scan fits at any speed along them.
TEST(MovingStart, finds_its_speed_beside_long_walls) {
  const ResumeDrive drive("campus", 1, 32.0);
  for (const std::size_t at : {118U, 126U, 134U, 206U, 278U}) {
    expect_same_way(drive, at);
  }
}

/// At an even acceleration the IMU is quiet; among trees the scans that follow are too weak to
/// correct a wrong level.
TEST(MovingStart, does_not_take_driving_off_for_leaning) {
  const ResumeDrive drive("park", 2, 7.5);
  expect_same_way(drive, 32);
}

}  // namespace
}  // namespace trigpoint::pipeline
