// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fix_checks.hpp"

#include "drive.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace trigpoint::gps_odometry {
namespace {

const Config kConfig;

GnssFix good_fix() {
  return fix_at({1.0, 2.0, 3.0}, 1.0, 0.014);
}

std::string reason_of(const GnssFix& fix) {
  const FixVerdict verdict = check_fix(fix, kConfig);
  EXPECT_FALSE(verdict.fix.has_value());
  EXPECT_FALSE(verdict.text.empty());
  return verdict.reason;
}

TEST(FixChecks, passes_a_good_fix_with_its_scaled_covariance) {
  const FixVerdict verdict = check_fix(good_fix(), kConfig);
  ASSERT_TRUE(verdict.fix.has_value());
  EXPECT_TRUE(verdict.reason.empty());
  EXPECT_EQ(verdict.fix->gnss_class, GnssClass::kFixed);
  EXPECT_NEAR(std::sqrt(verdict.fix->covariance_enu_m2(0, 0)), 2.0 * 0.014, 1e-3);
}

TEST(FixChecks, refuses_numbers_that_are_not_finite) {
  GnssFix fix = good_fix();
  fix.latitude_deg = kNaN;
  EXPECT_EQ(reason_of(fix), "not_finite");
  fix = good_fix();
  fix.altitude_m = std::numeric_limits<double>::infinity();
  EXPECT_EQ(reason_of(fix), "not_finite");
  fix = good_fix();
  fix.covariance_enu_m2(0, 1) = kNaN;
  EXPECT_EQ(reason_of(fix), "covariance_not_finite");
}

TEST(FixChecks, refuses_what_is_not_a_place) {
  GnssFix fix = good_fix();
  fix.latitude_deg = -2e10;
  EXPECT_EQ(reason_of(fix), "out_of_range");
  fix = good_fix();
  fix.longitude_deg = 541.0;
  EXPECT_EQ(reason_of(fix), "out_of_range");
  fix = good_fix();
  fix.altitude_m = 30'000.0;
  EXPECT_EQ(reason_of(fix), "out_of_range");
}

TEST(FixChecks, refuses_zeros_and_what_is_next_to_them) {
  GnssFix fix = good_fix();
  fix.latitude_deg = 0.0;
  fix.longitude_deg = 0.0;
  EXPECT_EQ(reason_of(fix), "zero_position");
  fix.latitude_deg = 5e-7;
  EXPECT_EQ(reason_of(fix), "zero_position");
}

TEST(FixChecks, refuses_a_message_without_a_fix) {
  GnssFix fix = good_fix();
  fix.status = FixStatus::kNoFix;
  EXPECT_EQ(reason_of(fix), "no_fix");
}

TEST(FixChecks, refuses_a_horizontal_variance_of_a_kilometre) {
  GnssFix fix = good_fix();
  fix.covariance_enu_m2(1, 1) = 1.7e308;
  EXPECT_EQ(reason_of(fix), "covariance_huge");
}

TEST(FixChecks, assumes_the_class_for_a_covariance_of_zero_unknown_or_negative) {
  GnssFix zero = good_fix();
  zero.covariance_enu_m2.setZero();
  GnssFix unknown = good_fix();
  unknown.covariance_type = CovarianceType::kUnknown;
  GnssFix negative = good_fix();
  negative.covariance_enu_m2(0, 0) = -1.0;
  for (GnssFix fix : {zero, unknown, negative}) {
    fix.status = FixStatus::kFix;
    const FixVerdict verdict = check_fix(fix, kConfig);
    ASSERT_TRUE(verdict.fix.has_value());
    EXPECT_EQ(verdict.reason, "used_with_default_covariance");
    EXPECT_TRUE(verdict.fix->assumed_covariance);
    EXPECT_NEAR(
        std::sqrt(verdict.fix->covariance_enu_m2(0, 0)), kConfig.default_sigma_code_m, 1e-3);
    EXPECT_NEAR(
        std::sqrt(verdict.fix->covariance_enu_m2(2, 2)), 2.0 * kConfig.default_sigma_code_m, 1e-3);
  }
}

TEST(FixChecks, uses_only_the_diagonal_of_a_covariance_that_is_none) {
  GnssFix fix = good_fix();
  fix.covariance_enu_m2 << 1.0, 5.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0, 1.0;
  const FixVerdict verdict = check_fix(fix, kConfig);
  ASSERT_TRUE(verdict.fix.has_value());
  EXPECT_EQ(verdict.reason, "used_with_diagonal_covariance");
  EXPECT_EQ(verdict.fix->covariance_enu_m2(0, 1), 0.0);
}

TEST(FixChecks, bounds_a_vertical_variance_without_bound) {
  for (const double variance_m2 : {1.1e6, 1e300, 1.7e308}) {
    GnssFix fix = good_fix();
    fix.covariance_enu_m2(2, 2) = variance_m2;
    fix.covariance_enu_m2(0, 2) = fix.covariance_enu_m2(2, 0) = 0.1;
    const FixVerdict verdict = check_fix(fix, kConfig);
    ASSERT_TRUE(verdict.fix.has_value());
    EXPECT_EQ(verdict.reason, "used_with_diagonal_covariance");
    EXPECT_NEAR(verdict.fix->covariance_enu_m2(2, 2),
                kConfig.fix_sigma_scale * kConfig.fix_sigma_scale * 1e6,
                1.0);
    EXPECT_EQ(verdict.fix->covariance_enu_m2(0, 2), 0.0);
  }
}

TEST(FixChecks, tells_fixed_from_float_from_code_by_the_covariance) {
  const auto class_at = [](double sigma_m, FixStatus status) {
    GnssFix fix = fix_at({1.0, 2.0, 3.0}, 1.0, sigma_m);
    fix.status = status;
    return check_fix(fix, kConfig).fix->gnss_class;
  };
  EXPECT_EQ(class_at(0.02, FixStatus::kGbas), GnssClass::kFixed);
  EXPECT_EQ(class_at(0.3, FixStatus::kGbas), GnssClass::kFloat);
  EXPECT_EQ(class_at(1.2, FixStatus::kFix), GnssClass::kCode);
  EXPECT_EQ(class_at(1.2, FixStatus::kSbas), GnssClass::kSbas);
}

TEST(FrozenReceiver, counts_identical_positions_in_a_row) {
  FrozenReceiver frozen;
  EXPECT_EQ(frozen.count({49.0, 8.0, 100.0}), 1);
  EXPECT_EQ(frozen.count({49.0, 8.0, 100.0}), 2);
  EXPECT_EQ(frozen.count({49.0, 8.0, 100.1}), 1);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
