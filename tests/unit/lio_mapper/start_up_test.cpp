// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "start_up.hpp"

#include "trigpoint/base/so3.hpp"

#include "room_drive.hpp"
#include "sweep.hpp"
#include <gtest/gtest.h>

#include <deque>
#include <variant>

namespace trigpoint::lio_mapper {

namespace {

const Eigen::Vector3d kUp{0.0, 0.0, kStandardGravity_mps2};

ImuBuffer turning(const Eigen::Quaterniond& q_start, const Eigen::Vector3d& rate_radps) {
  ImuBuffer imu;
  for (int i = 0; i <= 200; ++i) {
    const Nanoseconds stamp_ns = i * 5'000'000;
    const Eigen::Quaterniond q = q_start * so3_exp(rate_radps * to_seconds(stamp_ns));
    imu.push({stamp_ns, rate_radps, q.conjugate() * kUp});
  }
  return imu;
}

TEST(StartUp, summary_takes_the_turning_out_of_the_specific_force) {
  const Eigen::Quaterniond q_start = from_roll_pitch_yaw({0.1, -0.2, 0.3});
  const Eigen::Vector3d rate{0.3, 0.5, 1.0};
  const ImuBuffer imu = turning(q_start, rate);
  const ImuSummary summary = summarize(imu, 0, imu.newest_ns());
  const Eigen::Vector3d expected = (q_start * so3_exp(rate)).conjugate() * kUp;
  EXPECT_LT((summary.mean_force_mps2 - expected).norm(), 2e-3);
  EXPECT_LT((summary.mean_gyro_radps - rate).norm(), 1e-9);
  EXPECT_FALSE(looks_at_rest(summary));
}

TEST(StartUp, levels_roll_and_pitch_and_begins_with_heading_zero) {
  const Eigen::Quaterniond q_true = from_roll_pitch_yaw({0.12, -0.08, 2.0});
  const InitialState initial = level(q_true.conjugate() * kUp, 7, ImuConfig{}, {});
  const Eigen::Vector3d rpy = roll_pitch_yaw_of(initial.state.T_odom_base.q);
  EXPECT_NEAR(rpy.x(), 0.12, 1e-9);
  EXPECT_NEAR(rpy.y(), -0.08, 1e-9);
  EXPECT_NEAR(rpy.z(), 0.0, 1e-9);
  EXPECT_EQ(initial.stamp_ns, 7);
}

/// Monte-Carlo: a biased accelerometer levels wrongly, and covariance must say by how much and that
/// the error is tied to the bias.
TEST(StartUp, gravity_and_bias_are_uncertain_together_as_levelling_makes_them) {
  const ImuConfig imu;
  const Eigen::Quaterniond q_true = from_roll_pitch_yaw({0.1, -0.2, 0.0});
  const Eigen::Vector3d bias{0.04, -0.03, 0.0};
  const InitialState initial = level(q_true.conjugate() * kUp + bias, 0, imu, {});
  // True gravity as odom sees it: turned from -z by what levelling got wrong.
  const Eigen::Quaterniond q_odom_true = initial.state.T_odom_base.q * q_true.conjugate();
  State truth = initial.state;
  truth.gravity_odom_mps2 = q_odom_true * -kUp;
  truth.accel_bias_mps2 = bias;
  const ErrorVector e = boxminus(truth, initial.state);
  Eigen::Matrix<double, 5, 1> part;
  part << e.segment<2>(error::kGravity), e.segment<3>(error::kAccelBias);
  Eigen::Matrix<double, 5, 5> P;
  P << initial.covariance.block<2, 2>(error::kGravity, error::kGravity),
      initial.covariance.block<2, 3>(error::kGravity, error::kAccelBias),
      initial.covariance.block<3, 2>(error::kAccelBias, error::kGravity),
      initial.covariance.block<3, 3>(error::kAccelBias, error::kAccelBias);
  EXPECT_EQ((P - P.transpose()).norm(), 0.0);
  EXPECT_GT(part.head<2>().norm(), 4e-3);
  // One sigma of bias and nothing else: a wrong sign in the cross-covariance would cost
  // (2 * 5e-3 / 1e-3)^2.
  EXPECT_LT(part.dot(P.ldlt().solve(part)), 3.0);
}

TEST(StartUp, says_when_the_accelerometer_speaks_in_g) {
  const auto event = check_specific_force({0.01, 0.0, 1.0}, 0);
  ASSERT_TRUE(event.has_value());
  EXPECT_EQ(event->code, "imu_in_g");
  EXPECT_NE(event->text.find("9.80665"), std::string::npos);
}

TEST(StartUp, says_when_the_imu_is_upside_down_or_gravity_was_taken_out) {
  EXPECT_EQ(check_specific_force(-kUp, 0)->code, "imu_upside_down");
  EXPECT_EQ(check_specific_force({0.1, 0.1, 0.0}, 0)->code, "imu_force_implausible");
  EXPECT_FALSE(check_specific_force(kUp, 0).has_value());
}

/// What the mapper has when it starts: a second of IMU and of sweeps.
StartResult start_of(const testing_support::RoomDrive& drive, const Config& config = {}) {
  constexpr Nanoseconds kSweep_ns = 100'000'000;
  SweepDecoder decoder(config.sweep);
  ImuBuffer imu;
  std::deque<Sweep> sweeps;
  Events events;
  for (int i = 0; i < 10; ++i) {
    sweeps.push_back(std::get<Sweep>(
        decoder.decode(drive.sweep_at(drive.kEpoch_ns + i * kSweep_ns, 150), events)));
  }
  for (int i = 0; i <= 220; ++i) {
    const ImuSample sample = drive.imu_at(drive.kEpoch_ns + i * 5'000'000);
    imu.push({sample.stamp_ns, sample.gyro_radps, sample.accel_mps2});
  }
  return start(config, Pose{}, imu, sweeps);
}

/// A LiDAR that leans against the accelerometer makes a map that leans, and the accelerometer seems
/// biased by as much of gravity.
TEST(StartUp, leaves_open_that_the_lidar_leans_against_the_accelerometer) {
  const auto sigmas = [](const Config& config) {
    const ErrorMatrix P = start_of(testing_support::RoomDrive(10.0), config).initial.covariance;
    return Eigen::Vector3d(std::sqrt(P(error::kGravity, error::kGravity)),
                           std::sqrt(P(error::kAccelBias, error::kAccelBias)),
                           std::sqrt(P(error::kAccelBias + 2, error::kAccelBias + 2)));
  };
  Config config;
  config.extrinsic.level_sigma_rad = 0.0;
  config.extrinsic.rotation_sigma_rad = 0.03;
  const Eigen::Vector3d exact = sigmas(config);
  config.extrinsic.level_sigma_rad = 0.01;
  const Eigen::Vector3d held = sigmas(config);
  config.extrinsic.estimate = true;
  const Eigen::Vector3d estimated = sigmas(config);
  EXPECT_NEAR(held[0], std::hypot(exact[0], 0.01), 1e-5);
  EXPECT_NEAR(held[1], std::hypot(exact[1], 0.01 * kStandardGravity_mps2), 1e-3);
  EXPECT_NEAR(estimated[0], std::hypot(exact[0], 0.03), 1e-5);
  EXPECT_NEAR(estimated[2], exact[2], 1e-5) << "gravity's size does not depend on it";
}

/// Two sweeps of a coarse LiDAR seem to move by decimetres a second.
TEST(StartUp, knows_that_it_stands_although_two_noisy_sweeps_seem_to_move) {
  for (const unsigned seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
    testing_support::RoomDrive drive(10.0);
    drive.range_sigma_m = 0.03;
    drive.noise_seed = seed;
    const StartResult result = start_of(drive);
    ASSERT_FALSE(result.trouble.has_value());
    EXPECT_TRUE(result.at_rest) << "speed " << result.speed_mps << " m/s";
  }
}

/// An open field: a floor and nothing else.
class FieldDrive final : public testing_support::RoomDrive {
 public:
  explicit FieldDrive(unsigned seed) : RoomDrive(10.0) {
    range_sigma_m = 0.02;
    noise_seed = 100 * seed;
  }

 private:
  double cast(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const override {
    constexpr double kFloor_m = -0.7;
    constexpr double kReach_m = 100.0;
    const double range_m = (kFloor_m - from.z()) / std::min(direction.z(), -1e-9);
    return range_m < kReach_m ? range_m : 0.0;  // no return
  }
};

/// All speeds fit there alike; one of them was taken for true.
TEST(StartUp, makes_up_no_speed_where_nothing_tells_one) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const StartResult result = start_of(FieldDrive(seed));
    ASSERT_FALSE(result.trouble.has_value());
    EXPECT_TRUE(result.at_rest) << "speed " << result.speed_mps << " m/s";
    const auto velocity =
        result.initial.covariance.block<3, 3>(error::kVelocity, error::kVelocity).diagonal();
    EXPECT_GE(std::sqrt(velocity.x()), 1.0) << "as if it were known to stand";
  }
}

TEST(StartUp, knows_that_it_drives_although_the_imu_is_quiet) {
  testing_support::RoomDrive drive(0.0, 2.0);
  const StartResult result = start_of(drive);
  ASSERT_FALSE(result.trouble.has_value());
  EXPECT_FALSE(result.at_rest);
  EXPECT_NEAR(result.speed_mps, 2.0, 0.1);
}

}  // namespace

}  // namespace trigpoint::lio_mapper
