// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "scan_filter.hpp"

#include "drift.hpp"
#include "propagation.hpp"
#include "random_state.hpp"
#include "room_drive.hpp"
#include "start_up.hpp"
#include <gtest/gtest.h>

namespace trigpoint::lio_mapper {

namespace {

using testing_support::RoomDrive;

constexpr Nanoseconds kFilterEpoch_ns = RoomDrive::kEpoch_ns;
constexpr Nanoseconds kFilterSweep_ns = 100'000'000;

class ScanFilterInAHall : public testing::Test {
 protected:
  void SetUp() override {
    for (int i = 0; i <= 400; ++i) {
      const ImuSample sample = room.imu_at(kFilterEpoch_ns + i * 5'000'000);
      imu.push({sample.stamp_ns, sample.gyro_radps, sample.accel_mps2});
    }
  }

  std::unique_ptr<ScanFilter> started() const {
    InitialState initial = level({0.0, 0.0, 9.80665}, kFilterEpoch_ns, Config{}.imu, {});
    initial.state.gyro_bias_radps = room.gyro_bias_radps;
    return std::make_unique<ScanFilter>(Config{}, Pose{}, initial);
  }

  ScanOutcome process(ScanFilter& filter, int sweep) const {
    SweepDecoder decoder{SweepTimingConfig{}};
    Events events;
    const auto decoded =
        decoder.decode(room.sweep_at(kFilterEpoch_ns + sweep * kFilterSweep_ns), events);
    return filter.process(std::get<Sweep>(decoded), imu);
  }

  void drive(ScanFilter& filter, int sweeps) const {
    for (int i = 0; i < sweeps; ++i) {
      filter.insert(process(filter, i));
    }
  }

  RoomDrive room{0.5};
  ImuBuffer imu;
};

/// What late rows rest on: an error before a scan, times the recorded transition, is the error
/// after its update. Both filters have the same map; one is told that it stands elsewhere.
TEST_F(ScanFilterInAHall, transition_tells_what_a_scan_leaves_of_an_error) {
  constexpr double kTolerance = 0.1;  // matches and robust weights differ a little
  for (int axis = 0; axis < 3; ++axis) {
    const auto nominal = started();
    const auto moved = started();
    drive(*nominal, 10);
    drive(*moved, 10);
    const Alignment alignment{0, {}, Eigen::Matrix4d::Identity()};
    moved->align(alignment);
    StateUpdate shift;
    shift.mode = UpdateMode::kOverwrite;
    shift.fix_stamp_ns = moved->stamp_ns();
    shift.decision.fill(AxisDecision::kFused);
    shift.position_map_m = moved->state().T_odom_base.p + 0.01 * Eigen::Vector3d::Unit(axis);
    ASSERT_EQ(moved->apply(shift).outcome, RowOutcome::kApplied);
    ErrorVector before = boxminus(moved->state(), nominal->state());
    before.segment<4>(error::kYawMapOdom).setZero();
    process(*nominal, 10);
    process(*moved, 10);
    ErrorVector after = boxminus(moved->state(), nominal->state());
    after.segment<4>(error::kYawMapOdom).setZero();
    const ErrorVector predicted = nominal->history().newest().transition * before;
    EXPECT_LT((after - predicted).norm(), kTolerance * before.norm()) << "axis " << axis;
    EXPECT_LT(after.head<3>().norm(), 0.9 * before.norm());  // the scan did pull back
  }
}

TEST_F(ScanFilterInAHall, undistortion_ends_at_the_sweeps_end_and_matches_nearly_every_point) {
  const auto filter = started();
  drive(*filter, 15);
  const ScanOutcome outcome = process(*filter, 15);
  EXPECT_NEAR(to_seconds(filter->stamp_ns() - kFilterEpoch_ns), 1.6, 1e-6);  // float point times
  EXPECT_TRUE(outcome.used);
  EXPECT_GT(outcome.share_within_10_cm, 0.7);
  EXPECT_GT(outcome.observability[0], 0.1);
}

TEST(Drift, heading_noise_turns_about_the_robot_and_leaves_its_place_in_map) {
  const Eigen::Vector3d p_odom_m{1000.0, 0.0, 0.0};
  const Eigen::Matrix4d noise =
      drift_noise(drift_rate({0.0, 1e-3}), 100.0, from_yaw(0.4).toRotationMatrix(), p_odom_m);
  // Position in map: yaw moves it by z x R p, translation directly.
  Eigen::Matrix<double, 3, 4> jacobian;
  jacobian.col(0) = Eigen::Vector3d::UnitZ().cross(from_yaw(0.4) * p_odom_m);
  jacobian.rightCols<3>().setIdentity();
  EXPECT_LT((jacobian * noise * jacobian.transpose()).norm(), 1e-9);
  EXPECT_NEAR(noise(0, 0), 1e-4, 1e-12);
}

TEST(Drift, pose_gathers_its_walk_and_a_share_of_the_local_covariance) {
  DriftConfig drift;
  drift.position_sigma_m_sqrtm = 0.003;
  drift.map_renewal_per_m = 0.1;
  Matrix6d local = Matrix6d::Zero();
  local.diagonal() << 1e-4, 4e-4, 1.0, 1e-6, 2e-6, 3e-6;  // height above what is passed on
  const DriftRate rate = drift_rate(drift, local);
  const Eigen::Vector3d expected_m2 =
      Eigen::Vector3d::Constant(9e-6) + 0.1 * Eigen::Vector3d(1e-4, 4e-4, 9e-4);
  EXPECT_LT((rate.position_m2.diagonal() - expected_m2).norm(), 1e-12);
  EXPECT_NEAR(rate.tilt_rad2(0, 0), 4e-10 + 1e-7, 1e-15);
  EXPECT_NEAR(rate.tilt_rad2(1, 1), 4e-10 + 2e-7, 1e-15);
  EXPECT_NEAR(rate.yaw_rad2, 4e-10 + 3e-7, 1e-15);
}

TEST(Drift, tilt_noise_turns_odom_about_the_robot_and_leaves_its_place_in_map) {
  const State state = testing_support::random_state(4);
  ErrorMatrix covariance = ErrorMatrix::Zero();
  add_drift_noise(drift_rate({0.0, 0.0, 1e-3}), 100.0, state, true, covariance);
  Path path;
  path.push_back({kFilterEpoch_ns, state.T_odom_base, state.v_odom_mps});
  const auto H = predict_row(state, path, kFilterEpoch_ns, Eigen::Vector3d::Zero()).jacobian;
  EXPECT_LT((H * covariance * H.transpose()).norm(), 1e-9);
  EXPECT_NEAR(covariance(error::kGravity, error::kGravity), 1e-4, 1e-12);
}

TEST(Drift, gravity_comes_in_along_the_axes_that_scans_leave_open_and_only_there) {
  const Eigen::Matrix3d blind = blindness(Eigen::Vector3d(0.0, 1e4, 1e4).asDiagonal());
  EXPECT_NEAR(blind(0, 0), 1.0, 1e-12);
  EXPECT_LT(blind(1, 1), 2e-3);
  DriftConfig drift;
  drift.blind_tilt_rad_sqrts = 1e-3;
  const State state;
  ErrorMatrix covariance = ErrorMatrix::Zero();
  add_blind_tilt_noise(drift, 4.0, blind, state, false, covariance);
  InertialStep second;
  second.begin.accel_mps2 = {0.0, 0.0, 9.80665};
  second.end = second.begin;
  second.end.stamp_ns = kNanosecondsPerSecond;
  const StepJacobian jacobian = step_jacobian(state, second);
  apply_transition(jacobian, covariance);
  covariance.transposeInPlace();
  apply_transition(jacobian, covariance);
  // A tilt of 2 mrad for a second.
  EXPECT_NEAR(std::sqrt(covariance(error::kVelocity, error::kVelocity)), 2e-3 * 9.80665, 1e-4);
  EXPECT_LT(covariance(error::kVelocity + 1, error::kVelocity + 1), 1e-5 * 4.0);
}

}  // namespace

}  // namespace trigpoint::lio_mapper
