// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A filter that takes over from another one while the robot drives.
#include "warm_start.hpp"

#include "trigpoint/base/so3.hpp"

#include "driven.hpp"
#include "ins_tracker.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kSwap_s = 25.3;        // in the middle of a turn
constexpr double kHonestSigmas = 3.0;   // issue: first honest position
constexpr double kFirstWithin_s = 2.0;  // issue
constexpr double kConverged_s = 12.0;   // ekf15 sees yaw in the next turn only
constexpr double kWorstSigmas = 4.0;    // of all the positions that follow

struct Takeover {
  double first_s{kNaN};      ///< from the start to the first odometry
  double first_sigmas{0.0};  ///< its worst axis
  double worst_sigmas{0.0};
  double first_sigma_m{0.0};
  double worst_yaw_sigmas{0.0};
  double converged_s{kNaN};  ///< from the start to health OK
  double first_yaw_error_rad{0.0};
  GpsHealth first_health{GpsHealth::kInit};
  bool not_ok_while_turning_unknown{true};
  std::string datum_id;
  std::uint32_t resets{0};
  bool warm{false};
};

using Alter = std::function<void(Odometry&)>;

/// `first` drives until kSwap_s and dies; `second` starts `pause_s` later and is told the last
/// odometry, altered. Fixes come as sensed, from `fixes_from_s` on.
Takeover swap(const std::string& first,
              const std::string& second,
              double pause_s,
              bool tell = true,
              const Alter& alter = {},
              double fixes_from_s = 0.0,
              unsigned seed = 1) {
  const auto truth = drive(town(1.5, 3.0), 60.0);
  const auto inputs = sense(truth, rtk_robot(), seed);
  GpsOdometry before(config_with_datum(first), rtk_robot().robot);
  std::optional<Odometry> last;
  std::size_t next = 0;
  for (; inputs[next].available_s < kSwap_s; ++next) {
    const Input& input = inputs[next];
    const Output output = input.is_fix ? before.on_fix(input.fix) : before.on_imu(input.imu);
    last = output.odometry ? output.odometry : last;
  }
  Config config;
  config.filter = second;
  GpsOdometry after(config, rtk_robot().robot);
  after.on_datum(test_datum());
  if (alter) {
    alter(*last);
  }
  if (tell) {
    after.on_odometry(*last, test_datum().id());
  }
  Takeover result;
  const double start_s = kSwap_s + pause_s;
  for (; next < inputs.size(); ++next) {
    const Input& input = inputs[next];
    if (input.available_s < start_s || (input.is_fix && input.available_s < fixes_from_s)) {
      continue;
    }
    const Output output = input.is_fix ? after.on_fix(input.fix) : after.on_imu(input.imu);
    result.warm = result.warm || has_event(output.events, "warm_start");
    if (std::isnan(result.converged_s) && after.status().health == GpsHealth::kOk) {
      result.converged_s = input.available_s - start_s;
    }
    if (!output.odometry) {
      continue;
    }
    const Odometry& odometry = *output.odometry;
    const double time_s = to_seconds(odometry.stamp_ns - kEpoch_ns);
    const Truth& now = truth.at(static_cast<std::size_t>(std::lround(time_s * 1000.0)));
    const double sigmas =
        (odometry.T_frame_child.p - now.position_map_m)
            .cwiseAbs()
            .cwiseQuotient(odometry.pose_covariance.diagonal().head<3>().cwiseSqrt())
            .maxCoeff();
    result.worst_sigmas = std::max(result.worst_sigmas, sigmas);
    const double yaw_error_rad = wrap_angle(yaw_of(odometry.T_frame_child.q) - now.yaw_rad);
    result.worst_yaw_sigmas =
        std::max(result.worst_yaw_sigmas,
                 std::abs(yaw_error_rad) / std::sqrt(odometry.pose_covariance(5, 5)));
    if (std::isnan(result.first_s)) {
      result.first_s = input.available_s - start_s;
      result.first_sigmas = sigmas;
      result.first_sigma_m = std::sqrt(odometry.pose_covariance(0, 0));
      result.first_health = after.status().health;
      result.first_yaw_error_rad = yaw_error_rad;
    }
  }
  result.datum_id = after.datum()->id();
  result.resets = after.status().reset.counter;
  return result;
}

class WarmStart : public ::testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(WarmStart, gives_an_honest_position_within_two_seconds_and_is_degraded_until_it_knows) {
  const auto [first, second] = GetParam();
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Takeover warm = swap(first, second, 0.8, true, {}, 0.0, seed);
    const Takeover cold = swap(first, second, 0.8, false, {}, 0.0, seed);
    ASSERT_TRUE(warm.warm);
    EXPECT_LT(warm.first_s, kFirstWithin_s);
    EXPECT_LT(warm.first_sigmas, kHonestSigmas);
    EXPECT_LT(warm.worst_sigmas, kWorstSigmas);
    EXPECT_LT(warm.worst_yaw_sigmas, kWorstSigmas);
    EXPECT_LT(std::abs(warm.first_yaw_error_rad), 0.3);
    EXPECT_EQ(warm.first_health, GpsHealth::kDegraded);
    EXPECT_LT(warm.first_s, cold.first_s);
    EXPECT_LT(warm.converged_s, kConverged_s);
    EXPECT_EQ(warm.datum_id, test_datum().id());
    std::printf(
        "%s -> %s, seed %u: first position after %.2f s (%.1f sigma of %.2f m), OK after "
        "%.1f s; without warm start %.2f s (%.1f of %.2f m), OK after %.1f s\n",
        first,
        second,
        seed,
        warm.first_s,
        warm.first_sigmas,
        warm.first_sigma_m,
        warm.converged_s,
        cold.first_s,
        cold.first_sigmas,
        cold.first_sigma_m,
        cold.converged_s);
  }
}

TEST_P(WarmStart, goes_on_in_an_outage_and_says_that_it_reckons) {
  const auto [first, second] = GetParam();
  const Takeover warm = swap(first, second, 0.8, true, {}, 35.0);
  EXPECT_LT(warm.first_s, kFirstWithin_s);
  EXPECT_LT(warm.first_sigmas, kHonestSigmas);
  EXPECT_LT(warm.worst_sigmas, kWorstSigmas);
  EXPECT_GT(warm.converged_s, 35.0 - kSwap_s - 0.8);
}

TEST_P(WarmStart, from_a_wrong_position_is_given_up_at_the_first_fix) {
  const auto [first, second] = GetParam();
  const Takeover wrong =
      swap(first, second, 0.8, true, [](Odometry& o) { o.T_frame_child.p.x() += 300.0; });
  const Takeover cold = swap(first, second, 0.8, false);
  EXPECT_TRUE(wrong.warm);
  EXPECT_NEAR(wrong.converged_s, cold.converged_s, 2.0);
}

TEST_P(WarmStart, from_a_heading_that_is_off_keeps_its_sigma_while_no_fix_corrects_it) {
  const auto [first, second] = GetParam();
  for (const double off_rad : {-0.3, 0.3}) {  // 1.5 sigma of what a start may claim at once
    const auto turn = [&](Odometry& o) {
      o.T_frame_child.q = from_yaw(off_rad) * o.T_frame_child.q;
    };
    const Takeover warm = swap(first, second, 0.0, true, turn, 35.0);
    EXPECT_LT(warm.worst_yaw_sigmas, kHonestSigmas) << off_rad;
    EXPECT_LT(warm.worst_sigmas, kWorstSigmas) << off_rad;
  }
}

TEST_P(WarmStart, from_a_heading_that_is_turned_round_recovers) {
  const auto [first, second] = GetParam();
  const Takeover turned = swap(first, second, 0.8, true, [](Odometry& o) {
    o.T_frame_child.q = from_yaw(std::acos(-1.0)) * o.T_frame_child.q;
  });
  EXPECT_LT(turned.converged_s, 30.0);
}

INSTANTIATE_TEST_SUITE_P(BothWays,
                         WarmStart,
                         ::testing::Values(std::pair{"ekf15", "eskf18"},
                                           std::pair{"eskf18", "ekf15"}),
                         [](const auto& parameter) {
                           return std::string(parameter.param.first) + "_to_" +
                                  parameter.param.second;
                         });

TEST(WarmStartOfEskf18, is_not_confirmed_by_wheels_that_only_know_what_they_were_told) {
  const InsTracker tracker(Config{}, Eigen::Vector3d::Zero());
  InsTrack track;
  CheckedImu imu;
  imu.accel_mps2 = imu.mean_accel_mps2 = {0.0, 0.0, 9.80665};
  imu.stamp_ns = stamp_of(0.0);
  tracker.apply(track, imu);
  WarmState state;
  state.stamp_ns = imu.stamp_ns;
  state.T_map_base.q = from_yaw(0.7);
  state.linear_base_mps = {10.0, 0.0, 0.0};
  state.rotation_covariance_rad2 = Eigen::Vector3d(4e-4, 4e-4, 0.04).asDiagonal();
  state.velocity_covariance_m2ps2 = Eigen::Matrix3d::Identity() * 0.01;
  tracker.warm_start(track, state);
  EXPECT_NEAR(tracker.yaw_sigma_rad(track), 0.2, 1e-9);
  for (int k = 1; k <= 100; ++k) {
    imu.stamp_ns = stamp_of(0.01 * k);
    tracker.apply(track, imu);
  }
  EXPECT_GT(track.no_side_slip_ns, 0);
  EXPECT_GT(tracker.yaw_sigma_rad(track), 0.19);
}

Odometry good_odometry() {
  Odometry odometry;
  odometry.stamp_ns = stamp_of(10.0);
  odometry.frame_id = "map";
  odometry.child_frame_id = "base_link";
  odometry.T_frame_child = {from_yaw(0.5), {1.0, 2.0, 3.0}};
  odometry.pose_covariance = PoseCovariance::Identity() * 1e-3;
  odometry.linear_mps = {2.0, 0.0, 0.0};
  odometry.angular_radps = {0.0, 0.0, 0.2};
  odometry.twist_covariance = Matrix6d::Identity() * 1e-3;
  return odometry;
}

TEST(WarmStartFault, is_found_in_frame_datum_covariance_and_heading) {
  const auto fault = [](const std::function<void(Odometry&)>& change, const char* datum = "here") {
    Odometry odometry = good_odometry();
    change(odometry);
    return find_warm_start_fault(odometry, datum, "here").value_or("");
  };
  EXPECT_EQ(fault([](Odometry&) {}), "");
  EXPECT_NE(fault([](Odometry& o) { o.frame_id = "odom"; }), "");
  EXPECT_NE(fault([](Odometry& o) { o.child_frame_id = "gnss_antenna"; }), "");
  EXPECT_NE(fault([](Odometry&) {}, "elsewhere"), "");
  EXPECT_NE(fault([](Odometry&) {}, ""), "");
  EXPECT_NE(fault([](Odometry& o) { o.pose_covariance(1, 1) = 0.0; }), "");
  EXPECT_NE(fault([](Odometry& o) { o.pose_covariance(5, 5) = 1e6; }), "");
  EXPECT_NE(fault([](Odometry& o) { o.pose_covariance(3, 3) = 1e300; }), "");
  EXPECT_NE(fault([](Odometry& o) { o.twist_covariance *= 1e9; }), "");
  EXPECT_NE(fault([](Odometry& o) { o.T_frame_child.p.x() = kNaN; }), "");
}

TEST(WarmStartFault, is_found_in_what_is_finite_but_impossible) {
  const auto fault = [](const std::function<void(Odometry&)>& change) {
    Odometry odometry = good_odometry();
    change(odometry);
    return find_warm_start_fault(odometry, "here", "here").value_or("");
  };
  EXPECT_THAT(fault([](Odometry& o) { o.T_frame_child.p.z() = -1e300; }),
              ::testing::HasSubstr("km"));
  EXPECT_THAT(fault([](Odometry& o) { o.linear_mps.x() = 1e9; }), ::testing::HasSubstr("m/s"));
  EXPECT_THAT(fault([](Odometry& o) { o.angular_radps.z() = 1e9; }), ::testing::HasSubstr("rad/s"));
  EXPECT_THAT(fault([](Odometry& o) { o.T_frame_child.q.coeffs().setZero(); }),
              ::testing::HasSubstr("norm"));
  EXPECT_THAT(fault([](Odometry& o) { o.T_frame_child.q.w() = 1e300; }),
              ::testing::HasSubstr("norm"));
}

TEST(WarmStartCarry, follows_the_circle_of_its_twist_and_grows_with_age) {
  // Speed 2 m/s at 0.2 rad/s is a circle of 10 m: chord and angle after 1.5 s in closed form.
  constexpr double kAge_s = 1.5;
  const auto state = carry_to(good_odometry(), stamp_of(10.0 + kAge_s));
  ASSERT_TRUE(state);
  const double angle = 0.2 * kAge_s;
  const Eigen::Vector3d expected =
      Eigen::Vector3d(1.0, 2.0, 3.0) + 10.0 * Eigen::Vector3d(std::sin(0.5 + angle) - std::sin(0.5),
                                                              std::cos(0.5) - std::cos(0.5 + angle),
                                                              0.0);
  EXPECT_LT((state->T_map_base.p - expected).norm(), 0.02);  // chord for arc: v t angle^2 / 24
  EXPECT_NEAR(yaw_of(state->T_map_base.q), 0.5 + angle, 1e-9);
  const auto fresh = carry_to(good_odometry(), stamp_of(10.0));
  EXPECT_GT(state->position_covariance_m2(0, 0), fresh->position_covariance_m2(0, 0));
  EXPECT_GT(fresh->position_covariance_m2(0, 0), good_odometry().pose_covariance(0, 0));
  EXPECT_GT(std::sqrt(fresh->rotation_covariance_rad2(2, 2)), Config{}.heading_converged_rad);
}

TEST(WarmStartCarry, refuses_what_is_older_than_three_seconds) {
  EXPECT_TRUE(carry_to(good_odometry(), stamp_of(12.9)));
  EXPECT_FALSE(carry_to(good_odometry(), stamp_of(13.1)));
  EXPECT_FALSE(carry_to(good_odometry(), stamp_of(9.4)));
}

TEST(WarmStartListening, ends_a_second_after_the_first_sample) {
  GpsOdometry filter(config_with_datum(), {});
  double ended_s = 0.0;
  for (double t = 0.0; t < 3.0; t += 0.01) {
    filter.on_imu(imu_at(t));
    ended_s = filter.wants_odometry() ? t : ended_s;
  }
  EXPECT_NEAR(ended_s, 1.0 + 0.19, 0.02);  // the first twenty samples only warm up
}

TEST(WarmStartListening, does_not_move_a_filter_that_runs) {
  Driven driven("eskf18");
  Odometry far = good_odometry();
  far.stamp_ns = stamp_of(20.0);
  driven.filter.on_odometry(far, test_datum().id());
  driven.advance(21.0);
  EXPECT_LT(driven.error_m(), kRtkTolerance_m);
  EXPECT_FALSE(has_event(driven.events, "warm_start"));
}

}  // namespace
}  // namespace trigpoint::gps_odometry
