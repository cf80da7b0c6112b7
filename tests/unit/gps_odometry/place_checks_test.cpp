// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "place_checks.hpp"

#include "driven.hpp"
#include <gtest/gtest.h>

#include <string>

namespace trigpoint::gps_odometry {
namespace {

TEST(DatumDistance, warns_once_beyond_10_km) {
  DatumDistance distance{Config{}};
  EXPECT_TRUE(distance.check({9.9e3, 0.0, 0.0}).text.empty());
  const DistanceVerdict warned = distance.check({0.0, -10.1e3, 0.0});
  EXPECT_FALSE(warned.refused);
  EXPECT_FALSE(warned.text.empty());
  EXPECT_TRUE(distance.check({0.0, -11e3, 0.0}).text.empty());
  EXPECT_FALSE(distance.check({49e3, 0.0, 0.0}).refused);
}

TEST(DatumDistance, refuses_beyond_50_km_until_a_fix_was_nearer) {
  DatumDistance distance{Config{}};
  EXPECT_TRUE(distance.check({51e3, 0.0, 0.0}).refused);
  EXPECT_TRUE(distance.check({0.0, 6e6, 0.0}).refused);
  EXPECT_FALSE(distance.check({49e3, 0.0, 0.0}).refused);
  EXPECT_FALSE(distance.check({51e3, 0.0, 0.0}).refused) << "a long drive";
  EXPECT_TRUE(distance.check({kNaN, 0.0, 0.0}).refused);
}

TEST(DatumDistance, warns_again_after_a_return) {
  DatumDistance distance{Config{}};
  EXPECT_FALSE(distance.check({11e3, 0.0, 0.0}).text.empty());
  EXPECT_TRUE(distance.check({1e3, 0.0, 0.0}).text.empty());
  EXPECT_FALSE(distance.check({11e3, 0.0, 0.0}).text.empty());
}

TEST(HeightReference, tells_once_that_fixes_at_the_datum_have_other_heights) {
  HeightReference reference;
  int told = 0;
  for (int i = 0; i < 40; ++i) {
    told += reference.check(stamp_of(0.2 * i), {1.0, 2.0, 47.6}) ? 1 : 0;
  }
  EXPECT_EQ(told, 1);
}

TEST(HeightReference, says_nothing_about_hills_and_noise) {
  HeightReference reference;
  for (int i = 0; i < 400; ++i) {
    const double x = 2.0 * i;
    EXPECT_FALSE(reference.check(stamp_of(0.2 * i), {x, 0.0, 0.1 * x + 4.0 * (i % 2)}));
  }
}

TEST(HeightReference, tells_a_change_at_one_place) {
  HeightReference reference;
  EXPECT_FALSE(reference.check(stamp_of(0.0), {900.0, 0.0, 60.0}));
  EXPECT_TRUE(reference.check(stamp_of(0.2), {900.5, 0.0, 107.0}));
}

TEST(FrameIds, allow_any_frame_when_none_is_listed) {
  EXPECT_TRUE(FrameIds({}).allows("whatever"));
}

TEST(FrameIds, refuse_what_is_not_listed_and_tell_it_once) {
  FrameIds frames({"gnss", "gnss_front"});
  EXPECT_TRUE(frames.allows("gnss_front"));
  EXPECT_FALSE(frames.allows("gnss_rear"));
  EXPECT_TRUE(frames.is_news("gnss_rear"));
  EXPECT_FALSE(frames.is_news("gnss_rear"));
  EXPECT_NE(frames.text("gnss_rear").find("gnss_front"), std::string::npos);
}

// ---- the whole filter ---------------------------------------------------------------------------

class Places : public testing::TestWithParam<const char*> {};

/// A drive, at rest or not, whose fixes are changed before they are heard.
template <typename Change>
Recorded driven_with(const Config& config, const RobotConfig& robot, const Change& change) {
  const auto truth = drive(town(1.5, 3.0), 25.0);
  auto inputs = sense(truth, rtk_robot(), 6);
  for (Input& input : inputs) {
    change(input);
  }
  GpsOdometry filter(config, robot);
  return run(filter, inputs, truth);
}

TEST_P(Places, by_utm_are_the_same_map) {
  Config utm = config_with_datum(GetParam());
  utm.projection = "utm";
  const auto none = [](Input&) {};
  const Recorded by_enu = driven_with(config_with_datum(GetParam()), rtk_robot().robot, none);
  const Recorded by_utm = driven_with(utm, rtk_robot().robot, none);
  ASSERT_EQ(by_enu.odometry.size(), by_utm.odometry.size());
  constexpr double kMillimetre = 1e-3;
  EXPECT_LT(
      (by_enu.odometry.back().T_frame_child.p - by_utm.odometry.back().T_frame_child.p).norm(),
      kMillimetre);
}

TEST_P(Places, by_utm_are_told_with_convergence_and_scale_once) {
  Config utm = config_with_datum(GetParam());
  utm.projection = "utm";
  const auto told = [&](const std::string& code) {
    const Recorded result = driven_with(utm, rtk_robot().robot, [](Input&) {});
    return std::count_if(result.events.begin(), result.events.end(), [&](const Event& event) {
      return event.code == code;
    });
  };
  EXPECT_EQ(told("utm_projection"), 1);
  utm.datum_latitude_deg = 88.0;
  EXPECT_EQ(told("utm_not_possible"), 1);
}

/// A datum of a place that the grid of the new one does not reach.
TEST_P(Places, on_another_side_of_the_world_are_not_taken_for_the_datum) {
  Config utm;
  utm.filter = GetParam();
  utm.projection = "utm";
  const auto truth = drive(town(1.5, 3.0), 5.0);
  const auto inputs = sense(truth, rtk_robot(), 6);
  GpsOdometry filter(utm, rtk_robot().robot);
  const auto middle = std::find_if(
      inputs.begin(), inputs.end(), [](const Input& input) { return input.available_s > 1.5; });
  run(filter, {inputs.begin(), middle}, truth);
  ASSERT_GT(filter.status().fixes_accepted, 0U);
  filter.on_datum({0.0, -60.0, 0.0, 1});
  const Recorded result = run(filter, {middle, inputs.end()}, truth);
  constexpr double kFar_m = 3e6;
  ASSERT_FALSE(result.odometry.empty());
  EXPECT_GT(result.odometry.front().T_frame_child.p.norm(), kFar_m);
}

TEST_P(Places, too_far_from_the_datum_are_refused_and_publish_nothing) {
  Config far = config_with_datum(GetParam());
  far.datum_latitude_deg += 1.0;
  const Recorded result = driven_with(far, rtk_robot().robot, [](Input&) {});
  EXPECT_TRUE(result.odometry.empty());
  EXPECT_GT(count_of(result.statuses.back(), "far_from_datum"), 50U);
  EXPECT_EQ(result.statuses.back().health, GpsHealth::kInit);
}

TEST_P(Places, beyond_ten_kilometres_are_used_with_a_warning) {
  Config far = config_with_datum(GetParam());
  far.datum_latitude_deg += 0.2;
  const Recorded result = driven_with(far, rtk_robot().robot, [](Input&) {});
  EXPECT_FALSE(result.odometry.empty());
  EXPECT_TRUE(has_event(result.events, "fix_far_from_datum"));
}

TEST_P(Places, above_the_sea_are_put_on_the_ellipsoid_by_the_undulation) {
  RobotConfig robot = rtk_robot().robot;
  const auto above_sea = [](Input& input) { input.fix.altitude_m -= 47.6; };
  const Recorded wrong = driven_with(config_with_datum(GetParam()), robot, above_sea);
  EXPECT_TRUE(has_event(wrong.events, "height_reference"));
  robot.geoid_undulation_m = 47.6;
  const Recorded right = driven_with(config_with_datum(GetParam()), robot, above_sea);
  EXPECT_FALSE(has_event(right.events, "height_reference"));
  EXPECT_LT(rms_m(right.samples, 20.0), kRtkTolerance_m);
}

TEST_P(Places, in_unknown_frames_are_refused_and_told_once) {
  RobotConfig robot = rtk_robot().robot;
  robot.fix_frame_ids = {"gnss"};
  robot.imu_frame_ids = {"imu"};
  std::uint64_t others = 0;
  const Recorded result = driven_with(config_with_datum(GetParam()), robot, [&](Input& input) {
    others += input.is_fix && input.fix.stamp_ns % 1'000'000'000 == 0 ? 1 : 0;
    input.fix.frame_id = input.fix.stamp_ns % 1'000'000'000 == 0 ? "other" : "gnss";
    input.imu.frame_id = input.imu.stamp_ns % 100'000'000 == 0 ? "camera" : "imu";
  });
  EXPECT_EQ(count_of(result.statuses.back(), "unknown_frame"), others);
  EXPECT_GT(count_of(result.statuses.back(), "imu_unknown_frame"), 240U);
  EXPECT_EQ(std::count_if(result.events.begin(),
                          result.events.end(),
                          [](const Event& e) { return e.code == "refused_unknown_frame"; }),
            1);
  EXPECT_LT(rms_m(result.samples, 20.0), kRtkTolerance_m);
}

INSTANTIATE_TEST_SUITE_P(Filters, Places, testing::Values("ekf15", "eskf18"));

}  // namespace
}  // namespace trigpoint::gps_odometry
