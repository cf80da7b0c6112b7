// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/config.hpp"

#include "trigpoint/base/config.hpp"

namespace trigpoint::lio_mapper {

namespace {

void describe_sweep(SweepTimingConfig& c, ConfigFields& f) {
  f.choice("point_time",
           c.point_time,
           "where a point's time comes from: its own field, its azimuth, or none at all (snapshot)",
           {"field", "azimuth", "snapshot"});
  f.choice(
      "stamp_is", c.stamp_is, "what the cloud's stamp means", {"auto", "begin", "middle", "end"});
  f.text("time_field", c.time_field, "name of the time field, or auto");
  f.choice("time_unit", c.time_unit, "unit of the time field", {"auto", "s", "ms", "us", "ns"});
  f.number("sweep_period_s", c.sweep_period_s, "azimuth timing: duration of one turn", kPositive);
  f.number("first_azimuth_rad",
           c.first_azimuth_rad,
           "azimuth timing: where the sweep begins, 0 along +x, counter-clockwise");
  f.flag("clockwise", c.clockwise, "azimuth timing: direction of turning, seen from above");
  f.number("min_range_m", c.min_range_m, "nearer points are the robot itself", kNotNegative);
  f.number("max_range_m", c.max_range_m, "farther points are not used", kPositive);
  f.number(
      "time_offset_s", c.time_offset_s, "added to LiDAR stamps to bring them to the IMU's clock");
}

void describe_imu(ImuConfig& c, ConfigFields& f) {
  f.number("gyro_noise_radps_sqrthz",
           c.gyro_noise_radps_sqrthz,
           "white noise density, rad/s/sqrt(Hz), vibration included",
           kPositive);
  f.number("accel_noise_mps2_sqrthz",
           c.accel_noise_mps2_sqrthz,
           "white noise density, m/s^2/sqrt(Hz), vibration included",
           kPositive);
  f.number("gyro_bias_walk_radps_sqrts",
           c.gyro_bias_walk_radps_sqrts,
           "random walk of the gyro bias, rad/s per sqrt(s)",
           kNotNegative);
  f.number("accel_bias_walk_mps2_sqrts",
           c.accel_bias_walk_mps2_sqrts,
           "random walk of the accelerometer bias, m/s^2 per sqrt(s)",
           kNotNegative);
  f.number("initial_gyro_bias_sigma_radps",
           c.initial_gyro_bias_sigma_radps,
           "before the first motion",
           kPositive);
  f.number("initial_accel_bias_sigma_mps2",
           c.initial_accel_bias_sigma_mps2,
           "before the first motion",
           kPositive);
  f.number("max_gap_s",
           c.max_gap_s,
           "a longer interval between samples is bridged with inflated noise",
           kPositive);
  f.number(
      "lost_gap_s", c.lost_gap_s, "a sweep that touches a longer interval is refused", kPositive);
  f.number("gap_accel_mps2",
           c.gap_accel_mps2,
           "by how much the bridged acceleration may be wrong in a gap (one sigma)",
           kNotNegative);
  f.number("gap_gyro_radps", c.gap_gyro_radps, "the same of the turn rate", kNotNegative);
}

void describe_start(StartConfig& c, ConfigFields& f) {
  f.number("window_s",
           c.window_s,
           "IMU collected before odom is levelled; sweeps wait meanwhile",
           kPositive);
  f.number("max_speed_mps",
           c.max_speed_mps,
           "highest forward speed that a moving start may have",
           kNotNegative);
  f.number("speed_step_mps",
           c.speed_step_mps,
           "step of the speeds tried; within half a step a scan must find its match",
           kPositive);
  f.number("rest_speed_mps",
           c.rest_speed_mps,
           "a slower start counts as at rest when the IMU agrees",
           kPositive);
}

void describe_matching(MatchingConfig& c, ConfigFields& f) {
  f.number("voxel_m", c.voxel_m, "side of the voxels that thin a scan before matching", kPositive);
  f.number("range_sigma_m", c.range_sigma_m, "noise of a range", kPositive);
  f.number("angle_sigma_rad",
           c.angle_sigma_rad,
           "noise of a beam's direction; matters far away at grazing incidence",
           kNotNegative);
  f.number("robust_width", c.robust_width, "Huber width in sigmas", kPositive);
  f.number("grazing_cos",
           c.grazing_cos,
           "a plane that the beam hits at an angle with this cosine has half its weight, flatter "
           "ones less: points of one ring lie on such a plane also where there is no surface",
           kNotNegative);
  f.number(
      "patch_m",
      c.patch_m,
      "the residuals of a scan in a cube of this side together weigh as one, because they share "
      "the map's errors",
      {0.01, 1000.0});
  f.integer("max_patches",
            c.max_patches,
            "more such cubes weigh as this many together: sweep, map and calibration have errors "
            "that all share",
            {1, 1e6});
  f.integer(
      "min_matches", c.min_matches, "fewer matched points and the scan is not used", {6, 1e6});
  f.integer("max_iterations", c.max_iterations, "of the iterated update", {1, 50});
  f.number(
      "converged_position_m", c.converged_position_m, "smaller steps end the iteration", kPositive);
  f.number("converged_rotation_rad",
           c.converged_rotation_rad,
           "smaller steps end the iteration",
           kPositive);
  f.integer("threads", c.threads, "that match; the result is the same for any number", {1, 64});
  f.number("lost_after_s",
           c.lost_after_s,
           "time without a usable scan after which the track is lost",
           kPositive);
}

void describe_extrinsic(ExtrinsicConfig& c, ConfigFields& f) {
  f.flag("estimate",
         c.estimate,
         "whether robot.lidar_roll_pitch_yaw_base_rad is where the estimate starts (true), which "
         "turns teach about the axes across them, or what holds (false)");
  f.number("rotation_sigma_rad",
           c.rotation_sigma_rad,
           "how well the configured rotation is known, each axis, where it is estimated",
           kNotNegative);
  f.number("level_sigma_rad",
           c.level_sigma_rad,
           "how far the LiDAR may lean against the accelerometer where the rotation is not "
           "estimated: odom's level, which GPS heights and turns correct, is less certain by that",
           kNotNegative);
  f.number("position_sigma_m",
           c.position_sigma_m,
           "how well the configured position is known, each axis: it is stated and stays",
           kNotNegative);
}

void describe_surfel_map(SurfelMapConfig& c, ConfigFields& f) {
  auto capacity = static_cast<std::int64_t>(c.leaf_capacity);
  f.number("leaf_m",
           c.leaf_m,
           "side of a leaf voxel; a plane is fitted over 3 x 3 x 3 leaves",
           kPositive);
  f.integer("leaf_capacity", capacity, "points after which a leaf's mean is frozen", {1, 65535});
  f.number("max_flatness",
           c.max_flatness,
           "smallest over largest eigenvalue of a plane's leaf means",
           {0.0, 1.0});
  f.number("min_linearity",
           c.min_linearity,
           "middle over largest eigenvalue: a line is no plane",
           {0.0, 1.0});
  f.number("max_residual_m", c.max_residual_m, "farther planes do not explain a point", kPositive);
  f.flag("nearest_points",
         c.nearest_points,
         "where planes leave the pose open, as in foliage, points without one may match one "
         "through the five nearest points");
  c.leaf_capacity = static_cast<std::size_t>(capacity);
}

void describe_ikd_map(IkdMapConfig& c, ConfigFields& f) {
  f.number("voxel_m", c.voxel_m, "side of the voxels that hold one point each", kPositive);
  f.number("max_neighbour_m",
           c.max_neighbour_m,
           "farthest of the five nearest points that make a plane",
           kPositive);
  f.number("max_plane_distance_m",
           c.max_plane_distance_m,
           "farther from the plane through all five, and there is none",
           kPositive);
}

void describe_local_map(LocalMapConfig& c, ConfigFields& f) {
  f.number("half_side_m",
           c.half_side_m,
           "half the side of the cube around the robot that is kept",
           kPositive);
  f.number("prune_every_m", c.prune_every_m, "distance between two prunings", kPositive);
  f.choice("kind",
           c.kind,
           "surfel_map: voxel hash of planes; ikd_tree: FAST-LIO2's incremental k-d tree",
           {"surfel_map", "ikd_tree"});
  f.section("surfel", "two-level voxel hash with planes", [&](ConfigFields& s) {
    describe_surfel_map(c.surfel, s);
  });
  f.section("ikd", "points in an incremental k-d tree", [&](ConfigFields& s) {
    describe_ikd_map(c.ikd, s);
  });
}

void describe_keyframes(KeyframeConfig& c, ConfigFields& f) {
  f.number("distance_m", c.distance_m, "a keyframe at least every so far", kPositive);
  f.number("rotation_rad", c.rotation_rad, "or after this much turning", kPositive);
  f.number("interval_s", c.interval_s, "or this long after the last one", kPositive);
  f.number("voxel_m", c.voxel_m, "side of the voxels that thin a keyframe's cloud", kPositive);
}

void describe_recovery(RecoveryConfig& c, ConfigFields& f) {
  f.number("radius_m", c.radius_m, "farthest from the predicted place", {1.0, 25.0});
  f.number("yaw_rad", c.yaw_rad, "farthest from the predicted heading", {0.0, 3.1416});
  f.number("min_share",
           c.min_share,
           "how well the points that stand out of the ground must lie on the map: mean of "
           "exp(-d^2 / (2 (0.25 m)^2)), d to its nearest point",
           {0.0, 1.0});
  f.number("min_lead",
           c.min_lead,
           "of that share over any place more than 2 m or 0.2 rad away",
           {0.0, 1.0});
  f.integer("attempts",
            c.attempts,
            "of a restart, on more and more sweeps, before odom begins anew",
            {1, 4});
  f.number("give_up_s",
           c.give_up_s,
           "of a lost track while sweeps are usable, before odom begins anew",
           kPositive);
}

}  // namespace

void describe(Config& config, ConfigFields& fields) {
  fields.section("sweep", "how an input cloud tells its points' times", [&](ConfigFields& f) {
    describe_sweep(config.sweep, f);
  });
  fields.section("imu", "noise of the IMU as the filter sees it", [&](ConfigFields& f) {
    describe_imu(config.imu, f);
  });
  fields.section("start", "levelling and first velocity", [&](ConfigFields& f) {
    describe_start(config.start, f);
  });
  fields.section("matching", "scan against local map", [&](ConfigFields& f) {
    describe_matching(config.matching, f);
  });
  fields.section("extrinsic", "how the LiDAR is turned on base_link", [&](ConfigFields& f) {
    describe_extrinsic(config.extrinsic, f);
  });
  fields.section("local_map", "what scans are matched against", [&](ConfigFields& f) {
    describe_local_map(config.local_map, f);
  });
  fields.section("drift",
                 "how fast odom drifts: random walk of T_map_odom with the distance driven",
                 [&](ConfigFields& f) {
                   f.number("position_sigma_m_sqrtm",
                            config.drift.position_sigma_m_sqrtm,
                            "sigma of x, y and z each after one metre",
                            kNotNegative);
                   f.number("yaw_sigma_rad_sqrtm",
                            config.drift.yaw_sigma_rad_sqrtm,
                            "sigma of yaw after one metre",
                            kNotNegative);
                   f.number("tilt_sigma_rad_sqrtm",
                            config.drift.tilt_sigma_rad_sqrtm,
                            "sigma of roll and of pitch against gravity after one metre",
                            kNotNegative);
                   f.number("map_renewal_per_m",
                            config.drift.map_renewal_per_m,
                            "share of the pose's covariance relative to the local map that new map "
                            "inherits, per metre",
                            kNotNegative);
                   f.number("blind_tilt_rad_sqrts",
                            config.drift.blind_tilt_rad_sqrts,
                            "sigma of roll and of pitch against gravity after one second, while "
                            "scans do not hold the position along the axis into which gravity "
                            "would then accelerate: 5 mrad in 10 s",
                            kNotNegative);
                 });
  fields.section("rows", "GPS rows from the gate", [&](ConfigFields& f) {
    f.number("history_s", config.rows.history_s, "how late a row may come", kPositive);
    f.integer("max_waiting",
              config.rows.max_waiting,
              "rows that may wait for the scan that covers them",
              {1, 10000});
  });
  fields.section("keyframes", "what is kept for the saved map", [&](ConfigFields& f) {
    describe_keyframes(config.keyframes, f);
  });
  fields.section("recovery",
                 "finding the place in the map again after a restart or a lost track",
                 [&](ConfigFields& f) { describe_recovery(config.recovery, f); });
  fields.section(
      "past", "correcting what was driven before, beside the odometry", [&](ConfigFields& f) {
        f.flag("enabled",
               config.past.enabled,
               "whether the local map is rebuilt from corrected keyframes after GPS has "
               "come back and where a place is driven again; needs a session. Takes double "
               "walls away; may cost the place in map a centimetre");
        f.number("interval_s",
                 config.past.interval_s,
                 "from one correction to the next at least, data time",
                 kPositive);
      });
  fields.number("imu_rate_odometry_hz",
                config.imu_rate_odometry_hz,
                "highest rate of lio/odometry_imu_rate",
                kPositive);
}

}  // namespace trigpoint::lio_mapper
