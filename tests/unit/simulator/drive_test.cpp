// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "drive.hpp"

#include "trigpoint/base/so3.hpp"

#include "imu_model.hpp"
#include "relief.hpp"
#include "scenarios.hpp"
#include <gtest/gtest.h>

#include <numbers>

namespace trigpoint::simulator {

namespace {

constexpr std::uint64_t kSeed = 3;

struct Campus {
  Scenario scenario = load_scenario("campus");
  Relief relief{scenario.world, kSeed};
  Drive drive{scenario, relief, kSeed, scenario.duration_s};
};

/// A navigation state integrated from IMU samples alone, in map, on the turning Earth.
struct Strapdown {
  Eigen::Quaterniond q;
  Eigen::Vector3d v;
  Eigen::Vector3d p;
};

struct Rates {
  Eigen::Vector4d q;
  Eigen::Vector3d v;
  Eigen::Vector3d p;
};

Rates rates_of(const Strapdown& s, const ImuSample& imu, const EarthAtDatum& earth) {
  const Eigen::Vector3d omega = imu.gyro_radps - s.q.conjugate() * earth.omega_map_radps;
  const Eigen::Quaterniond dq = s.q * Eigen::Quaterniond(0.0, omega.x(), omega.y(), omega.z());
  return {0.5 * dq.coeffs(),
          s.q * imu.accel_mps2 - Eigen::Vector3d(0.0, 0.0, earth.gravity_mps2) -
              2.0 * earth.omega_map_radps.cross(s.v),
          s.v};
}

Strapdown moved(const Strapdown& s, const Rates& r, double h) {
  Eigen::Quaterniond q(Eigen::Vector4d(s.q.coeffs() + h * r.q));
  return {q.normalized(), s.v + h * r.v, s.p + h * r.p};
}

/// Classical Runge-Kutta over three consecutive samples.
Strapdown stepped(const Strapdown& s,
                  const ImuSample& a,
                  const ImuSample& b,
                  const ImuSample& c,
                  const EarthAtDatum& earth,
                  double h) {
  const Rates k1 = rates_of(s, a, earth);
  const Rates k2 = rates_of(moved(s, k1, 0.5 * h), b, earth);
  const Rates k3 = rates_of(moved(s, k2, 0.5 * h), b, earth);
  const Rates k4 = rates_of(moved(s, k3, h), c, earth);
  const Rates mean{(k1.q + 2.0 * k2.q + 2.0 * k3.q + k4.q) / 6.0,
                   (k1.v + 2.0 * k2.v + 2.0 * k3.v + k4.v) / 6.0,
                   (k1.p + 2.0 * k2.p + 2.0 * k3.p + k4.p) / 6.0};
  return moved(s, mean, h);
}

double largest_gap_of_strapdown(const Campus& campus,
                                const EarthAtDatum& felt,
                                const EarthAtDatum& assumed) {
  constexpr double kHalf_s = 0.005;
  const auto imu_at = [&](int i) { return ideal_imu(campus.drive.at_time(i * kHalf_s), felt); };
  const TrueState start = campus.drive.at_time(0.0);
  Strapdown s{start.T_map_base.q, start.v_map_mps, start.T_map_base.p};
  double largest = 0.0;
  for (int i = 0; i + 2 <= 60 * 200; i += 2) {
    s = stepped(s, imu_at(i), imu_at(i + 1), imu_at(i + 2), assumed, 2.0 * kHalf_s);
    largest =
        std::max(largest, (s.p - campus.drive.at_time((i + 2) * kHalf_s).T_map_base.p).norm());
  }
  return largest;
}

}  // namespace

TEST(Drive, is_reproduced_to_two_millimetres_by_integrating_the_ideal_imu_for_a_minute) {
  const Campus campus;
  const EarthAtDatum earth(campus.scenario.datum, true);
  const double gap_m = largest_gap_of_strapdown(campus, earth, earth);
  RecordProperty("gap_m", std::to_string(gap_m));
  EXPECT_LT(gap_m, 2e-3);
}

TEST(Drive, shows_that_the_integration_notices_a_tilt_of_gravity_and_an_ignored_earth_rotation) {
  const Campus campus;
  const EarthAtDatum earth(campus.scenario.datum, true);
  const EarthAtDatum still(campus.scenario.datum, false);
  EXPECT_GT(largest_gap_of_strapdown(campus, earth, still), 1.0);
  EarthAtDatum lighter = earth;
  lighter.gravity_mps2 -= 1e-3;
  EXPECT_GT(largest_gap_of_strapdown(campus, earth, lighter), 1.0);
}

TEST(Drive, has_velocity_acceleration_and_rates_that_equal_numerical_derivatives) {
  const Campus campus;
  constexpr double h = 1e-4;
  constexpr double kTolerance = 2e-4;  // truncation h^2 times the vibration's fourth derivative
  for (double t = 1.0; t < 120.0; t += 0.737) {
    const TrueState before = campus.drive.at_time(t - h);
    const TrueState at = campus.drive.at_time(t);
    const TrueState after = campus.drive.at_time(t + h);
    const Eigen::Vector3d v = (after.T_map_base.p - before.T_map_base.p) / (2.0 * h);
    const Eigen::Vector3d a = (after.v_map_mps - before.v_map_mps) / (2.0 * h);
    const Eigen::Vector3d omega =
        so3_log(before.T_map_base.q.conjugate() * after.T_map_base.q) / (2.0 * h);
    EXPECT_LT((v - at.v_map_mps).norm(), kTolerance) << "at " << t;
    EXPECT_LT((a - at.a_map_mps2).norm(), kTolerance) << "at " << t;
    EXPECT_LT((omega - at.omega_base_radps).norm(), kTolerance) << "at " << t;
  }
}

TEST(Drive, has_no_steps_in_acceleration_or_rates) {
  const Campus campus;
  constexpr double h = 1e-3;
  for (double t = 0.0; t < 120.0; t += h) {
    const TrueState a = campus.drive.at_time(t);
    const TrueState b = campus.drive.at_time(t + h);
    ASSERT_LT((b.a_map_mps2 - a.a_map_mps2).norm(), 0.2) << "at " << t;
    ASSERT_LT((b.omega_base_radps - a.omega_base_radps).norm(), 0.02) << "at " << t;
  }
}

TEST(Drive, stands_perfectly_still_for_the_configured_rest) {
  const Scenario scenario = small_scenario("motion: {rest_s: 2.5}\n");
  const Drive drive(scenario, Relief(scenario.world, kSeed), kSeed, 20.0);
  constexpr double kRounding = 1e-12;
  for (double t = 0.0; t <= 2.5; t += 0.01) {
    ASSERT_LT(drive.at_time(t).v_map_mps.norm(), kRounding) << "at " << t;
    ASSERT_LT(drive.at_time(t).omega_base_radps.norm(), kRounding) << "at " << t;
  }
  EXPECT_GT(drive.at_time(5.0).v_map_mps.norm(), 1.0);
}

TEST(Drive, starts_at_the_wanted_speed_when_there_is_no_rest) {
  const Scenario scenario = small_scenario("motion: {rest_s: 0.0}\n");
  const Drive drive(scenario, Relief(scenario.world, kSeed), kSeed, 10.0);
  EXPECT_NEAR(drive.at_time(0.0).v_map_mps.norm(), 4.0, 0.1);
}

TEST(Drive, stays_on_the_ground_and_points_where_it_goes) {
  const Campus campus;
  for (double t = 0.0; t < 120.0; t += 0.5) {
    const TrueState s = campus.drive.at_time(t);
    const Eigen::Vector3d& p = s.T_map_base.p;
    const double height = p.z() - campus.relief.height_m(p.x(), p.y());
    EXPECT_NEAR(height, campus.scenario.motion.base_height_m, 0.03) << "at " << t;
    if (s.v_map_mps.norm() > 1.0) {
      const Eigen::Vector3d v_base = s.T_map_base.q.conjugate() * s.v_map_mps;
      EXPECT_NEAR(std::atan2(v_base.y(), v_base.x()), 0.0, 0.03) << "at " << t;
      EXPECT_NEAR(std::atan2(v_base.z(), v_base.x()), 0.0, 0.03) << "at " << t;
    }
  }
}

TEST(Drive, keeps_to_the_limits_of_speed_and_lateral_acceleration) {
  const Campus campus;
  for (double t = 0.0; t < 120.0; t += 0.05) {
    const TrueState s = campus.drive.at_time(t);
    EXPECT_LT(s.v_map_mps.head<2>().norm(), 4.1) << "at " << t;
    EXPECT_LT(s.a_map_mps2.head<2>().norm(), 1.7) << "at " << t;
  }
}

TEST(Drive, closes_the_campus_route_and_ends_at_rest) {
  const Campus campus;
  const TrueState start = campus.drive.at_time(0.0);
  const TrueState end = campus.drive.at_time(campus.scenario.duration_s);
  EXPECT_LT((end.T_map_base.p - start.T_map_base.p).norm(), 1.0);
  EXPECT_NEAR(wrap_angle(yaw_of(end.T_map_base.q) - yaw_of(start.T_map_base.q)), 0.0, 0.02);
  EXPECT_LT(end.v_map_mps.norm(), 1e-6);
}

TEST(Drive, waits_at_a_stop) {
  const Scenario scenario = load_scenario_text(
      "route:\n  type: waypoints\n  waypoints:\n    - {east_m: 0.0, north_m: 0.0}\n"
      "    - {east_m: 10.0, north_m: 0.0, stop_s: 4.0}\n    - {east_m: 30.0, north_m: 0.0}\n",
      "stop.yaml");
  const Drive drive(scenario, Relief(scenario.world, kSeed), kSeed, 40.0);
  double standing_s = 0.0;
  for (double t = 4.0; t < 40.0; t += 0.01) {
    const TrueState s = drive.at_time(t);
    standing_s +=
        s.v_map_mps.norm() < 0.02 && std::abs(s.T_map_base.p.x() - 10.0) < 0.2 ? 0.01 : 0.0;
  }
  EXPECT_NEAR(standing_s, 4.0, 0.6);
}

TEST(Circle, is_driven_at_the_given_radius_and_speed_in_either_direction) {
  constexpr double kRadius_m = 4.0;
  constexpr double kSpeed_mps = 2.0;
  for (const double side : {1.0, -1.0}) {
    const Scenario scenario = load_scenario_text(
        "world: {relief_amplitude_m: 0.0}\n"
        "motion: {vibration_angle_rad: 0.0, vibration_heave_m: 0.0, roll_per_lateral_rad_s2pm: "
        "0.0}\n"
        "route: {type: circle, radius_m: 4.0, speed_mps: 2.0, laps: 20, clockwise: " +
            std::string(side < 0.0 ? "true" : "false") + "}\n",
        "circle.yaml");
    const Drive drive(scenario, Relief(scenario.world, 1), 1, 60.0);
    // The rounding of the entry, from straight on to the circle, moves the centre by millimetres.
    const Eigen::Vector2d p = drive.at_time(20.0).T_map_base.p.head<2>();
    const Eigen::Vector2d opposite =
        drive.at_time(20.0 + std::numbers::pi / (kSpeed_mps / kRadius_m)).T_map_base.p.head<2>();
    const Eigen::Vector2d centre = 0.5 * (p + opposite);
    EXPECT_LT((centre - Eigen::Vector2d(0.0, side * kRadius_m)).norm(), 0.2);
    for (double t_s = 20.0; t_s < 60.0; t_s += 0.37) {
      const TrueState state = drive.at_time(t_s);
      EXPECT_NEAR((state.T_map_base.p.head<2>() - centre).norm(), kRadius_m, 2e-3) << t_s;
      EXPECT_NEAR(state.v_map_mps.norm(), kSpeed_mps, 2e-3) << t_s;
      EXPECT_NEAR(state.omega_base_radps.z(), side * kSpeed_mps / kRadius_m, 2e-3) << t_s;
    }
  }
}

}  // namespace trigpoint::simulator
