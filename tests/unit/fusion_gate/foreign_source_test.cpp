// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/foreign_source.hpp"

#include "trigpoint/base/so3.hpp"
#include "trigpoint/fusion_gate/fusion_gate.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::fusion_gate {
namespace {

const Datum kDatum{49.0, 8.0, 100.0, 0};
const YawPose kTurned{1.2, {-40.0, 25.0, 3.0}};  // T_map_source: it began at its own first fix
const Eigen::Vector3d kLever_m{0.4, 0.1, 0.9};
constexpr double kSpeed_mps = 2.0;

Pose T_map_base(double t_s) {
  return {from_yaw(0.3 + 0.05 * t_s),
          {kSpeed_mps / 0.05 * std::sin(0.3 + 0.05 * t_s),
           -kSpeed_mps / 0.05 * std::cos(0.3 + 0.05 * t_s),
           0.0}};
}

Odometry foreign_odometry(double t_s, const std::string& child) {
  Odometry odometry;
  odometry.stamp_ns = from_seconds(t_s);
  odometry.frame_id = "map";
  odometry.child_frame_id = child;
  odometry.T_frame_child = kTurned.pose().inverse() * T_map_base(t_s);
  if (child == "gnss_antenna") {
    odometry.T_frame_child.p = odometry.T_frame_child * kLever_m;
  }
  odometry.pose_covariance.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * 1e-3;
  return odometry;
}

GnssFix fix_at(double t_s) {
  const geodesy::Geographic place =
      geodesy::LocalFrame(kDatum).to_geographic(T_map_base(t_s) * kLever_m);
  GnssFix fix;
  fix.stamp_ns = from_seconds(t_s);
  fix.status = FixStatus::kFix;
  fix.latitude_deg = place.latitude_deg;
  fix.longitude_deg = place.longitude_deg;
  fix.altitude_m = place.height_m;
  fix.covariance_enu_m2 = Eigen::Matrix3d::Identity() * 4e-4;
  fix.covariance_type = CovarianceType::kDiagonalKnown;
  return fix;
}

struct ForeignDrive {
  std::vector<StateUpdate> updates;
  FusionStatus status;
  std::optional<Odometry> selected;
};

/// Fixes of 5 Hz, odometry of 10 Hz whose stamps never meet the fixes', a level LIO as the mapper.
ForeignDrive drive(const std::string& child, double duration_s, bool fixes = true) {
  RobotConfig robot;
  robot.antenna_position_base_m = kLever_m;
  FusionGate gate({}, robot);
  gate.on_datum(kDatum);
  ForeignDrive result;
  const auto keep = [&](const Output& out) {
    result.updates.insert(result.updates.end(), out.state_updates.begin(), out.state_updates.end());
    result.status = out.status.value_or(result.status);
    result.selected = out.selected ? out.selected : result.selected;
  };
  for (int k = 0; k < std::lround(duration_s * 10.0); ++k) {
    const double t_s = 100.0 + 0.1 * k;
    keep(gate.on_gps_odometry(foreign_odometry(t_s, child), "ros"));
    Odometry lio;
    lio.stamp_ns = from_seconds(t_s + 0.01);
    lio.T_frame_child = T_map_base(t_s + 0.01);  // odom = map in this test
    lio.pose_covariance *= 1e-10;
    keep(gate.on_lio_odometry(lio));
    if (fixes && k % 2 == 0) {
      keep(gate.on_fix(fix_at(t_s + 0.04)));
    }
  }
  return result;
}

TEST(ForeignSource, is_brought_into_map_from_its_own_frame) {
  const ForeignDrive result = drive("base_link", 30.0);
  ASSERT_TRUE(result.selected);
  const double t_s = to_seconds(result.selected->stamp_ns);
  EXPECT_LT((result.selected->T_frame_child.p - T_map_base(t_s).p).norm(), 0.05);
  ASSERT_GT(result.updates.size(), 20U);
  for (const StateUpdate& update : result.updates) {
    const Eigen::Vector3d antenna_m = T_map_base(to_seconds(update.fix_stamp_ns)) * kLever_m;
    EXPECT_LT((update.position_map_m - antenna_m).norm(), 0.05);
  }
  EXPECT_EQ(result.status.gps_source, "ros");
  EXPECT_GT(result.status.fixes_seen, 100U);
}

TEST(ForeignSource, may_speak_of_the_antenna) {
  const ForeignDrive result = drive("gnss_antenna", 30.0);
  ASSERT_FALSE(result.updates.empty());
  const StateUpdate& last = result.updates.back();
  EXPECT_LT((last.position_map_m - T_map_base(to_seconds(last.fix_stamp_ns)) * kLever_m).norm(),
            0.05);
}

TEST(ForeignSource, gives_nothing_without_raw_fixes) {
  const ForeignDrive result = drive("base_link", 30.0, false);
  EXPECT_TRUE(result.updates.empty());
  EXPECT_FALSE(result.selected);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
