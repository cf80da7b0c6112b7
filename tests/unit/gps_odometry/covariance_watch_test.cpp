// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "covariance_watch.hpp"

#include "drive.hpp"
#include "ekf_tracker.hpp"
#include "ins_tracker.hpp"
#include "rewind.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

namespace trigpoint::gps_odometry {
namespace {

using Matrix4d = Eigen::Matrix4d;

TEST(CovarianceWatch, knows_a_positive_covariance_whatever_its_units) {
  Matrix4d P = Eigen::Vector4d(1e8, 1e-12, 4.0, 1.0).asDiagonal();
  P(0, 1) = P(1, 0) = 0.9 * 1e-2;
  EXPECT_TRUE(is_positive_covariance<4>(P));
  P(0, 1) = P(1, 0) = 1.1 * 1e-2;
  EXPECT_FALSE(is_positive_covariance<4>(P));
}

TEST(CovarianceWatch, knows_negative_variances_and_what_is_not_finite) {
  Matrix4d P = Matrix4d::Identity();
  P(3, 3) = -1e-9;
  EXPECT_FALSE(is_positive_covariance<4>(P));
  P(3, 3) = std::nan("");
  EXPECT_FALSE(is_positive_covariance<4>(P));
}

TEST(CovarianceWatch, bounds_the_position_and_keeps_the_correlation) {
  Matrix4d P = Eigen::Vector4d(4e12, 1.0, 1.0, 9.0).asDiagonal();
  P(0, 3) = P(3, 0) = 0.5 * 2e6 * 3.0;
  bound_position<4>(P);
  EXPECT_NEAR(P(0, 0), 1e8, 1.0);
  EXPECT_NEAR(P(0, 3), 0.5 * 1e4 * 3.0, 1e-6);
  EXPECT_EQ(P(1, 1), 1.0);
}

/// A tracker whose covariance breaks at one moment.
template <typename TrackerType>
class Breaking {
 public:
  using State = typename TrackerType::State;

  explicit Breaking(const TrackerType& tracker) : tracker_(tracker) {}

  void apply(State& track, const CheckedImu& imu) const {
    tracker_.apply(track, imu);
    if (imu.stamp_ns == break_ns) {
      // Of the position, which no update mends while there are no fixes.
      auto& P = track.filter.P;
      P(0, 1) = P(1, 0) = 2.0 * std::sqrt(P(0, 0) * P(1, 1));
    }
  }

  template <typename Measurement>
  FixOutcome apply(State& track, const Measurement& measurement) const {
    return tracker_.apply(track, measurement);
  }

  void change_frame(State& track, const Eigen::Matrix3d& R, const Eigen::Vector3d& t) const {
    tracker_.change_frame(track, R, t);
  }

  Nanoseconds break_ns{0};

 private:
  const TrackerType& tracker_;
};

template <typename TrackerType>
class Watched : public testing::Test {};

using Trackers = testing::Types<EkfTracker, InsTracker>;
TYPED_TEST_SUITE(Watched, Trackers);

CheckedImu checked_imu(double time_s) {
  const ImuSample sample = imu_at(time_s);
  CheckedImu imu;
  imu.stamp_ns = sample.stamp_ns;
  imu.gyro_radps = imu.raw_gyro_radps = sample.gyro_radps;
  imu.accel_mps2 = imu.mean_accel_mps2 = sample.accel_mps2;
  imu.gyro_bias_sigma_radps = 0.005;
  return imu;
}

TYPED_TEST(Watched, filter_goes_back_to_its_last_good_covariance_within_a_second) {
  const Config config;
  const TypeParam tracker(config, Eigen::Vector3d::Zero());
  Breaking<TypeParam> breaking(tracker);
  breaking.break_ns = stamp_of(3.99);  // just before it is looked at
  RewindBuffer<Breaking<TypeParam>> buffer(breaking, kNanosecondsPerSecond);
  for (int i = 0; i < 600; ++i) {
    buffer.insert(checked_imu(0.01 * i));
  }
  EXPECT_EQ(buffer.newest().restored, 1U);
  EXPECT_EQ(buffer.newest().reset.counter, 1U);
  EXPECT_TRUE(buffer.newest().filter.is_positive());
  EXPECT_TRUE(buffer.newest().filter.is_finite());
  EXPECT_NE(buffer.newest().phase, Phase::kNoImu);
}

TYPED_TEST(Watched, filter_starts_again_when_there_is_nothing_to_go_back_to) {
  const Config config;
  const TypeParam tracker(config, Eigen::Vector3d::Zero());
  Breaking<TypeParam> breaking(tracker);
  breaking.break_ns = stamp_of(1.0);
  RewindBuffer<Breaking<TypeParam>> buffer(breaking, kNanosecondsPerSecond);
  buffer.insert(checked_imu(0.99));
  buffer.insert(checked_imu(1.0));
  EXPECT_EQ(buffer.newest().restored, 1U);
  buffer.insert(checked_imu(1.01));
  EXPECT_TRUE(buffer.newest().filter.is_positive());
}

}  // namespace
}  // namespace trigpoint::gps_odometry
