// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Headings by two antennas or a magnetometer: what they say about T_map_odom, and what the gate
// makes of right and wrong ones.
#include "alignment/heading_prior.hpp"

#include "trigpoint/base/so3.hpp"

#include "simulated_drive.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>

namespace trigpoint::fusion_gate {
namespace {

using testing::HasSubstr;

constexpr double kPriorDegree_rad = std::numbers::pi / 180.0;
constexpr Nanoseconds kStart_ns = 100 * kNanosecondsPerSecond;

/// A robot that turns on the spot, tilted, and what it hears.
struct Turning {
  double yaw_map_odom_rad{3.1};
  PoseBuffer lio_poses{600 * kNanosecondsPerSecond, from_seconds(0.6)};
  HeadingPrior prior;

  double yaw_odom_rad(double now_s) const { return 0.2 * now_s; }

  Nanoseconds stamp_ns(double now_s) const { return kStart_ns + from_seconds(now_s); }

  void lio(double now_s) {
    const Pose pose{from_roll_pitch_yaw({0.05, -0.1, yaw_odom_rad(now_s)}),
                    Eigen::Vector3d::Zero()};
    lio_poses.add(stamp_ns(now_s), pose, PoseCovariance::Identity());
  }

  void hear(double now_s, double error_rad, double sigma_rad) {
    prior.hear({stamp_ns(now_s),
                wrap_angle(yaw_odom_rad(now_s) + yaw_map_odom_rad + error_rad),
                sigma_rad});
  }
};

TEST(HeadingPrior, is_the_yaw_of_odom_also_across_180_degrees) {
  Turning turning;  // 3.1 rad with errors on both sides: beyond pi
  for (int k = 0; k < 100; ++k) {
    const double now_s = 0.1 * k;
    turning.lio(now_s);
    turning.hear(now_s, k % 2 == 0 ? 0.08 : -0.08, 0.02);
  }
  turning.prior.match(turning.lio_poses);
  ASSERT_TRUE(turning.prior.prior());
  EXPECT_NEAR(wrap_angle(turning.prior.prior()->yaw_rad - 3.1), 0.0, 0.0801);
}

TEST(HeadingPrior, does_not_become_surer_by_repetition_but_less_sure_by_scatter) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  const auto sigma_after = [&](int headings, double scatter_rad) {
    Turning turning;
    for (int k = 0; k < headings; ++k) {
      turning.lio(0.5 * k);
      turning.hear(0.5 * k, scatter_rad * normal(generator), 0.02);
    }
    turning.prior.match(turning.lio_poses);
    return turning.prior.prior()->sigma_rad;
  };
  EXPECT_DOUBLE_EQ(sigma_after(5, 0.0), 0.02);
  EXPECT_DOUBLE_EQ(sigma_after(60, 0.0), 0.02);
  // The median deviation of 60 normal values knows their sigma to 15 % (one sigma).
  EXPECT_NEAR(sigma_after(60, 0.1), 0.1, 0.045);
}

TEST(HeadingPrior, ignores_a_third_of_wild_values) {
  Turning turning;
  for (int k = 0; k < 45; ++k) {
    turning.lio(0.5 * k);
    turning.hear(0.5 * k, k % 3 == 0 ? 1.5 : 0.0, 0.02);
  }
  turning.prior.match(turning.lio_poses);
  EXPECT_NEAR(wrap_angle(turning.prior.prior()->yaw_rad - 3.1), 0.0, 1e-9);
  EXPECT_DOUBLE_EQ(turning.prior.prior()->sigma_rad, 0.02);
}

TEST(HeadingPrior, waits_for_lio_and_drops_what_lio_has_not_seen) {
  Turning turning;
  turning.lio(0.0);
  for (int k = 0; k < 8; ++k) {
    turning.hear(0.5 * k, 0.0, 0.02);
  }
  turning.prior.match(turning.lio_poses);
  EXPECT_FALSE(turning.prior.prior());  // one is covered
  turning.lio(2.5);                     // a gap too long to interpolate over
  for (double now_s = 2.6; now_s < 4.0; now_s += 0.1) {
    turning.lio(now_s);
  }
  turning.prior.match(turning.lio_poses);
  EXPECT_FALSE(turning.prior.prior());  // with 2.5, 3 and 3.5 s four
  turning.lio(4.0);
  turning.hear(4.0, 0.0, 0.02);
  turning.prior.match(turning.lio_poses);
  EXPECT_TRUE(turning.prior.prior());
}

/// GPS of 0.3 m, which needs a way to tell the yaw, and two well mounted antennas.
Scenario coarse() {
  Scenario scenario;
  scenario.reception = {{1e9, 0.3, true, GpsHealth::kOk}};
  scenario.yaw_floor_sigma_rad = 0.005;
  scenario.duration_s = 60.0;
  return scenario;
}

struct Heard {
  Record record;
  std::optional<double> aligned_s;
  double yaw_rad{0.0};
  int contradictions{0};
};

Heard heard_in(const Record& record, Nanoseconds start_ns) {
  Heard heard{record, std::nullopt, 0.0, 0};
  for (const StateUpdate& update : heard.record.updates) {
    if (update.first_alignment && !heard.aligned_s) {
      heard.aligned_s = to_seconds(update.fix_stamp_ns - start_ns);
      heard.yaw_rad = update.first_alignment->T_map_odom.yaw_rad;
    }
  }
  for (const Event& event : heard.record.events) {
    heard.contradictions += event.code == "heading_contradicted" ? 1 : 0;
  }
  return heard;
}

/// Drives with a heading every half second, `offset_rad` wrong.
Heard drive_with_headings(std::optional<double> offset_rad, double sigma_rad) {
  SimulatedDrive drive{coarse()};
  for (double now_s = 0.0; now_s < 60.0; now_s += 0.5) {
    drive.run_until(now_s);
    if (offset_rad) {
      const double yaw_rad = yaw_of(drive.T_map_base(now_s).q) + *offset_rad;
      drive.keep(
          drive.gate().on_yaw({drive.stamp(now_s), "", from_yaw(yaw_rad), sigma_rad * sigma_rad}));
    }
  }
  return heard_in(drive.record(), drive.stamp(0.0));
}

TEST(FusionGate, aligns_sooner_with_a_heading_where_fixes_are_coarse) {
  const Heard without = drive_with_headings(std::nullopt, 0.0);
  const Heard with = drive_with_headings(0.0, 0.5 * kPriorDegree_rad);
  ASSERT_TRUE(without.aligned_s && with.aligned_s);
  EXPECT_LT(*with.aligned_s, 0.7 * *without.aligned_s);
  EXPECT_NEAR(
      wrap_angle(with.yaw_rad - Scenario{}.T_map_odom.yaw_rad), 0.0, 0.2 * kPriorDegree_rad);
  EXPECT_EQ(with.contradictions, 0);
}

TEST(FusionGate, leaves_a_wrong_heading_out_and_says_so_once) {
  const Heard without = drive_with_headings(std::nullopt, 0.0);
  const Heard wrong = drive_with_headings(40.0 * kPriorDegree_rad, 0.5 * kPriorDegree_rad);
  ASSERT_TRUE(wrong.aligned_s);
  EXPECT_NEAR(
      wrap_angle(wrong.yaw_rad - Scenario{}.T_map_odom.yaw_rad), 0.0, 1.0 * kPriorDegree_rad);
  EXPECT_DOUBLE_EQ(*wrong.aligned_s, *without.aligned_s);
  EXPECT_EQ(wrong.contradictions, 1);
}

Heard drive_with_filter(Scenario scenario, double yaw_sigma_rad, double slide_mps) {
  scenario.duration_s = 60.0;
  scenario.gps_yaw_sigma_rad = yaw_sigma_rad;
  scenario.slide_mps = slide_mps;
  SimulatedDrive drive{scenario};
  const Record record = drive.run();
  return heard_in(record, drive.stamp(0.0));
}

/// LIO witnesses no way there, but its attitude holds; nothing else tells the heading.
TEST(FusionGate, aligns_on_a_featureless_field_by_the_heading_of_the_gps_filter) {
  const Heard field = drive_with_filter({}, 0.5 * kPriorDegree_rad, 1.2);
  ASSERT_TRUE(field.aligned_s);
  EXPECT_LT(*field.aligned_s, 15.0);
  EXPECT_NEAR(
      wrap_angle(field.yaw_rad - Scenario{}.T_map_odom.yaw_rad), 0.0, 0.5 * kPriorDegree_rad);
  EXPECT_FALSE(drive_with_filter({}, 3.14, 1.2).aligned_s) << "of which the filter knows nothing";
}

TEST(FusionGate, leaves_the_heading_of_the_gps_filter_alone_where_lio_holds) {
  const Heard with = drive_with_filter(coarse(), 0.5 * kPriorDegree_rad, 0.0);
  const Heard without = drive_with_filter(coarse(), 3.14, 0.0);
  ASSERT_TRUE(with.aligned_s && without.aligned_s);
  EXPECT_DOUBLE_EQ(*with.aligned_s, *without.aligned_s);
}

TEST(FusionGate, refuses_what_is_no_heading_by_name_once) {
  FusionGate gate({}, {});
  YawMeasurement bad{kStart_ns, "", from_yaw(0.1), std::numeric_limits<double>::quiet_NaN()};
  const Output first = gate.on_yaw(bad);
  ASSERT_EQ(first.events.size(), 1U);
  EXPECT_EQ(first.events[0].code, "yaw_not_finite");
  EXPECT_TRUE(gate.on_yaw(bad).events.empty());
  bad.q_world_base.reset();
  EXPECT_EQ(gate.on_yaw(bad).events.size(), 1U);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
