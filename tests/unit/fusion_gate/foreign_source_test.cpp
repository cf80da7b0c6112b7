// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/foreign_source.hpp"

#include "trigpoint/base/so3.hpp"
#include "trigpoint/fusion_gate/fusion_gate.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

namespace trigpoint::fusion_gate {
namespace {

const Datum kDatum{49.0, 8.0, 100.0, 0};
const YawPose kTurned{1.2, {-40.0, 25.0, 3.0}};  // T_map_source: it began at its own first fix
const Eigen::Vector3d kForeignLever_m{0.4, 0.1, 0.9};
constexpr double kForeignSpeed_mps = 2.0;

Pose T_map_base(double t_s) {
  return {from_yaw(0.3 + 0.05 * t_s),
          {kForeignSpeed_mps / 0.05 * std::sin(0.3 + 0.05 * t_s),
           -kForeignSpeed_mps / 0.05 * std::cos(0.3 + 0.05 * t_s),
           0.0}};
}

Odometry foreign_odometry(double t_s, const std::string& child) {
  Odometry odometry;
  odometry.stamp_ns = from_seconds(t_s);
  odometry.frame_id = "map";
  odometry.child_frame_id = child;
  odometry.T_frame_child = kTurned.pose().inverse() * T_map_base(t_s);
  if (child == "gnss_antenna") {
    odometry.T_frame_child.p = odometry.T_frame_child * kForeignLever_m;
  }
  odometry.pose_covariance.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * 1e-3;
  return odometry;
}

GnssFix fix_at(double t_s) {
  const geodesy::Geographic place =
      geodesy::LocalFrame(kDatum).to_geographic(T_map_base(t_s) * kForeignLever_m);
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
  robot.antenna_position_base_m = kForeignLever_m;
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
    const Eigen::Vector3d antenna_m = T_map_base(to_seconds(update.fix_stamp_ns)) * kForeignLever_m;
    EXPECT_LT((update.position_map_m - antenna_m).norm(), 0.05);
  }
  EXPECT_EQ(result.status.gps_source, "ros");
  EXPECT_GT(result.status.fixes_seen, 100U);
}

TEST(ForeignSource, may_speak_of_the_antenna) {
  const ForeignDrive result = drive("gnss_antenna", 30.0);
  ASSERT_FALSE(result.updates.empty());
  const StateUpdate& last = result.updates.back();
  EXPECT_LT(
      (last.position_map_m - T_map_base(to_seconds(last.fix_stamp_ns)) * kForeignLever_m).norm(),
      0.05);
}

TEST(ForeignSource, gives_nothing_without_raw_fixes) {
  const ForeignDrive result = drive("base_link", 30.0, false);
  EXPECT_TRUE(result.updates.empty());
  EXPECT_FALSE(result.selected);
}

// ---- a ROS 2 localisation node's stand-in: UTM axes, its own start
// --------------------------------

constexpr double kStandInError_m = 0.05;  // of fixes with 0.02 m, after admission
constexpr double kStandInSigmas = 4.0;

/// About 2.5 degrees from the central meridian of zone 32: convergence and scale are not small.
const Datum kFarEast{49.0, 11.4, 300.0, 0};
const Datum kOnMeridian{49.0, 9.0, 300.0, 0};

/// An oval of 300 m, driven at 5 m/s.
Pose long_way(double t_s) {
  const double angle = 0.035 * t_s;
  const Eigen::Vector3d p(150.0 * std::sin(angle), 60.0 * (1.0 - std::cos(angle)), 0.3 * angle);
  const Eigen::Vector2d v(150.0 * std::cos(angle), 60.0 * std::sin(angle));
  return {from_yaw(std::atan2(v.y(), v.x())), p};
}

struct StandIn {
  std::size_t admitted{0};
  double admitted_s{0.0};
  double rms_m{0.0};
  double worst_m{0.0};
  double worst_sigmas{0.0};
  double selected_m{0.0};  ///< error of what the gate follows, worst
  double true_scale{1.0};  ///< UTM over map, at the datum's height
  double convergence_deg{0.0};
};

/// `raw`: UTM coordinates themselves instead of those relative to its first fix.
StandIn drive_stand_in(const Datum& datum, bool raw, unsigned seed) {
  RobotConfig robot;
  robot.antenna_position_base_m = kForeignLever_m;
  FusionGate gate({}, robot);
  gate.on_datum(datum);
  const geodesy::LocalFrame frame(datum);
  const geodesy::UtmZone zone = geodesy::utm_zone_of(datum);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) -> Eigen::Vector3d {
    return Eigen::Vector3d(normal(random), normal(random), normal(random)) * sigma;
  };
  std::optional<Eigen::Vector3d> origin;
  StandIn result;
  double sum2 = 0.0;
  const auto keep = [&](const Output& out, double t_s) {
    if (out.selected) {
      result.selected_m = std::max(
          result.selected_m,
          (out.selected->T_frame_child.p - long_way(to_seconds(out.selected->stamp_ns)).p).norm());
    }
    for (const StateUpdate& update : out.state_updates) {
      const Eigen::Vector3d error =
          update.position_map_m - long_way(to_seconds(update.fix_stamp_ns)) * kForeignLever_m;
      result.admitted_s = result.admitted++ == 0 ? t_s : result.admitted_s;
      sum2 += error.squaredNorm();
      result.worst_m = std::max(result.worst_m, error.norm());
      result.worst_sigmas =
          std::max(result.worst_sigmas,
                   error.cwiseAbs()
                       .cwiseQuotient(update.covariance_map_m2.diagonal().cwiseSqrt())
                       .maxCoeff());
    }
  };
  for (int k = 0; k < 1800; ++k) {
    const double t_s = 100.0 + 0.1 * k;
    const Pose T = long_way(t_s);
    const auto utm = *geodesy::to_utm(frame.to_geographic(T.p), zone);
    Eigen::Vector3d p(utm.easting_m, utm.northing_m, utm.height_m);
    origin = origin.value_or(p);
    Odometry odometry;
    odometry.stamp_ns = from_seconds(t_s);
    odometry.frame_id = "map";
    odometry.child_frame_id = "base_link";
    // Grid north lies clockwise of true north by the convergence: a heading in the grid is larger.
    odometry.T_frame_child = {from_yaw(utm.convergence_deg * M_PI / 180.0) * T.q,
                              (raw ? p : Eigen::Vector3d(p - *origin)) + noise(0.01)};
    odometry.pose_covariance.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * 1e-4;
    keep(gate.on_gps_odometry(odometry, "ros"), t_s);
    Odometry lio;
    lio.stamp_ns = from_seconds(t_s + 0.01);
    lio.T_frame_child = long_way(t_s + 0.01);
    lio.pose_covariance *= 1e-10;
    keep(gate.on_lio_odometry(lio), t_s);
    if (k % 2 == 0) {
      const geodesy::Geographic place =
          frame.to_geographic(long_way(t_s + 0.04) * kForeignLever_m + noise(0.02));
      GnssFix fix = fix_at(t_s + 0.04);
      fix.latitude_deg = place.latitude_deg;
      fix.longitude_deg = place.longitude_deg;
      fix.altitude_m = place.height_m;
      keep(gate.on_fix(fix), t_s);
    }
    result.true_scale = utm.scale * (1.0 - datum.height_m / 6.37e6);
    result.convergence_deg = utm.convergence_deg;
  }
  result.rms_m = std::sqrt(sum2 / static_cast<double>(std::max<std::size_t>(result.admitted, 1)));
  return result;
}

class UtmStandIn : public ::testing::TestWithParam<std::pair<const char*, bool>> {};

TEST_P(UtmStandIn, is_accepted_once_its_offset_yaw_and_scale_are_known) {
  for (const Datum& datum : {kOnMeridian, kFarEast}) {
    for (unsigned seed = 1; seed <= (GetParam().second ? 1U : 2U); ++seed) {
      const StandIn result = drive_stand_in(datum, GetParam().second, seed);
      std::printf(
          "%s, %.1f E, scale %.6f, convergence %.2f deg: admitted after %.1f s, %zu fixes, "
          "rms %.3f m, worst %.3f m (%.1f sigma), selected at worst %.3f m\n",
          GetParam().first,
          datum.longitude_deg,
          result.true_scale,
          result.convergence_deg,
          result.admitted_s - 100.0,
          result.admitted,
          result.rms_m,
          result.worst_m,
          result.worst_sigmas,
          result.selected_m);
      ASSERT_GT(result.admitted, 700U);
      EXPECT_LT(result.rms_m, kStandInError_m);
      EXPECT_LT(result.worst_sigmas, kStandInSigmas);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(ForeignSource,
                         UtmStandIn,
                         ::testing::Values(std::pair{"own_start", false},
                                           std::pair{"raw_utm", true}),
                         [](const auto& parameter) { return std::string(parameter.param.first); });

}  // namespace
}  // namespace trigpoint::fusion_gate
