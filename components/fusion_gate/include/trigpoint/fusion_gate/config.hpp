// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <string>

namespace trigpoint {
class ConfigFields;
}

namespace trigpoint::fusion_gate {

/// How the first T_map_odom is found (README, "Alignment").
struct AlignmentConfig {
  double max_yaw_sigma_rad{0.0174533};  ///< admitted below this (1 degree)
  double min_baseline_m{5.0};           ///< horizontal extent of the pairs
  std::int64_t min_pairs{5};
  std::int64_t max_pairs{120};  ///< above it every second one is dropped
  double pair_spacing_m{0.25};  ///< a nearer pair is taken only after pair_spacing_s
  double pair_spacing_s{2.0};
  double window_m{200.0};                ///< pairs driven longer ago are forgotten: LIO drifts
  double max_interpolation_gap_s{0.6};   ///< between two LIO poses
  double correlation_time_s{40.0};       ///< of the slow part of the GPS error
  double correlated_share{0.7};          ///< of the reported variance: Gauss-Markov
  double white_share{0.5};               ///< of the reported variance: new at every fix
  double lio_drift_m_per_sqrt_m{0.005};  ///< random walk of LIO with the distance driven
  double lio_tilt_sigma_rad{0.01};       ///< of odom, which no GPS height can tell from z at once
  double residual_tolerance{4.0};        ///< chi-square may exceed its 99.9 % quantile by this
};

/// What mode smooth asks beyond Algorithm I (README, "Mode smooth").
struct SmoothConfig {
  double leave_factor{1.25};            ///< an open axis closes above this times its threshold
  double leave_sigmas{3.0};             ///< a trusted fix is doubted beyond
  double enter_sigmas{2.5};             ///< a doubted one is trusted again within
  double raw_sigma_scale{2.0};          ///< receivers are optimistic
  double lio_drift_m_per_sqrt_m{0.02};  ///< what LIO may drift before a fix is doubted, one sigma
  double lio_drift_share{0.003};        ///< of the distance, one sigma; beside the random walk
  double lio_yaw_drift_rad_per_sqrt_m{0.00035};
  double lio_blind_sigma_m{0.03};  ///< along an axis that is worse held by the map LIO may slide
  double readmit_s{10.0};          ///< longest stretch that fixes must agree for after a doubt
  std::int64_t readmit_fixes{5};
  double probation_s{45.0};   ///< an alignment that GPS confirmed for less may rest on a wrong fix
  double realign_m{10.0};     ///< driven while fixes agree with each other against it
  double hand_over_mps{0.3};  ///< fusion/odometry follows a new T_map_odom no faster
  double hand_over_radps{0.0174533};
};

/// Beyond max_fix_age_s, until LIO's next scan covers a fix that was waited for: no row of the gate
/// is older than both together, and the mapper must keep as much.
inline constexpr double kJudgingSlack_s = 0.15;

/// The only defaults of fusion_gate; every field is described (unit, rule) in src/config.cpp.
struct Config {
  std::string mode{"smooth"};                ///< lio, fusion, literal, hard, smooth
  Eigen::Vector3d threshold{0.5, 0.5, 1.0};  ///< m, or m^2 when threshold_on is "variance"
  std::string threshold_on{"sigma"};         ///< sigma, variance
  double min_sigma_m{0.02};                  ///< floor of a fix's sigma
  double gps_correlation_time_s{5.0};        ///< row covariance x (1 + 2 tau / dt)
  double max_inflation{100.0};               ///< of that factor
  double max_fix_age_s{2.3};  ///< against LIO's newest stamp; so long an earlier one is waited for
  double source_timeout_s{1.0};     ///< a GPS writer not heard for longer is stale
  double source_hold_s{0.3};        ///< a healthier or more certain one must stay so
  double lio_timeout_s{1.0};        ///< then the GPS odometry carries fusion/odometry
  double gps_only_after_s{10.0};    ///< the same where there has never been a LIO
  double imu_rate_timeout_s{0.5};   ///< then lio/odometry carries fusion/odometry
  double status_period_s{0.2};      ///< of fusion/status between fixes, data time
  double foreign_after_s{2.0};      ///< a GPS writer without gps/status is foreign then
  double unknown_fix_sigma_m{3.0};  ///< of a raw fix that says nothing about itself
  AlignmentConfig alignment;
  SmoothConfig smooth;
};

void describe(Config& config, ConfigFields& fields);

}  // namespace trigpoint::fusion_gate
