// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/fusion_gate/config.hpp"

#include "trigpoint/base/config.hpp"

namespace trigpoint::fusion_gate {

namespace {

void describe(AlignmentConfig& config, ConfigFields& fields) {
  fields.number("max_yaw_sigma_rad",
                config.max_yaw_sigma_rad,
                "the first T_map_odom is admitted below this predicted sigma",
                {1e-4, 0.5});
  fields.number("min_baseline_m",
                config.min_baseline_m,
                "horizontal extent that the pairs must have",
                kPositive);
  fields.integer(
      "min_pairs", config.min_pairs, "matched pairs that the alignment must rest on", {3, 1000});
  fields.integer("max_pairs", config.max_pairs, "above it every second pair is dropped", {10, 500});
  fields.number("pair_spacing_m",
                config.pair_spacing_m,
                "a fix nearer to the last pair makes one only after pair_spacing_s",
                kNotNegative);
  fields.number("pair_spacing_s", config.pair_spacing_s, "see pair_spacing_m", kNotNegative);
  fields.number("window_m",
                config.window_m,
                "pairs driven longer ago are forgotten, because LIO drifts",
                kPositive);
  fields.number("max_interpolation_gap_s",
                config.max_interpolation_gap_s,
                "longest gap between two LIO poses to interpolate in",
                kPositive);
  fields.number("correlation_time_s",
                config.correlation_time_s,
                "of the slow (Gauss-Markov) part of the GPS error",
                kPositive);
  fields.number("correlated_share",
                config.correlated_share,
                "that part's share of the reported variance",
                kNotNegative);
  fields.number("white_share",
                config.white_share,
                "share of the reported variance that is new at every fix",
                kPositive);
  fields.number("lio_drift_m_per_sqrt_m",
                config.lio_drift_m_per_sqrt_m,
                "sigma of LIO's drift per axis is this times the square root of the distance",
                kNotNegative);
  fields.number("lio_tilt_sigma_rad",
                config.lio_tilt_sigma_rad,
                "sigma of odom's roll and of its pitch against gravity",
                kNotNegative);
  fields.number("residual_tolerance",
                config.residual_tolerance,
                "residual's chi-square over its 99.9 % quantile, at most; what exceeds 1 per "
                "degree of freedom scales the covariance",
                kPositive);
}

void describe(SmoothConfig& config, ConfigFields& fields) {
  fields.number("leave_factor",
                config.leave_factor,
                "an axis opens at its threshold and closes above this times it",
                {1.0, 100.0});
  fields.number("leave_sigmas",
                config.leave_sigmas,
                "a fix that is farther from what LIO and T_map_odom say is doubted",
                kPositive);
  fields.number("enter_sigmas",
                config.enter_sigmas,
                "doubted fixes must be nearer than this to be trusted again",
                kPositive);
  fields.number("raw_sigma_scale",
                config.raw_sigma_scale,
                "receivers are optimistic: sigma of a raw fix is multiplied by this",
                kPositive);
  fields.number("lio_drift_m_per_sqrt_m",
                config.lio_drift_m_per_sqrt_m,
                "what LIO may drift before a fix is doubted: sigma per axis is this times the "
                "square root of the distance; more than the alignment counts with, so that a "
                "LIO that drifts more than usual throws no good fix out",
                kNotNegative);
  fields.number("lio_drift_share",
                config.lio_drift_share,
                "the same on long ways, where it is more: one sigma, as a share of the distance",
                kNotNegative);
  fields.number("lio_yaw_drift_rad_per_sqrt_m",
                config.lio_yaw_drift_rad_per_sqrt_m,
                "random walk of LIO's yaw with the distance",
                kNotNegative);
  fields.number("lio_blind_sigma_m",
                config.lio_blind_sigma_m,
                "along an axis whose sigma in lio/status is larger LIO may slide: there GPS is not "
                "tested against it and carries the axis, also above the threshold",
                kPositive);
  fields.number("readmit_s",
                config.readmit_s,
                "doubted fixes are trusted again after they agreed with each other for as long as "
                "they were in doubt, 1 s at least and this at most",
                {1.0, 1e4});
  fields.integer("readmit_fixes", config.readmit_fixes, "that must agree then", {2, 1000});
  fields.number("probation_s",
                config.probation_s,
                "an alignment that fixes confirmed for less may rest on a wrong fix as a whole: "
                "longer than wrong fixes last",
                kNotNegative);
  fields.number("realign_m",
                config.realign_m,
                "distance over which fixes must agree with each other against such an alignment",
                kPositive);
  fields.number("hand_over_mps",
                config.hand_over_mps,
                "fusion/odometry follows a change of T_map_odom at base_link no faster",
                kPositive);
  fields.number("hand_over_radps", config.hand_over_radps, "the same for attitude", kPositive);
}

}  // namespace

void describe(Config& config, ConfigFields& fields) {
  fields.choice(
      "mode",
      config.mode,
      "lio: no GPS rows; fusion: every row; literal: the paper's assignment per axis; "
      "hard: Algorithm I decides which rows enter; smooth: joined by tests of the values, "
      "and handed over without steps",
      {"lio", "fusion", "literal", "hard", "smooth"});
  fields.vector3("threshold",
                 config.threshold,
                 "Algorithm I, axes east north up: above it LIO keeps the axis; m, or m^2 when "
                 "threshold_on is variance",
                 kPositive);
  fields.choice("threshold_on",
                config.threshold_on,
                "what threshold is compared with",
                {"sigma", "variance"});
  fields.number(
      "min_sigma_m", config.min_sigma_m, "no fix is better than this, per axis", kPositive);
  fields.number("gps_correlation_time_s",
                config.gps_correlation_time_s,
                "tau: a row's covariance is inflated by 1 + 2 tau / (time since the last row)",
                kNotNegative);
  fields.number("max_inflation", config.max_inflation, "of that factor", {1.0, 1e6});
  fields.number("max_fix_age_s",
                config.max_fix_age_s,
                "a fix further behind LIO's newest stamp makes no row; so long a fix that came "
                "out of order is waited for (below the mapper's rows.history_s)",
                kPositive);
  fields.number("source_timeout_s",
                config.source_timeout_s,
                "a GPS writer not heard for longer is stale",
                kPositive);
  fields.number("source_hold_s",
                config.source_hold_s,
                "a GPS writer must be healthier, or keep thresholds that the followed one does "
                "not keep, for this long before it is followed",
                kNotNegative);
  fields.number("lio_timeout_s",
                config.lio_timeout_s,
                "without LIO for longer, fusion/odometry is the GPS odometry",
                kPositive);
  fields.number("gps_only_after_s",
                config.gps_only_after_s,
                "the same before the first alignment",
                kPositive);
  fields.number("imu_rate_timeout_s",
                config.imu_rate_timeout_s,
                "without lio/odometry_imu_rate for longer, fusion/odometry follows lio/odometry",
                kPositive);
  fields.number("status_period_s",
                config.status_period_s,
                "of fusion/status between fixes, data time",
                kPositive);
  fields.number("foreign_after_s",
                config.foreign_after_s,
                "a GPS writer that sent no gps/status for this long is a plain foreign one, whose "
                "frame is estimated",
                kNotNegative);
  fields.number("unknown_fix_sigma_m",
                config.unknown_fix_sigma_m,
                "sigma of a raw fix without a covariance (foreign GPS sources only)",
                kPositive);
  fields.section("alignment", "how the first T_map_odom is found", [&](ConfigFields& section) {
    describe(config.alignment, section);
  });
  fields.section("smooth", "what mode smooth asks besides", [&](ConfigFields& section) {
    describe(config.smooth, section);
  });
}

}  // namespace trigpoint::fusion_gate
