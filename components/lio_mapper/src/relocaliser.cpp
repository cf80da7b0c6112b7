// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "relocaliser.hpp"

#include "trigpoint/base/so3.hpp"

#include "hill_search.hpp"
#include "iterated_update.hpp"
#include "scan_matcher.hpp"
#include "scan_parts.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <vector>

namespace trigpoint::lio_mapper {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr std::size_t kRefinedPoints = 3000;
constexpr double kLeastSigma_m = 0.05;  // of an area's centre
/// The matcher goes at most so far from the top of the hill: beyond it slid somewhere else.
constexpr double kRefined_m = 0.5;
constexpr double kRefined_rad = 0.05;
constexpr std::int64_t kMaxIterations = 20;
/// Of the top of a hill.
constexpr double kTopPosition_m = 0.15;
constexpr double kTopYaw_rad = 0.02;
constexpr double kLevel_rad = 0.01;  // of the scan's

/// Around the pose that the matcher leads to, scans are laid on the map's surfaces so far and in
/// such steps: a street's facades hold a scan anywhere along it, and what little stands across it
/// pulls only when it is nearly met.
constexpr double kSharpenReach_m = 0.4;
constexpr double kSharpenStep_m = 0.1;
constexpr double kOnSurface_m = 0.07;  // one sigma
/// Another place is better when so much more of the scan lies on surfaces.
constexpr double kSharper = 0.03;

/// Mean likelihood of the points by their distance to the map's surfaces.
double share_on_surfaces(const PointCloud& points_base,
                         const Pose& T_odom_base,
                         const LocalMap& map) {
  double sum = 0.0;
  for (const PointXyzi& point : points_base) {
    const Vector3d p = T_odom_base * point.position().cast<double>();
    PlaneMatch plane;
    if (map.match_surface(p, plane)) {
      const double sigmas = (plane.normal.dot(p) + plane.offset_m) / kOnSurface_m;
      sum += std::exp(-0.5 * sigmas * sigmas);
    }
  }
  return sum / static_cast<double>(points_base.size());
}

/// The place in the plane around `T_odom_base` at which the scan lies best on surfaces.
Pose sharpened(const Pose& T_odom_base,
               const PointCloud& points_base,
               const LocalMap& map,
               Workers& workers) {
  const int steps = static_cast<int>(std::lround(kSharpenReach_m / kSharpenStep_m));
  const int side = 2 * steps + 1;
  std::vector<double> shares(static_cast<std::size_t>(side * side));
  const auto place = [&](std::size_t i) {
    const int at = static_cast<int>(i);
    Pose T = T_odom_base;
    T.p.head<2>() += kSharpenStep_m * Vector2d(at % side - steps, at / side - steps);
    return T;
  };
  workers.run(shares.size(),
              [&](std::size_t i) { shares[i] = share_on_surfaces(points_base, place(i), map); });
  const auto best = std::max_element(shares.begin(), shares.end());
  const double here = shares[shares.size() / 2];
  return *best > here + kSharper ? place(static_cast<std::size_t>(best - shares.begin()))
                                 : T_odom_base;
}

std::optional<Pose> refined(const Hypothesis& h,
                            const LevelScan& scan,
                            const PointCloud& points_base,
                            const LocalMap& map,
                            const MatchingConfig& matching,
                            Workers& workers) {
  State prior;
  prior.T_odom_base = {(from_yaw(h.yaw_rad) * scan.q_level_base).normalized(), h.p_odom_m};
  constexpr double kNothing = 1e-12;
  ErrorMatrix covariance = kNothing * ErrorMatrix::Identity();
  const double position2 = kTopPosition_m * kTopPosition_m;
  const Eigen::Matrix3d R = scan.q_level_base.toRotationMatrix();
  Eigen::Matrix3d turn = kLevel_rad * kLevel_rad * Eigen::Matrix3d::Identity();
  turn(2, 2) = kTopYaw_rad * kTopYaw_rad;
  covariance.block<3, 3>(error::kPosition, error::kPosition) =
      position2 * Eigen::Matrix3d::Identity();
  covariance.block<3, 3>(error::kRotation, error::kRotation) = R.transpose() * turn * R;
  const Pose T_base_lidar{Eigen::Quaterniond::Identity(), scan.lidar_position_base_m};
  ScanMatcher matcher(points_base, map, T_base_lidar, matching, workers);  // axes play no part
  const UpdateResult result = iterated_update(prior,
                                              covariance,
                                              [&](const Pose& T) { return matcher.linearise(T); },
                                              {kMaxIterations,
                                               matching.converged_position_m,
                                               matching.converged_rotation_rad,
                                               static_cast<std::size_t>(matching.min_matches)});
  if (!result.used) {
    return std::nullopt;
  }
  return result.state.T_odom_base;
}

/// Empty when nothing speaks against it.
std::string obstacle_to(const Registration& best,
                        const Hypothesis& top,
                        const SearchArea& area,
                        const RecoveryConfig& config) {
  const Pose& T = best.T_odom_base;
  const double slid_m = (T.p - top.p_odom_m).norm();
  const double turned_rad = std::abs(wrap_angle(yaw_of(T.q) - top.yaw_rad));
  if (slid_m > kRefined_m || turned_rad > kRefined_rad) {
    char text[160];
    std::snprintf(text,
                  sizeof text,
                  "the best place does not hold: matching its surfaces leads %.2f m and %.3f rad "
                  "away from it (at most %.2f and %.2f)",
                  slid_m,
                  turned_rad,
                  kRefined_m,
                  kRefined_rad);
    return text;
  }
  if (best.share < config.min_share) {
    char text[160];
    std::snprintf(
        text,
        sizeof text,
        "what stands out lies on the map by %.0f %% at the best place, at least %.0f needed",
        100.0 * best.share,
        100.0 * config.min_share);
    return text;
  }
  if (best.share - best.runner_up_share < config.min_lead) {
    char text[200];
    std::snprintf(text,
                  sizeof text,
                  "what stands out lies on the map by %.0f %% at the best place and by %.0f %% at "
                  "another one, at least %.0f less needed",
                  100.0 * best.share,
                  100.0 * best.runner_up_share,
                  100.0 * config.min_lead);
    return text;
  }
  const double away_m = (T.p - best.centre.p).head<2>().norm();
  if (area.holds_robot && away_m > area.radius_m + HillSearch::kStep_m) {
    char text[120];
    std::snprintf(text,
                  sizeof text,
                  "the best place is %.1f m from the expected one (at most %.1f)",
                  away_m,
                  area.radius_m + HillSearch::kStep_m);
    return text;
  }
  return "";
}

/// What the field leaves open the centre tells: both weighed by their covariances, in the plane.
void weigh_with_centre(const SearchArea& area, Hypothesis& top, Eigen::Matrix2d& spread_m2) {
  const double sigma_m = std::max(area.sigma_m, kLeastSigma_m);
  const Eigen::Matrix2d of_centre_m2 = sigma_m * sigma_m * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d gain = spread_m2 * (spread_m2 + of_centre_m2).inverse();
  top.p_odom_m.head<2>() += gain * (area.centres_odom[top.centre].p - top.p_odom_m).head<2>();
  spread_m2 = (gain * of_centre_m2).eval();
}

}  // namespace

RegistrationResult register_scan(const LevelScan& scan,
                                 const LocalMap& map,
                                 const SearchArea& area,
                                 const MatchingConfig& matching,
                                 const RecoveryConfig& config,
                                 Workers& workers) {
  if (area.centres_odom.empty()) {
    throw std::invalid_argument("register_scan: the area has no centre");
  }
  RegistrationResult result;
  const ScanParts parts = parts_of(scan.points_base, scan.q_level_base);
  if (map.empty() || parts.count < ScanParts::kFewest) {
    result.obstacle = map.empty() ? "the map is empty there"
                                  : std::to_string(parts.count) +
                                        " points stand out of the ground within 50 m, at least " +
                                        std::to_string(ScanParts::kFewest) + " needed";
    return result;
  }
  HillSearch search(area, parts, map, workers);
  std::vector<Hypothesis> hills = search.hills();
  Hypothesis& top = hills.front();
  Eigen::Matrix2d spread_m2 = search.spread_about(top);
  if (area.holds_robot) {
    weigh_with_centre(area, top, spread_m2);
  }
  const PointCloud points = thinned(scan.points_base, kRefinedPoints);
  auto T = refined(top, scan, points, map, matching, workers);
  if (T) {
    const Pose sharp = sharpened(*T, points, map, workers);
    if (sharp.p != T->p) {
      top.p_odom_m.head<2>() = sharp.p.head<2>();
      top.yaw_rad = yaw_of(sharp.q);
      T = refined(top, scan, points, map, matching, workers);
    }
  }
  if (!T) {
    result.obstacle = "the scan matches nowhere";
    return result;
  }
  Registration& best = result.best.emplace();
  best.T_odom_base = *T;
  best.centre = area.centres_odom[top.centre];
  const Pose T_odom_level(T->q * scan.q_level_base.conjugate(), T->p);
  best.share = search.share_at(T_odom_level, top.centre);
  best.spread_m2 = spread_m2;
  best.runner_up_share = search.runner_up_share(top, hills);
  result.obstacle = obstacle_to(best, top, area, config);
  result.accepted = result.obstacle.empty();
  return result;
}

}  // namespace trigpoint::lio_mapper
