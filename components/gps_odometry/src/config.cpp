// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/gps_odometry/config.hpp"

#include "trigpoint/base/config.hpp"

namespace trigpoint::gps_odometry {

namespace {

constexpr Bounds kShare{0.0, 1.0};

void describe_output(Config& c, ConfigFields& f) {
  f.choice(
      "filter",
      c.filter,
      "The filter of an offline run: ekf15 (the paper's states) or eskf18 (error-state INS); on "
      "the bus each is a program of its own. To compare with: ekf15_strict, the published filter, "
      "and ekf15_lio_sam, the same with the settings that LIO-SAM ships",
      {"ekf15", "eskf18", "ekf15_strict", "ekf15_lio_sam"});
  f.number("publish_rate_hz", c.publish_rate_hz, "Highest rate of gps/odometry (Hz)", kPositive);
  f.number("dead_reckoning_after_s",
           c.dead_reckoning_after_s,
           "Health DEAD_RECKONING when the last accepted fix is older (s); at least two and a half "
           "fix intervals",
           kPositive);
  f.number("stale_after_s",
           c.stale_after_s,
           "Health STALE when the last accepted fix is older (s)",
           kPositive);
}

void describe_datum(Config& c, ConfigFields& f) {
  f.flag("use_configured_datum",
         c.use_configured_datum,
         "Take the datum from here; otherwise from the bus, or else from an election");
  f.number("datum_latitude_deg", c.datum_latitude_deg, "Datum", {-90.0, 90.0});
  f.number("datum_longitude_deg", c.datum_longitude_deg, "Datum", {-180.0, 180.0});
  f.number("datum_height_m", c.datum_height_m, "Datum, above the WGS 84 ellipsoid");
  f.number("datum_wait_s",
           c.datum_wait_s,
           "Data time to wait for somebody else's datum before electing one (s)",
           kNotNegative);
  f.integer("datum_fixes", c.datum_fixes, "Fixes whose mean an elected datum is", {1, 1000});
}

void describe_map(Config& c, ConfigFields& f) {
  f.choice("projection",
           c.projection,
           "How fixes become positions in map: enu (tangent plane) or utm (the paper's equations "
           "6-7); both give true metres along east, north, up",
           {"enu", "utm"});
  f.number("warn_distance_m",
           c.warn_distance_m,
           "A warning when fixes are farther from the datum (m)",
           kPositive);
  f.number("highest_distance_m",
           c.highest_distance_m,
           "Fixes farther from the datum are refused until one was nearer (m)",
           kPositive);
}

void describe_clock(Config& c, ConfigFields& f) {
  f.number(
      "clock_same_s",
      c.clock_same_s,
      "A fix that seems to be this late at most has the IMU's clock; beyond, its stamps may have "
      "gone back (s)",
      kPositive);
  f.number("clock_latest_s",
           c.clock_latest_s,
           "No fix is later than this: one that seems to be has another clock than the IMU (s)",
           kPositive);
  f.number("clock_latency_s",
           c.clock_latency_s,
           "Where the clocks differ: least time from a fix's epoch to its arrival (s)",
           kNotNegative);
  f.number("clock_latency_sigma_s",
           c.clock_latency_sigma_s,
           "How far that may be wrong (s); times the speed it is added to the fix's sigma",
           kNotNegative);
}

void describe_aiding(Config& c, ConfigFields& f) {
  f.number("twist_interval_s",
           c.twist_interval_s,
           "Twists (robot.twist_topic): shortest time between two that are used",
           kPositive);
  f.number("twist_default_sigma_mps",
           c.twist_default_sigma_mps,
           "Forward velocity of a twist without covariance; its other axes are not used",
           kPositive);
  f.number(
      "twist_floor_sigma_mps", c.twist_floor_sigma_mps, "Added to what a twist reports", kPositive);
  f.number("twist_share",
           c.twist_share,
           "The same as a share of the speed: wheel radius, slip",
           kNotNegative);
  f.vector3("twist_point_base_m",
            c.twist_point_base_m,
            "The point whose velocity a twist is, e.g. the middle of the rear axle");
  f.number("yaw_interval_s",
           c.yaw_interval_s,
           "Headings (robot.yaw_topic): shortest time between two that are used",
           kPositive);
}

void describe_checks(Config& c, ConfigFields& f) {
  f.number("future_limit_s",
           c.future_limit_s,
           "A fix stamped further ahead of the newest IMU sample is refused (s)",
           kNotNegative);
  f.number("rewind_s",
           c.rewind_s,
           "Length of the rewind buffer: older fixes are refused (s)",
           {0.05, 10.0});
  f.number("highest_speed_mps",
           c.highest_speed_mps,
           "Fixes that imply more are refused as teleports (m/s)",
           kPositive);
  f.number("recovery_s",
           c.recovery_s,
           "After refusing fixes that agree with each other for this long the position is set to "
           "them (s)",
           kPositive);
  f.number("gate_probability",
           c.gate_probability,
           "Chi-square gate: share of good fixes that pass, horizontal (2 degrees of freedom) and "
           "vertical (1)",
           {0.9, 0.999999});
  f.integer("frozen_fixes",
            c.frozen_fixes,
            "Identical positions in a row that are believed while the filter moves",
            {1, 1000});
}

void describe_fix(Config& c, ConfigFields& f) {
  f.number("default_sigma_code_m",
           c.default_sigma_code_m,
           "Horizontal sigma of a plain fix without covariance (m); vertical twice that",
           kPositive);
  f.number("default_sigma_sbas_m", c.default_sigma_sbas_m, "The same, status SBAS", kPositive);
  f.number("default_sigma_float_m",
           c.default_sigma_float_m,
           "The same, status GBAS (RTK, fixed or float unknown)",
           kPositive);
  f.number(
      "default_sigma_fixed_m",
      c.default_sigma_fixed_m,
      "Horizontal sigma below which a fix counts as RTK fixed (m); below ten times that as float",
      kPositive);
  f.number("fix_sigma_scale",
           c.fix_sigma_scale,
           "Receivers are optimistic: reported sigma is multiplied by this",
           kPositive);
  f.number("fix_correlated_share",
           c.fix_correlated_share,
           "Share of a fix's variance that is correlated in time; it is added to what is published",
           kShare);
  f.number("correlated_decay_s",
           c.correlated_decay_s,
           "Time in which that share follows fixes that became better (peak hold)",
           kPositive);
  f.number("floor_sigma_fixed_m",
           c.floor_sigma_fixed_m,
           "Least published horizontal sigma in class fixed (m); vertical twice that",
           kPositive);
  f.number("floor_sigma_other_m",
           c.floor_sigma_other_m,
           "Least published horizontal sigma in other classes (m); vertical twice that",
           kPositive);
}

void describe_imu(Config& c, ConfigFields& f) {
  f.number("gyro_sigma_radps", c.gyro_sigma_radps, "Noise of a gyro sample", kPositive);
  f.number("accel_sigma_mps2",
           c.accel_sigma_mps2,
           "Noise of an accelerometer sample, vibration included",
           kPositive);
  f.number("gyro_bias_sigma_radps",
           c.gyro_bias_sigma_radps,
           "Gyro bias before the first rest",
           kPositive);
  f.number("gyro_bias_rest_sigma_radps",
           c.gyro_bias_rest_sigma_radps,
           "Gyro bias left after it was averaged at rest",
           kPositive);
  f.number("gyro_bias_horizon_s",
           c.gyro_bias_horizon_s,
           "Least time for which the attitude noise stands in for the missing gyro bias state; it "
           "grows with the age of the last fix",
           kPositive);
  f.number("accel_bias_sigma_mps2", c.accel_bias_sigma_mps2, "Accelerometer bias", kPositive);
  f.number("accel_bias_horizon_s",
           c.accel_bias_horizon_s,
           "The same, velocity noise and accelerometer bias",
           kPositive);
  f.number("attitude_noise_rad_sqrts",
           c.attitude_noise_rad_sqrts,
           "Random walk of the attitude beyond the gyro's noise (rad/sqrt(s))",
           kPositive);
  f.number("rate_noise_radps_sqrts",
           c.rate_noise_radps_sqrts,
           "Random walk of the body rates (rad/s/sqrt(s)): 1 rad/s^2 for half a second is 0.7",
           kPositive);
  f.number("acceleration_sigma_mps2",
           c.acceleration_sigma_mps2,
           "Manoeuvres: standard deviation of the change of body velocity per second",
           kPositive);
  f.number(
      "acceleration_tau_s", c.acceleration_tau_s, "Manoeuvres: their correlation time", kPositive);
  f.number("longest_step_s",
           c.longest_step_s,
           "Prediction is cut into steps no longer than this (s)",
           {0.001, 0.05});
}

void describe_heading(Config& c, ConfigFields& f) {
  f.number("heading_sigma_rad",
           c.heading_sigma_rad,
           "Heading is taken from motion once it is this certain",
           kPositive);
  f.number("heading_baseline_m",
           c.heading_baseline_m,
           "And not before this distance was driven",
           kPositive);
  f.number(
      "heading_speed_mps", c.heading_speed_mps, "And not slower than this on average", kPositive);
  f.number("heading_converged_rad",
           c.heading_converged_rad,
           "Health is DEGRADED while the heading's sigma is larger",
           kPositive);
  f.number("heading_lost_rad",
           c.heading_lost_rad,
           "Heading is searched anew when its sigma became larger (after a long outage)",
           kPositive);
}

void describe_ins_imu(Eskf18Config& c, ConfigFields& f) {
  f.number("gyro_noise_radps_sqrthz",
           c.gyro_noise_radps_sqrthz,
           "Density of the gyro's noise, vibration included",
           kPositive);
  f.number("accel_noise_mps2_sqrthz",
           c.accel_noise_mps2_sqrthz,
           "Density of the accelerometer's noise, vibration included",
           kPositive);
  f.number("gyro_bias_walk_radps_sqrts",
           c.gyro_bias_walk_radps_sqrts,
           "Random walk of the gyro's bias (rad/s/sqrt(s))",
           kPositive);
  f.number("accel_bias_walk_mps2_sqrts",
           c.accel_bias_walk_mps2_sqrts,
           "Random walk of the accelerometer's bias (m/s^2/sqrt(s))",
           kPositive);
  f.number("gyro_bias_sigma_radps", c.gyro_bias_sigma_radps, "Gyro bias at start", kPositive);
  f.number(
      "accel_bias_sigma_mps2", c.accel_bias_sigma_mps2, "Accelerometer bias at start", kPositive);
  f.number("gyro_limit_radps",
           c.gyro_limit_radps,
           "Range of an axis of the gyro; samples at the limit count as unknown (ekf15, too)",
           kPositive);
  f.number("accel_limit_mps2", c.accel_limit_mps2, "The same of the accelerometer", kPositive);
}

void describe_ins_fix(Eskf18Config& c, ConfigFields& f) {
  f.number("fix_slow_share",
           c.fix_slow_share,
           "Share of a fix's variance (after fix_sigma_scale) that changes slowly: its own states",
           kPositive);
  f.number("fix_white_share",
           c.fix_white_share,
           "Share of a fix's variance that is new with every fix",
           kPositive);
  f.number("fix_tau_fixed_s",
           c.fix_tau_fixed_s,
           "Correlation time of the slow part in class fixed",
           kPositive);
  f.number("fix_tau_float_s", c.fix_tau_float_s, "The same in class float", kPositive);
  f.number("fix_tau_code_s", c.fix_tau_code_s, "The same in other classes", kPositive);
  f.integer("absorb_fixes",
            c.absorb_fixes,
            "After this many contradicting fixes that agree with each other the receiver is held "
            "to have jumped: its error state takes the difference",
            {2, 100});
  f.number("absorb_limit_s",
           c.absorb_limit_s,
           "A jump that lasts longer is believed: the position is set to the fixes (s). Five times "
           "as long where they stand",
           kPositive);
  f.number("suspect_outage_s",
           c.suspect_outage_s,
           "After a longer outage (s) the filter, not the receiver, is suspected; after recovery_s "
           "the position is set to the fixes",
           kPositive);
  f.number("doubt_hold_s",
           c.doubt_hold_s,
           "After the position was set: for this long its change stays in the published sigma, "
           "and health DEGRADED (s)",
           kNotNegative);
  f.number("doubt_decay_s", c.doubt_decay_s, "Then it decays with this time (s)", kPositive);
  f.number("better_class_decay_s",
           c.better_class_decay_s,
           "Peak hold: a variance that the receiver reported before it became better decays with "
           "this time in what is published (s)",
           kPositive);
}

void describe_ins_vehicle(Eskf18Config& c, ConfigFields& f) {
  f.flag("use_rest", c.use_rest, "No velocity and no rotation while the IMU says at rest");
  f.number("rest_velocity_sigma_mps",
           c.rest_velocity_sigma_mps,
           "Sigma of the velocity at rest, every half second",
           kPositive);
  f.number("rest_gyro_sigma_radps",
           c.rest_gyro_sigma_radps,
           "Least sigma of the gyro's mean over half a second at rest",
           kPositive);
  f.number("rest_highest_speed_mps",
           c.rest_highest_speed_mps,
           "A filter that is faster is not at rest, however quiet the IMU",
           kPositive);
  f.flag("no_side_slip",
         c.no_side_slip,
         "The vehicle rolls on wheels that do not slide sideways: off for tracks, skid steering, "
         "boats and aircraft");
  f.number("no_side_slip_sigma_mps",
           c.no_side_slip_sigma_mps,
           "Sigma of lateral and vertical velocity at low speed",
           kPositive);
  f.number("no_side_slip_share",
           c.no_side_slip_share,
           "And as a share of the speed: slip and mounting angles, which last, so several times "
           "their size",
           kNotNegative);
  f.number("no_side_slip_interval_s",
           c.no_side_slip_interval_s,
           "Time between two such measurements",
           kPositive);
  f.number("no_side_slip_speed_mps",
           c.no_side_slip_speed_mps,
           "Not slower than this: there they would fix a wrong heading",
           kPositive);
  f.number("no_side_slip_yaw_sigma_rad",
           c.no_side_slip_yaw_sigma_rad,
           "Not with a less certain heading",
           kPositive);
  f.vector3("no_side_slip_point_base_m",
            c.no_side_slip_point_base_m,
            "The point that does not slide: the middle of the axle that does not steer");
}

void describe_eskf18(Eskf18Config& config, ConfigFields& fields) {
  describe_ins_imu(config, fields);
  describe_ins_fix(config, fields);
  describe_ins_vehicle(config, fields);
}

}  // namespace

void describe(Config& config, ConfigFields& fields) {
  describe_output(config, fields);
  describe_datum(config, fields);
  describe_map(config, fields);
  describe_checks(config, fields);
  describe_clock(config, fields);
  describe_fix(config, fields);
  describe_imu(config, fields);
  describe_heading(config, fields);
  describe_aiding(config, fields);
  fields.section("eskf18", "only the filter eskf18", [&config](ConfigFields& f) {
    describe_eskf18(config.eskf18, f);
  });
}

}  // namespace trigpoint::gps_odometry
