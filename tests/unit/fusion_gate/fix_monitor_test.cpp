// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "control/fix_monitor.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace trigpoint::fusion_gate {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

Witness fix_at(double time_s, double off_m) {
  AcceptedFix fix{from_seconds(time_s), {off_m, 0.0, 0.0}, 1e-4 * Eigen::Matrix3d::Identity()};
  return {fix, fix, {}};
}

LioStatus aligned_lio(double sigma_m) {
  LioStatus lio;
  lio.aligned = true;
  lio.sigma.fill(sigma_m);
  lio.T_map_odom_covariance = 1e-6 * Matrix6d::Identity();
  return lio;
}

TEST(FixMonitor, finds_a_doubted_fix_worth_what_it_is_off_and_nothing_where_that_is_not_known) {
  Config config;
  config.mode = "smooth";
  FixMonitor monitor(config, Eigen::Vector3d::Zero());
  EXPECT_EQ(monitor.doubted_variance_m2(), kInfinite) << "no fix yet";
  monitor.on_alignment(fix_at(1.0, 0.0));
  EXPECT_TRUE(monitor.judge(fix_at(2.0, 0.0), aligned_lio(0.003)).trusted[0]);
  EXPECT_EQ(monitor.doubted_variance_m2(), kInfinite) << "none that is doubted";
  EXPECT_FALSE(monitor.judge(fix_at(3.0, 2.0), aligned_lio(0.003)).trusted[0]);
  EXPECT_NEAR(monitor.doubted_variance_m2(), 4.0, 0.1);
  EXPECT_FALSE(monitor.judge(fix_at(3.2, 2.0), aligned_lio(kNaN)).trusted[0]);
  EXPECT_EQ(monitor.doubted_variance_m2(), kInfinite) << "LIO's sigma is not finite";
}

}  // namespace
}  // namespace trigpoint::fusion_gate
