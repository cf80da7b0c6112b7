// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "alignment/pose_buffer.hpp"

#include "trigpoint/base/so3.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::fusion_gate {
namespace {

constexpr Nanoseconds kTenth_ns = 100'000'000;

PoseBuffer filled(int poses) {
  PoseBuffer buffer(10 * kNanosecondsPerSecond, 600'000'000);
  for (int k = 0; k < poses; ++k) {
    buffer.add(k * kTenth_ns, {from_yaw(0.1 * k), {0.2 * k, 0.0, 0.0}}, PoseCovariance::Identity());
  }
  return buffer;
}

TEST(PoseBuffer, interpolates_position_rotation_and_distance) {
  const PoseBuffer::Answer answer = filled(10).at(250'000'000);
  ASSERT_EQ(answer.coverage, PoseBuffer::Coverage::kCovered);
  EXPECT_NEAR(answer.sample.T_frame_child.p.x(), 0.5, 1e-12);
  EXPECT_NEAR(yaw_of(answer.sample.T_frame_child.q), 0.25, 1e-12);
  EXPECT_NEAR(answer.sample.distance_m, 0.5, 1e-12);
}

TEST(PoseBuffer, says_whether_waiting_helps) {
  PoseBuffer buffer = filled(10);
  EXPECT_EQ(buffer.at(950'000'000).coverage, PoseBuffer::Coverage::kNotYet);
  EXPECT_EQ(buffer.at(-1).coverage, PoseBuffer::Coverage::kMissing);
  buffer.add(2 * kNanosecondsPerSecond, {}, PoseCovariance::Identity());
  EXPECT_EQ(buffer.at(1'500'000'000).coverage, PoseBuffer::Coverage::kMissing);  // a gap of 1.1 s
}

TEST(PoseBuffer, refuses_stamps_that_do_not_advance_and_poses_that_are_not_finite) {
  PoseBuffer buffer = filled(10);
  EXPECT_FALSE(buffer.add(9 * kTenth_ns, {}, PoseCovariance::Identity()));
  Pose broken;
  broken.p.x() = std::nan("");
  EXPECT_FALSE(buffer.add(20 * kTenth_ns, broken, PoseCovariance::Identity()));
}

TEST(PoseBuffer, forgets_what_is_older_than_its_length) {
  const PoseBuffer buffer = filled(300);
  EXPECT_EQ(buffer.at(15 * kNanosecondsPerSecond).coverage, PoseBuffer::Coverage::kMissing);
  EXPECT_EQ(buffer.at(20 * kNanosecondsPerSecond).coverage, PoseBuffer::Coverage::kCovered);
}

TEST(PoseBuffer, does_not_count_jitter_as_distance) {
  PoseBuffer buffer(kNanosecondsPerSecond, kNanosecondsPerSecond);
  for (int k = 0; k < 1000; ++k) {
    buffer.add(k * kTenth_ns,
               {Eigen::Quaterniond::Identity(), {k % 2 == 0 ? 0.01 : -0.01, 0.0, 0.0}},
               PoseCovariance::Identity());
  }
  EXPECT_EQ(buffer.distance_m(), 0.0);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
