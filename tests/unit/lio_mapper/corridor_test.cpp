// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Where scans do not hold the position along an axis, nothing may make it look held.
#include "bent_map.hpp"
#include "room_drive.hpp"
#include "scan_filter.hpp"
#include "start_up.hpp"
#include "sweep.hpp"
#include <Eigen/LU>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <variant>
#include <vector>

namespace trigpoint::lio_mapper {

namespace {

using testing_support::RoomDrive;

constexpr Nanoseconds kTurn_ns = 100'000'000;
constexpr Nanoseconds kImuStep_ns = 5'000'000;

/// Rests, then drives straight through a corridor 2 m wide and 3 m high without ends or doors.
class CorridorDrive final : public RoomDrive {
 public:
  Pose pose_at(double t_s) const override {
    const double moving_s = std::max(0.0, t_s - kRest_s);
    const double x_m = moving_s < kRampUp_s ? kSpeed_mps * moving_s * moving_s / (2.0 * kRampUp_s)
                                            : kSpeed_mps * (moving_s - kRampUp_s / 2.0);
    return {Eigen::Quaterniond::Identity(), {x_m, 0.0, 0.0}};
  }

 private:
  static constexpr double kRest_s = 2.5;
  static constexpr double kRampUp_s = 1.0;
  static constexpr double kSpeed_mps = 1.5;

  double cast(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const override {
    double nearest_m = std::numeric_limits<double>::infinity();
    const Eigen::Vector3d low_m{0.0, -1.0, -0.8};
    const Eigen::Vector3d high_m{0.0, 1.0, 2.2};
    for (const int axis : {1, 2}) {
      if (std::abs(direction[axis]) > 1e-12) {
        const double face_m = direction[axis] > 0.0 ? high_m[axis] : low_m[axis];
        nearest_m = std::min(nearest_m, (face_m - from[axis]) / direction[axis]);
      }
    }
    return nearest_m;
  }
};

/// A filter in a drive, without GPS.
class Driver {
 public:
  Driver(RoomDrive& drive, unsigned seed, int seconds) : drive_(drive) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0.0, 1.0);
    drive.noise_seed = 1000 * seed;
    drive.range_sigma_m = 0.02;
    for (int i = 0; i < 3; ++i) {
      drive.gyro_bias_radps[i] = 1e-3 * normal(random);
      drive.accel_bias_mps2[i] = 0.03 * normal(random);
    }
    Eigen::Vector3d accel_sum = Eigen::Vector3d::Zero();
    constexpr int kAtRest = 400;
    for (int i = 0; i <= seconds * 200 + 40; ++i) {
      ImuSample sample = drive.imu_at(RoomDrive::kEpoch_ns + i * kImuStep_ns);
      for (int axis = 0; axis < 3; ++axis) {
        sample.gyro_radps[axis] += 4e-3 * normal(random);
        sample.accel_mps2[axis] += 0.06 * normal(random);
      }
      accel_sum += i < kAtRest ? sample.accel_mps2 : Eigen::Vector3d::Zero();
      imu_.push({sample.stamp_ns, sample.gyro_radps, sample.accel_mps2});
    }
    const Config config;
    InitialState initial = level(accel_sum / kAtRest, RoomDrive::kEpoch_ns, config.imu, {});
    initial.state.gyro_bias_radps = drive.gyro_bias_radps;
    filter.emplace(config, Pose{}, initial);
  }

  /// Turn `i` of the LiDAR; gives what has entered the map.
  PointCloud turn(int i, const PoseSearch& look = {}) {
    Events events;
    const auto decoded =
        decoder_.decode(drive_.sweep_at(RoomDrive::kEpoch_ns + i * kTurn_ns), events);
    return filter->insert(filter->process(std::get<Sweep>(decoded), imu_, look));
  }

  std::optional<ScanFilter> filter;

 private:
  const RoomDrive& drive_;
  ImuBuffer imu_;
  SweepDecoder decoder_{SweepTimingConfig{}};
};

struct Along {
  double error_m;
  double sigma_m;
};

/// Of the position along the corridor after `seconds`.
Along driven(unsigned seed, int seconds) {
  CorridorDrive drive;
  Driver driver(drive, seed, seconds);
  for (int i = 0; i < seconds * 10; ++i) {
    driver.turn(i);
  }
  const double truth_m = drive.pose_at(seconds).p.x();
  return {driver.filter->state().T_odom_base.p.x() - truth_m,
          std::sqrt(driver.filter->covariance()(0, 0))};
}

/// Points that enter the map with each turn, after six seconds without scans and a search that
/// puts the robot `off_m` too far along x, where it says that places are as good.
std::vector<std::size_t> entered_after_search(RoomDrive& drive, double off_m, int turns) {
  constexpr int kBlindFrom = 40;
  constexpr int kBlindTo = 100;
  Driver driver(drive, 1, (kBlindTo + turns) / 10);
  for (int i = 0; i < kBlindFrom; ++i) {
    driver.turn(i);
  }
  const Pose T_odom_start = drive.pose_at(0.0).inverse();
  const auto look = [&](const State&, const ErrorMatrix&, const PointCloud&) {
    Pose found = T_odom_start * drive.pose_at(0.1 * (kBlindTo + 1));
    found.p.x() += off_m;
    return Sighting{false, found, Eigen::Vector2d(0.1, 0.0).asDiagonal()};
  };
  std::vector<std::size_t> entered;
  for (int i = 0; i < turns; ++i) {
    entered.push_back(driver.turn(kBlindTo + i, i == 0 ? PoseSearch(look) : PoseSearch()).size());
  }
  return entered;
}

/// A floor, walls and ceiling that hold across 1 cm each, turned by `bend_rad` about y.
PoseInformation tunnel(double bend_rad, double along) {
  PoseInformation sum;
  const Eigen::Vector3d up(std::sin(bend_rad), 0.0, std::cos(bend_rad));
  const Eigen::Vector3d length(std::cos(bend_rad), 0.0, -std::sin(bend_rad));
  Eigen::Matrix3d A = 1e4 * up * up.transpose() + along * length * length.transpose();
  A(1, 1) += 1e4;
  sum.information.topLeftCorner<3, 3>() = A;
  sum.information.bottomRightCorner<3, 3>() = 1e6 * Eigen::Matrix3d::Identity();
  sum.gradient.head<3>() = 0.01 * A * (up + length);
  sum.count = 1000;
  return sum;
}

/// Variances of the position after 100 scans of a map that bends to and fro.
Eigen::Vector3d after_scans(bool doubted, double along) {
  ErrorMatrix P = 1e-4 * ErrorMatrix::Identity();
  P(0, 0) = 1.0;
  for (int scan = 0; scan < 100; ++scan) {
    PoseInformation sum = tunnel(scan % 2 == 0 ? 0.005 : -0.005, along);
    if (doubted) {
      keep_unbent(unbent_share(P, sum), sum);
    }
    Matrix6d root = P.topLeftCorner<6, 6>().inverse() + sum.information;
    P.topLeftCorner<6, 6>() = root.inverse();
  }
  return P.diagonal().head<3>();
}

TEST(BentMap, does_not_hold_the_position_along_its_planes) {
  EXPECT_LT(after_scans(false, 0.0).x(), 0.1) << "or there was nothing to doubt";
  EXPECT_GT(after_scans(true, 0.0).x(), 0.99);
  EXPECT_NEAR(after_scans(true, 0.0).y(), after_scans(false, 0.0).y(), 1e-9);
}

TEST(BentMap, takes_nothing_from_what_holds) {
  EXPECT_NEAR(after_scans(true, 1e4).x() / after_scans(false, 1e4).x(), 1.0, 1e-3);
  PoseInformation sum = tunnel(0.0, 1e4);
  const Vector6d before = sum.information.ldlt().solve(sum.gradient);
  keep_unbent(unbent_share(ErrorMatrix::Identity(), sum), sum);
  EXPECT_LT((sum.information.ldlt().solve(sum.gradient) - before).norm(), 1e-5);
}

/// Nobody knows by how much a map bends: what is left where it is doubted must not be divided by a
/// small remainder.
TEST(BentMap, makes_no_long_step_of_what_it_barely_leaves) {
  constexpr double kLength_m = 50.0;
  for (const double lean_rad : {0.0141, 0.0143, 0.0147, 0.016}) {
    const Eigen::Vector3d length(std::cos(lean_rad), 0.0, std::sin(lean_rad));
    ErrorMatrix P = 1e-4 * ErrorMatrix::Identity();
    P.topLeftCorner<3, 3>() += kLength_m * kLength_m * length * length.transpose();
    PoseInformation sum = tunnel(0.0, 0.0);
    keep_unbent(unbent_share(P, sum), sum);
    const Matrix6d posterior = P.topLeftCorner<6, 6>().inverse() + sum.information;
    const Vector6d step = -posterior.ldlt().solve(sum.gradient);
    EXPECT_LT(std::abs(step[0]), 0.05) << lean_rad;
    EXPECT_LT(std::abs(step[2]), 0.02) << lean_rad;
  }
}

TEST(Corridor, its_length_is_as_uncertain_as_it_is_wrong) {
  double squares = 0.0;
  constexpr int kSeeds = 8;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const Along along = driven(seed, 20);
    RecordProperty("seed_" + std::to_string(seed),
                   std::to_string(along.error_m) + " +- " + std::to_string(along.sigma_m));
    EXPECT_LT(std::abs(along.error_m), 6.0) << "far more than gravity through 10 mrad";
    squares += along.error_m * along.error_m / (along.sigma_m * along.sigma_m);
  }
  // Chi-square of 8 degrees of freedom: 0.999 quantile.
  EXPECT_LT(squares, 26.1);
}

/// What is put into the map at one of several places as good vouches for it from then on.
TEST(Corridor, a_scan_that_a_search_found_at_one_of_many_places_stays_out_of_the_map) {
  CorridorDrive corridor;
  constexpr int kTurns = 150;  // of 0.15 m each
  const auto entered = entered_after_search(corridor, 0.3, kTurns);
  EXPECT_EQ(std::count(entered.begin(), entered.begin() + 130, 0U), 130) << "19.5 m";
  EXPECT_GT(*std::min_element(entered.begin() + 140, entered.end()), 500U)
      << "a map that does not go on is soon left";
  RoomDrive hall{2.5};  // s at rest, as the corridor
  EXPECT_GT(entered_after_search(hall, 0.1, 1).front(), 500U) << "ends settle the place at once";
}

}  // namespace

}  // namespace trigpoint::lio_mapper
