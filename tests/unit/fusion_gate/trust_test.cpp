// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "control/trust.hpp"

#include <gtest/gtest.h>

namespace trigpoint::fusion_gate {
namespace {

constexpr double kFixInterval_s = 0.2;

/// A robot at rest whose fixes lie `error_m` aside.
Sighting fix_at(double at_s, double error_m) {
  Sighting sighting;
  sighting.stamp_ns = from_seconds(at_s);
  sighting.gps_map_m = {error_m, 0.0, 0.0};
  sighting.gps_variance_m2.setConstant(0.03 * 0.03);
  return sighting;
}

Tests wrong() {
  return {Refusal{"off_level", "fix is off by 3.00 m, at most 0.20 m"}, false, "off"};
}

LioStatus lio() {
  LioStatus status;
  status.T_map_odom_covariance = Matrix6d::Identity() * 1e-6;
  return status;
}

/// Seconds of good fixes after a doubt of `doubt_s` until they are trusted.
double seconds_until_readmission(double doubt_s) {
  Trust trust(Config{}, Part::kLevel);
  double at_s = 0.0;
  for (; at_s < doubt_s; at_s += kFixInterval_s) {
    trust.judge(fix_at(at_s, 3.0), wrong(), lio());
  }
  const double end_s = at_s;
  for (; !trust.trusted() && at_s < end_s + 100.0; at_s += kFixInterval_s) {
    trust.judge(fix_at(at_s, 0.0), Tests{}, lio());
  }
  return at_s - kFixInterval_s - end_s;
}

TEST(Trust, doubts_at_the_first_contradiction_and_keeps_its_reason) {
  Trust trust(Config{}, Part::kLevel);
  EXPECT_EQ(trust.judge(fix_at(0.0, 0.0), Tests{}, lio()), Trust::Change::kNone);
  EXPECT_TRUE(trust.trusted());
  EXPECT_EQ(trust.judge(fix_at(0.2, 3.0), wrong(), lio()), Trust::Change::kDoubted);
  EXPECT_FALSE(trust.trusted());
  EXPECT_EQ(trust.reason().code, "off_level");
}

TEST(Trust, believes_again_after_fixes_agreed_for_as_long_as_they_were_in_doubt) {
  EXPECT_NEAR(seconds_until_readmission(0.2), 1.0, 1.5 * kFixInterval_s);  // at least a second
  EXPECT_NEAR(seconds_until_readmission(4.0), 4.0, 1.5 * kFixInterval_s);
  EXPECT_NEAR(seconds_until_readmission(60.0), 10.0, 1.5 * kFixInterval_s);  // readmit_s
}

TEST(Trust, never_believes_fixes_that_agree_with_each_other_elsewhere) {
  Trust trust(Config{}, Part::kLevel);
  for (int k = 0; k < 1000; ++k) {
    trust.judge(fix_at(0.2 * k, 3.0), wrong(), lio());
  }
  EXPECT_FALSE(trust.trusted());
  EXPECT_GT(trust.stretch().size(), 100U);
}

TEST(Trust, begins_the_stretch_anew_with_a_fix_that_does_not_agree) {
  Trust trust(Config{}, Part::kLevel);
  trust.judge(fix_at(0.0, 3.0), wrong(), lio());
  trust.judge(fix_at(0.2, 3.0), wrong(), lio());
  EXPECT_FALSE(trust.stretch_began());
  trust.judge(fix_at(0.4, 0.0), Tests{}, lio());
  EXPECT_TRUE(trust.stretch_began());
}

TEST(Trust, wants_the_stricter_limit_kept_for_coming_back) {
  Trust trust(Config{}, Part::kLevel);
  trust.judge(fix_at(0.0, 3.0), wrong(), lio());
  Tests near_miss;
  near_miss.enters = false;
  near_miss.lack = "fix is off by 0.40 m, at most 0.38 m";
  for (int k = 1; k < 100; ++k) {
    trust.judge(fix_at(0.2 * k, 0.0), near_miss, lio());
  }
  EXPECT_FALSE(trust.trusted());
  EXPECT_EQ(trust.reason().reason, near_miss.lack);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
