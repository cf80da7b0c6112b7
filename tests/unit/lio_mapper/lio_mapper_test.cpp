// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/lio_mapper.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/base/so3.hpp"

#include "room_drive.hpp"
#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>

namespace trigpoint::lio_mapper {

namespace {

using testing_support::RoomDrive;

constexpr Nanoseconds kEpoch_ns = RoomDrive::kEpoch_ns;
constexpr Nanoseconds kImuPeriod_ns = 5'000'000;
constexpr int kImuPerSweep = 20;

/// Feeds a drive in order of availability and keeps what comes out.
class Drive {
 public:
  explicit Drive(const Config& config = {}, const RobotConfig& robot = {})
      : mapper(config, robot) {}

  /// Sweeps [from, to) with their IMU samples; `change` may spoil inputs, or drop them (false).
  void drive(const RoomDrive& room, int from, int to) {
    for (int sweep = from; sweep < to; ++sweep) {
      const Nanoseconds begin_ns = kEpoch_ns + sweep * kImuPerSweep * kImuPeriod_ns;
      for (int i = 0; i < kImuPerSweep; ++i) {
        ImuSample sample = room.imu_at(begin_ns + i * kImuPeriod_ns);
        if (!on_imu || on_imu(sweep, sample)) {
          take(mapper.on_imu(sample));
        }
      }
      PointCloudMessage cloud = room.sweep_at(begin_ns, azimuths);
      if (!on_cloud || on_cloud(sweep, cloud)) {
        take(mapper.on_cloud(cloud));
      }
      after_sweep(begin_ns);
    }
  }

  void take(Output output) {
    events.insert(events.end(), output.events.begin(), output.events.end());
    imu_rate += output.odometry_imu_rate.has_value() ? 1 : 0;
    if (output.odometry_imu_rate) {
      newest_imu_rate = *output.odometry_imu_rate;
    }
    std::move(output.scans.begin(), output.scans.end(), std::back_inserter(scans));
  }

  bool said(const std::string& code) const {
    return std::any_of(
        events.begin(), events.end(), [&](const Event& event) { return event.code == code; });
  }

  /// Position in the frame of the first pose minus the true one.
  Eigen::Vector3d error(const RoomDrive& room, const Odometry& odometry) const {
    const auto truth = [&](const Odometry& o) {
      return room.pose_at(to_seconds(o.stamp_ns - kEpoch_ns));
    };
    const Odometry& first = scans.front().odometry;
    return (first.T_frame_child.inverse() * odometry.T_frame_child).p -
           (truth(first).inverse() * truth(odometry)).p;
  }

  LioMapper mapper;
  std::vector<ScanResult> scans;
  Events events;
  int imu_rate{0};
  int azimuths{600};
  Odometry newest_imu_rate;
  std::function<bool(int, ImuSample&)> on_imu;
  std::function<bool(int, PointCloudMessage&)> on_cloud;
  std::function<void(Nanoseconds)> after_sweep{[](Nanoseconds) {}};
};

std::uint64_t refused(const LioStatus& status, const std::string& reason) {
  for (const NamedCount& count : status.scans_refused) {
    if (count.name == reason) {
      return count.count;
    }
  }
  return 0;
}

TEST(LioMapper, drives_twenty_seconds_through_a_hall_of_planes_within_two_centimetres) {
  constexpr double kTolerance_m = 0.02;
  const RoomDrive room;
  Drive run;
  run.drive(room, 0, 200);
  run.take(run.mapper.finish());
  ASSERT_GE(run.scans.size(), 199U);
  double worst_m = 0.0;
  for (const ScanResult& scan : run.scans) {
    worst_m = std::max(worst_m, run.error(room, scan.odometry).norm());
  }
  EXPECT_LT(worst_m, kTolerance_m);
  EXPECT_EQ(run.mapper.status().health, LioHealth::kOk);
  EXPECT_NEAR(run.mapper.status().distance_m, 30.0, 8.0);
  EXPECT_LT(run.error(room, run.newest_imu_rate).norm(), kTolerance_m);
  EXPECT_GT(run.imu_rate, 1700);  // 100 Hz but for the start
}

/// The points of a LiDAR that is turned by a quarter to the left.
void see_turned(PointCloudMessage& cloud) {
  for (std::size_t at = 0; at < cloud.data.size(); at += cloud.point_step) {
    float x = 0.0F;
    float y = 0.0F;
    std::memcpy(&x, &cloud.data[at], sizeof x);
    std::memcpy(&y, &cloud.data[at + sizeof x], sizeof y);
    const float minus_x = -x;
    std::memcpy(&cloud.data[at], &y, sizeof y);
    std::memcpy(&cloud.data[at + sizeof x], &minus_x, sizeof minus_x);
  }
}

TEST(LioMapper, finds_how_the_lidar_is_turned_and_what_was_right_stays_right) {
  constexpr double kTolerance_rad = 4e-3;
  const RoomDrive room;

  struct Mounting {
    Eigen::Vector3d wrong_rad;
    bool turned;
  };

  for (const auto& [wrong_rad, turned] : {Mounting{{0.02, -0.015, 0.0}, false},
                                          Mounting{{0.0, 0.0, 0.0}, false},
                                          Mounting{{0.02, -0.015, 0.0}, true}}) {
    RobotConfig robot;
    robot.lidar_roll_pitch_yaw_base_rad.z() = turned ? std::acos(0.0) : 0.0;
    const Eigen::Quaterniond q_true = robot.T_base_lidar().q;
    robot.lidar_roll_pitch_yaw_base_rad += wrong_rad;
    Config config;
    config.extrinsic.estimate = true;
    Drive run(config, robot);
    if (turned) {
      run.on_cloud = [](int, PointCloudMessage& cloud) {
        see_turned(cloud);
        return true;
      };
    }
    run.drive(room, 0, 300);
    run.take(run.mapper.finish());
    const Calibration found = run.mapper.calibration();
    const Eigen::Vector3d error_rad = so3_log(found.T_base_lidar.q * q_true.conjugate());
    EXPECT_LT(error_rad.head<2>().norm(), kTolerance_rad) << wrong_rad.transpose();
    EXPECT_EQ(found.T_base_lidar.p, robot.T_base_lidar().p);
    const Eigen::Matrix3d covariance = found.extrinsic_covariance.bottomRightCorner<3, 3>();
    EXPECT_LT(std::sqrt(covariance(0, 0)), 0.5 * kTolerance_rad);
    EXPECT_LT(error_rad.dot(covariance.ldlt().solve(error_rad)), 16.3);  // chi-square of 3, 0.1 %
    EXPECT_EQ(run.said("extrinsic_differs"), !wrong_rad.isZero());
    EXPECT_EQ(run.mapper.status().health, LioHealth::kOk);
  }
}

TEST(LioMapper, stays_in_map_when_it_takes_over_how_the_lidar_is_turned) {
  const RoomDrive room;
  RobotConfig robot;
  robot.lidar_roll_pitch_yaw_base_rad += Eigen::Vector3d(0.02, -0.015, 0.0);
  Config config;
  config.extrinsic.estimate = true;
  Drive run(config, robot);
  run.after_sweep = [&](Nanoseconds begin_ns) {
    if (!run.scans.empty()) {
      StateUpdate update;
      update.fix_stamp_ns = begin_ns - 150'000'000;
      update.position_map_m = room.pose_at(to_seconds(update.fix_stamp_ns - kEpoch_ns)).p;
      update.covariance_map_m2 = 0.02 * 0.02 * Eigen::Matrix3d::Identity();
      update.decision.fill(AxisDecision::kFused);
      if (!run.mapper.status().aligned) {
        update.first_alignment = Alignment{0, {}, 1e-4 * Eigen::Matrix4d::Identity()};
      }
      run.take(run.mapper.on_state_update(update));
    }
  };
  run.drive(room, 0, 300);
  ASSERT_TRUE(run.mapper.status().aligned);
  ASSERT_LT(so3_log(run.mapper.calibration().T_base_lidar.q).norm(), 0.005);  // of 0.025
  constexpr double kLargestStep_m = 0.03;
  constexpr double kTolerance_m = 0.06;
  const auto in_map = [](const ScanResult& scan) -> Eigen::Vector3d {
    return scan.status.T_map_odom.pose() * scan.odometry.T_frame_child.p;
  };
  const auto truth = [&](const ScanResult& scan) {
    return room.pose_at(to_seconds(scan.odometry.stamp_ns - kEpoch_ns)).p;
  };
  for (std::size_t i = 1; i < run.scans.size(); ++i) {
    if (run.scans[i - 1].status.aligned) {
      const Eigen::Vector3d step_m = in_map(run.scans[i]) - in_map(run.scans[i - 1]);
      const Eigen::Vector3d true_m = truth(run.scans[i]) - truth(run.scans[i - 1]);
      EXPECT_NEAR(step_m.norm(), true_m.norm(), kLargestStep_m) << i;
      EXPECT_NEAR(step_m.z(), true_m.z(), kLargestStep_m) << i;
    }
    if (i > run.scans.size() / 2) {
      EXPECT_LT((in_map(run.scans[i]) - truth(run.scans[i])).norm(), kTolerance_m) << i;
    }
  }
}

TEST(LioMapper, finds_its_speed_and_level_when_it_starts_in_motion) {
  constexpr double kTolerance_m = 0.05;
  const RoomDrive room(0.0, 4.0);
  Drive run;
  run.drive(room, 0, 60);
  run.take(run.mapper.finish());
  ASSERT_GE(run.scans.size(), 59U);
  EXPECT_LT(run.error(room, run.scans.back().odometry).norm(), kTolerance_m);
  const Pose truth = room.pose_at(to_seconds(run.scans.back().odometry.stamp_ns - kEpoch_ns));
  const Eigen::Vector3d tilt =
      roll_pitch_yaw_of(run.scans.back().odometry.T_frame_child.q) - roll_pitch_yaw_of(truth.q);
  EXPECT_LT(tilt.head<2>().norm(), 0.01);
}

TEST(LioMapper, gives_the_same_bits_every_time) {
  const RoomDrive room;
  Drive a;
  Drive b;
  a.drive(room, 0, 30);
  b.drive(room, 0, 30);
  ASSERT_EQ(a.scans.size(), b.scans.size());
  ASSERT_FALSE(a.scans.empty());
  for (std::size_t i = 0; i < a.scans.size(); ++i) {
    EXPECT_EQ(a.scans[i].odometry.T_frame_child.p, b.scans[i].odometry.T_frame_child.p);
    EXPECT_EQ(a.scans[i].odometry.pose_covariance, b.scans[i].odometry.pose_covariance);
  }
}

TEST(LioMapper, covariance_of_the_odometry_grows_with_the_distance_driven) {
  const RoomDrive room;
  Drive run;
  run.drive(room, 0, 100);
  const auto sigma = [](const ScanResult& scan) {
    return std::sqrt(scan.odometry.pose_covariance(0, 0));
  };
  const double distance_m = run.scans.back().status.distance_m;
  EXPECT_GT(sigma(run.scans.back()), DriftConfig{}.position_sigma_m_sqrtm * std::sqrt(distance_m));
  EXPECT_LT(run.scans.back().status.sigma[0], 0.02);  // relative to the local map it does not
}

/// Rows of an antenna at the truth, in a map turned and shifted against odom.
TEST(LioMapper, learns_where_odom_lies_in_map_from_rows_while_odom_goes_on_as_without_them) {
  const RoomDrive room;
  const YawPose T_map_odom{0.8, {50.0, -20.0, 5.0}};
  const Eigen::Vector3d lever{0.2, 0.1, 1.0};
  Drive with;
  bool aligned = false;
  with.after_sweep = [&](Nanoseconds begin_ns) {
    if (with.scans.empty()) {
      return;
    }
    StateUpdate update;
    update.fix_stamp_ns = begin_ns - 230'000'000;  // late, and between scans
    const Pose T = room.pose_at(to_seconds(update.fix_stamp_ns - kEpoch_ns));
    update.position_map_m = T_map_odom.pose() * (T * lever);
    update.covariance_map_m2 = 0.02 * 0.02 * Eigen::Matrix3d::Identity();
    update.lever_arm_base_m = lever;
    update.decision.fill(AxisDecision::kFused);
    if (!aligned) {  // wrong by 3 degrees and a metre, and says so
      Alignment alignment;
      alignment.T_map_odom = {0.85, {51.0, -20.5, 5.5}};
      alignment.covariance = Eigen::Vector4d(0.05 * 0.05, 1.0, 1.0, 1.0).asDiagonal();
      update.first_alignment = alignment;
      aligned = true;
    }
    with.take(with.mapper.on_state_update(update));
  };
  with.drive(room, 0, 150);
  const LioStatus status = with.mapper.status();
  EXPECT_TRUE(status.aligned);
  EXPECT_GT(status.rows_applied, 120U);
  EXPECT_EQ(status.rows_refused, 0U) << status.last_refusal;
  constexpr double kYawTolerance_rad = 0.005;  // 2 cm over the 16 m that were driven, with rows
  EXPECT_NEAR(status.T_map_odom.yaw_rad, T_map_odom.yaw_rad, kYawTolerance_rad);
  const Odometry& odometry = with.scans.back().odometry;
  const Eigen::Vector3d truth_map_m =
      T_map_odom.pose() * room.pose_at(to_seconds(odometry.stamp_ns - kEpoch_ns)).p;
  EXPECT_LT((status.T_map_odom.pose() * odometry.T_frame_child.p - truth_map_m).norm(), 0.03);

  Drive without;
  without.drive(room, 0, 150);
  EXPECT_LT((without.scans.back().odometry.T_frame_child.p - odometry.T_frame_child.p).norm(),
            0.01);
}

/// The newest scan after one row, told `delay` scans after the scan that covers its fix.
ScanResult with_a_row_told_late(const RoomDrive& room, int delay) {
  Drive drive;
  drive.drive(room, 0, 30);
  StateUpdate row;
  row.fix_stamp_ns = drive.scans.back().odometry.stamp_ns - 30'000'000;
  row.first_alignment = Alignment{0, {}, Eigen::Matrix4d::Identity()};
  row.decision.fill(AxisDecision::kLio);
  drive.take(drive.mapper.on_state_update(row));
  row.first_alignment.reset();
  row.decision.fill(AxisDecision::kFused);
  row.covariance_map_m2 = 0.04 * Eigen::Matrix3d::Identity();
  row.position_map_m = {0.5, -0.3, 0.2};
  drive.drive(room, 30, 30 + delay);
  drive.take(drive.mapper.on_state_update(row));
  drive.drive(room, 30 + delay, 40);
  EXPECT_EQ(drive.mapper.status().rows_applied, 1U);
  return drive.scans.back();
}

TEST(LioMapper, a_row_told_late_ends_as_the_same_row_told_at_once) {
  constexpr double kTolerance_m = 1e-3;  // of a row that moves T_map_odom by half a metre
  const RoomDrive room;
  const ScanResult at_once = with_a_row_told_late(room, 0);
  const ScanResult late = with_a_row_told_late(room, 8);
  EXPECT_GT(at_once.status.T_map_odom.p.norm(), 0.4);
  EXPECT_LT((at_once.status.T_map_odom.p - late.status.T_map_odom.p).norm(), kTolerance_m);
  EXPECT_NEAR(at_once.status.T_map_odom.yaw_rad, late.status.T_map_odom.yaw_rad, 1e-3);
  EXPECT_LT((at_once.status.T_map_odom_covariance - late.status.T_map_odom_covariance).norm(),
            1e-3 * late.status.T_map_odom_covariance.norm());
  EXPECT_LT((at_once.odometry.T_frame_child.p - late.odometry.T_frame_child.p).norm(),
            kTolerance_m);
}

TEST(LioMapper, takes_an_alignment_that_replaces_its_own_and_no_other) {
  const RoomDrive room;
  Drive run;
  run.drive(room, 0, 20);
  StateUpdate update;
  update.fix_stamp_ns = run.scans.back().odometry.stamp_ns;
  update.decision.fill(AxisDecision::kLio);
  const auto heading_after = [&](double yaw_rad, bool replaces) {
    update.first_alignment =
        Alignment{0, {yaw_rad, {}}, 0.01 * Eigen::Matrix4d::Identity(), replaces};
    run.take(run.mapper.on_state_update(update));
    return run.mapper.status().T_map_odom.yaw_rad;
  };
  EXPECT_NEAR(heading_after(0.1, false), 0.1, 1e-9);
  EXPECT_NEAR(heading_after(0.2, false), 0.1, 1e-9);
  EXPECT_NEAR(heading_after(0.3, true), 0.3, 1e-9);
}

TEST(LioMapper, refuses_rows_before_it_is_aligned_and_an_alignment_of_another_epoch) {
  const RoomDrive room;
  Drive run;
  run.drive(room, 0, 20);
  StateUpdate update;
  update.fix_stamp_ns = run.scans.back().odometry.stamp_ns;
  update.covariance_map_m2.setIdentity();
  update.decision.fill(AxisDecision::kFused);
  update.first_alignment = Alignment{7, {}, Eigen::Matrix4d::Identity()};
  run.take(run.mapper.on_state_update(update));
  EXPECT_FALSE(run.mapper.status().aligned);
  EXPECT_EQ(run.mapper.status().rows_refused, 1U);
  EXPECT_TRUE(run.said("row_refused_not_aligned"));
}

TEST(LioMapper, goes_on_when_inputs_are_spoilt_and_counts_them) {
  const RoomDrive room;
  Drive run;
  run.on_imu = [](int sweep, ImuSample& sample) {
    if (sweep == 15 && sample.stamp_ns % 50'000'000 == 0) {
      sample.gyro_radps.x() = kNaN;
    }
    return true;
  };
  run.on_cloud = [](int sweep, PointCloudMessage& cloud) {
    if (sweep == 16) {
      cloud.data.clear();
      cloud.width = 0;
      cloud.row_step = 0;
    }
    if (sweep == 18) {
      cloud.stamp_ns -= 500'000'000;
    }
    if (sweep == 20) {
      std::fill(cloud.data.begin(), cloud.data.end(), std::uint8_t{0xFF});  // NaN everywhere
    }
    return true;
  };
  run.drive(room, 0, 40);
  const LioStatus status = run.mapper.status();
  EXPECT_TRUE(run.said("imu_not_finite"));
  EXPECT_EQ(refused(status, "stamp_not_after_previous"), 1U);
  EXPECT_EQ(status.scans_received, 40U);
  EXPECT_EQ(status.scans_used, 36U);  // 3 spoilt, and the last waits for its IMU sample
  EXPECT_EQ(status.health, LioHealth::kOk);
  EXPECT_LT(run.error(room, run.scans.back().odometry).norm(), 0.02);
}

/// A scan under a stamp of another time lies where the robot was not, and so does all that it adds
/// to the map: 0.5 m at this speed.
TEST(LioMapper, corrects_stamps_while_the_lidars_clock_is_set_back_and_again) {
  constexpr double kTolerance_m = 0.02;
  const RoomDrive room;
  Drive run;
  run.on_cloud = [](int sweep, PointCloudMessage& cloud) {
    cloud.stamp_ns -= sweep >= 60 && sweep < 80 ? 250'000'000 : 0;
    return true;
  };
  run.drive(room, 0, 120);
  EXPECT_EQ(refused(run.mapper.status(), "stamp_not_after_previous"), 1U);
  EXPECT_EQ(refused(run.mapper.status(), "stamp_in_doubt"), 1U);
  EXPECT_TRUE(run.said("lidar_clock_stepped"));
  EXPECT_GE(run.mapper.status().scans_used, 117U);
  for (const ScanResult& scan : run.scans) {
    EXPECT_LT(run.error(room, scan.odometry).norm(), kTolerance_m);
  }
}

TEST(LioMapper, bridges_an_imu_gap_and_refuses_sweeps_that_a_long_one_touches) {
  const RoomDrive room;
  Drive run;
  run.on_imu = [](int sweep, ImuSample&) {
    return sweep != 20 && sweep != 21 && !(sweep >= 30 && sweep < 38);
  };
  run.drive(room, 0, 60);
  const LioStatus status = run.mapper.status();
  EXPECT_TRUE(run.said("imu_gap"));
  EXPECT_GE(refused(status, "imu_gap"), 8U);
  EXPECT_EQ(status.health, LioHealth::kOk);
  EXPECT_LT(run.error(room, run.scans.back().odometry).norm(), 0.05);
}

TEST(LioMapper, coasts_on_the_imu_and_says_so_when_the_lidar_sees_too_little) {
  const RoomDrive room;
  Drive run;
  run.on_cloud = [](int sweep, PointCloudMessage& cloud) {
    if (sweep >= 20 && sweep < 45) {
      cloud.width = 30;
      cloud.row_step = 30 * cloud.point_step;
      cloud.data.resize(cloud.row_step);
    }
    return true;
  };
  run.drive(room, 0, 30);
  EXPECT_EQ(run.mapper.status().health, LioHealth::kDegraded);
  const double sigma_before = run.mapper.status().sigma[0];
  run.drive(room, 30, 45);
  EXPECT_EQ(run.mapper.status().health, LioHealth::kLost);
  EXPECT_TRUE(run.said("lio_lost"));
  EXPECT_GT(run.mapper.status().sigma[0], sigma_before);
  EXPECT_LT(run.error(room, run.scans.back().odometry).norm(), 0.3);  // 2.5 s of IMU alone
  run.drive(room, 45, 60);
  EXPECT_EQ(run.mapper.status().health, LioHealth::kOk);
  EXPECT_LT(run.error(room, run.scans.back().odometry).norm(), 0.05);
}

TEST(LioMapper, does_not_start_with_an_imu_in_g_and_tells_the_remedy) {
  const RoomDrive room;
  Drive run;
  run.azimuths = 60;
  run.on_imu = [](int, ImuSample& sample) {
    sample.accel_mps2 /= 9.80665;
    return true;
  };
  run.drive(room, 0, 40);
  EXPECT_TRUE(run.scans.empty());
  EXPECT_TRUE(run.said("imu_in_g"));
  EXPECT_EQ(run.mapper.status().health, LioHealth::kInit);
  EXPECT_GT(refused(run.mapper.status(), "imu_implausible"), 20U);
}

TEST(LioMapper, refuses_sweeps_in_bounded_number_when_there_is_no_imu) {
  const RoomDrive room;
  Drive run;
  run.azimuths = 20;
  run.on_imu = [](int, ImuSample&) { return false; };
  run.drive(room, 0, 50);
  EXPECT_EQ(refused(run.mapper.status(), "imu_missing"), 20U);
  run.take(run.mapper.finish());
  EXPECT_EQ(refused(run.mapper.status(), "imu_missing"), 50U);
}

TEST(LioMapper, makes_keyframes_by_distance_with_points_in_base) {
  const RoomDrive room;
  Drive run;
  run.drive(room, 0, 100);
  std::vector<Keyframe> keyframes;
  for (const ScanResult& scan : run.scans) {
    if (scan.keyframe) {
      keyframes.push_back(*scan.keyframe);
    }
  }
  const double distance_m = run.mapper.status().distance_m;
  EXPECT_GT(static_cast<double>(keyframes.size()), 0.7 * distance_m);
  EXPECT_LT(static_cast<double>(keyframes.size()), 4.0 * distance_m);  // turns add some
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    EXPECT_EQ(keyframes[i].id, i);
    EXPECT_GT(keyframes[i].points_base.size(), 1000U);
  }
}

TEST(LioMapper, refuses_a_configuration_that_contradicts_itself) {
  Config config;
  config.sweep.min_range_m = 10.0;
  config.sweep.max_range_m = 5.0;
  EXPECT_THROW(LioMapper(config, RobotConfig{}), ConfigError);
}

}  // namespace

}  // namespace trigpoint::lio_mapper
