// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "relocaliser.hpp"

#include "trigpoint/base/so3.hpp"

#include "ground_grid.hpp"
#include "iterated_update.hpp"
#include "scan_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace trigpoint::lio_mapper {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr double kStep_m = 0.75;       // of the grid; planes are seen from 0.5 m
constexpr double kYawStep_rad = 0.05;  // 0.6 m at half a step and 25 m
constexpr double kNear_m = 25.0;       // farther points would fall through the grid of headings
constexpr double kSeen_m = 0.5;        // a point this far from its plane counts nothing
constexpr double kGroundRadius_m = 12.0;
constexpr double kStandsOut_m = 0.5;  // above the ground
constexpr std::size_t kCoarsePoints = 150;
constexpr std::size_t kClimbPoints = 500;
constexpr std::size_t kFinePoints = 1500;
constexpr std::size_t kFewestPoints = 80;
constexpr std::size_t kRefined = 16;
/// The best places of the grid climb so often at half the steps, within a step of the grid: between
/// poles and trees the matcher finds its way over some centimetres only.
constexpr int kHalvings = 3;
constexpr int kMostClimbs = 4;  // at steps of one size
/// Two places or headings that differ by less are the same one.
constexpr double kSame_m = 1.0;
constexpr double kSame_rad = 0.05;
constexpr double kFoundOnPlane_m = 0.1;
constexpr std::int64_t kMaxIterations = 20;
constexpr int kRounds = 6;
constexpr double kArrived_m = 0.02;
constexpr double kPriorPosition_m = 3.0;
constexpr double kPriorLevel_rad = 0.01;
constexpr double kPriorYaw_rad = 0.2;
/// More, and the residuals have not the size that the matcher gives them.
constexpr double kMostChi2 = 4.0;

struct Hypothesis {
  Vector3d p_odom_m;
  double yaw_rad{0.0};
  std::size_t centre{0};
  double score{0.0};
};

bool are_same(const Vector3d& a, double yaw_a, const Vector3d& b, double yaw_b) {
  return (a - b).head<2>().norm() < kSame_m && std::abs(wrap_angle(yaw_a - yaw_b)) < kSame_rad;
}

/// Every n-th, so that at most `most` are left.
std::vector<Vector3d> thinned(const std::vector<Vector3d>& points, std::size_t most) {
  std::vector<Vector3d> kept;
  const std::size_t step = std::max<std::size_t>(1, (points.size() + most - 1) / most);
  for (std::size_t i = 0; i < points.size(); i += step) {
    kept.push_back(points[i]);
  }
  return kept;
}

/// The scan in level axes about base, apart into what stands out and the ground.
struct Parts {
  double ground_m{0.0};                 ///< height of the ground below base, negative
  std::size_t count{0};                 ///< stand out, near ones where there are enough of them
  std::vector<Vector3d> near_level_m;   ///< stand out, for the grid
  std::vector<Vector3d> climb_level_m;  ///< the same, more of them
  std::vector<Vector3d> tall_level_m;   ///< stand out, all
};

Parts parts_of(const LevelScan& scan) {
  GroundGrid grid(Vector2d::Zero(), kGroundRadius_m + 2.0);
  std::vector<Vector3d> level;
  level.reserve(scan.points_base.size());
  for (const PointXyzi& point : scan.points_base) {
    level.push_back(scan.q_level_base * point.position().cast<double>());
    grid.add(level.back());
  }
  Parts parts;
  parts.ground_m = grid.height_at(Vector2d::Zero(), kGroundRadius_m).value_or(0.0);
  for (const Vector3d& point : level) {
    if (point.z() > parts.ground_m + kStandsOut_m) {
      parts.tall_level_m.push_back(point);
      if (point.norm() < kNear_m) {
        parts.near_level_m.push_back(point);
      }
    }
  }
  if (parts.near_level_m.size() < kFewestPoints) {
    parts.near_level_m = parts.tall_level_m;
  }
  parts.count = parts.near_level_m.size();
  parts.climb_level_m = thinned(parts.near_level_m, kClimbPoints);
  parts.near_level_m = thinned(parts.near_level_m, kCoarsePoints);
  parts.tall_level_m = thinned(parts.tall_level_m, kFinePoints);
  return parts;
}

GroundGrid ground_of(const LocalMap& map, const Pose& centre, double radius_m) {
  GroundGrid grid(centre.p.head<2>(), radius_m + kGroundRadius_m);
  for (const PointXyzi& point : map.points()) {
    grid.add(point.position().cast<double>());
  }
  return grid;
}

void add_grid(const SearchArea& area,
              std::size_t centre,
              const LocalMap& map,
              double scan_ground_m,
              std::vector<Hypothesis>& all) {
  const Pose& T = area.centres_odom[centre];
  const GroundGrid ground = ground_of(map, T, area.radius_m);
  const std::optional<double> ground_here = ground.height_at(T.p.head<2>(), kGroundRadius_m);
  const int steps = static_cast<int>(std::ceil(area.radius_m / kStep_m));
  const int turns = static_cast<int>(std::ceil(area.yaw_rad / kYawStep_rad));
  for (int x = -steps; x <= steps; ++x) {
    for (int y = -steps; y <= steps; ++y) {
      const Vector2d offset_m = kStep_m * Vector2d(x, y);
      if (offset_m.norm() > area.radius_m + kStep_m) {
        continue;
      }
      const Vector2d place_m = T.p.head<2>() + offset_m;
      const std::optional<double> height = ground.height_at(place_m, kGroundRadius_m);
      const double z = height        ? *height - scan_ground_m
                       : ground_here ? *ground_here - scan_ground_m
                                     : T.p.z();
      for (int turn = -turns; turn <= turns; ++turn) {
        all.push_back({{place_m.x(), place_m.y(), z},
                       wrap_angle(yaw_of(T.q) + kYawStep_rad * turn),
                       centre,
                       0.0});
      }
    }
  }
}

double score_of(const Hypothesis& h, const std::vector<Vector3d>& level, const LocalMap& map) {
  const double c = std::cos(h.yaw_rad);
  const double s = std::sin(h.yaw_rad);
  double sum = 0.0;
  PlaneMatch plane;
  for (const Vector3d& p : level) {
    const Vector3d point_odom_m{c * p.x() - s * p.y() + h.p_odom_m.x(),
                                s * p.x() + c * p.y() + h.p_odom_m.y(),
                                p.z() + h.p_odom_m.z()};
    if (map.match_surface(point_odom_m, plane)) {
      const double ratio = (plane.normal.dot(point_odom_m) + plane.offset_m) / kSeen_m;
      sum += std::max(0.0, 1.0 - ratio * ratio);
    }
  }
  return sum / static_cast<double>(level.size());
}

/// The best ones, none of them the same place as a better one.
std::vector<Hypothesis> best_of(std::vector<Hypothesis> all) {
  std::stable_sort(all.begin(), all.end(), [](const Hypothesis& a, const Hypothesis& b) {
    return a.score > b.score;
  });
  std::vector<Hypothesis> best;
  for (const Hypothesis& h : all) {
    const bool is_new = std::none_of(best.begin(), best.end(), [&](const Hypothesis& better) {
      return are_same(h.p_odom_m, h.yaw_rad, better.p_odom_m, better.yaw_rad);
    });
    if (is_new) {
      best.push_back(h);
    }
    if (best.size() == kRefined) {
      break;
    }
  }
  return best;
}

/// The best place within a step of a hypothesis of the grid.
Hypothesis climbed(const Hypothesis& start,
                   const std::vector<Vector3d>& level,
                   const LocalMap& map) {
  const auto moved = [&](const Eigen::Vector3d& steps) {
    Hypothesis h = start;
    h.p_odom_m.head<2>() += kStep_m * steps.head<2>();
    h.yaw_rad = wrap_angle(h.yaw_rad + kYawStep_rad * steps.z());
    h.score = score_of(h, level, map);
    return h;
  };
  Vector3d at = Vector3d::Zero();  // in steps of the grid
  Hypothesis best = moved(at);
  double step = 1.0;
  for (int halving = 0; halving < kHalvings; ++halving) {
    step *= 0.5;
    for (int climb = 0; climb < kMostClimbs; ++climb) {
      const Vector3d from = at;
      for (int i = 0; i < 6; ++i) {
        const Vector3d to = from + (i % 2 == 0 ? step : -step) * Vector3d::Unit(i / 2);
        if (to.cwiseAbs().maxCoeff() > 1.0) {
          continue;
        }
        const Hypothesis next = moved(to);
        if (next.score > best.score) {
          best = next;
          at = to;
        }
      }
      if (at == from) {
        break;
      }
    }
  }
  return best;
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
  const double position2 = kPriorPosition_m * kPriorPosition_m;
  const Eigen::Matrix3d R = scan.q_level_base.toRotationMatrix();
  Eigen::Matrix3d turn = kPriorLevel_rad * kPriorLevel_rad * Eigen::Matrix3d::Identity();
  turn(2, 2) = kPriorYaw_rad * kPriorYaw_rad;
  covariance.block<3, 3>(error::kPosition, error::kPosition) =
      position2 * Eigen::Matrix3d::Identity();
  covariance.block<3, 3>(error::kRotation, error::kRotation) = R.transpose() * turn * R;
  const Pose T_base_lidar{Eigen::Quaterniond::Identity(), scan.lidar_position_base_m};
  // From metres away a scan is worth little, and the prior holds on: so it begins again where it
  // came to.
  for (int round = 0; round < kRounds; ++round) {
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
    const double moved_m = (result.state.T_odom_base.p - prior.T_odom_base.p).norm();
    prior.T_odom_base = result.state.T_odom_base;
    if (moved_m < kArrived_m) {
      break;
    }
  }
  return prior.T_odom_base;
}

void judge(const Parts& parts,
           const LevelScan& scan,
           const LocalMap& map,
           const MatchingConfig& matching,
           Registration& registration) {
  const Pose& T = registration.T_odom_base;
  const Quaterniond q_odom_level = T.q * scan.q_level_base.conjugate();
  std::size_t near = 0;
  std::size_t matched = 0;
  double chi2 = 0.0;
  PlaneMatch plane;
  for (const Vector3d& point : parts.tall_level_m) {
    const Vector3d point_odom_m = q_odom_level * point + T.p;
    if (!map.match(point_odom_m, plane)) {
      continue;
    }
    const double r = plane.normal.dot(point_odom_m) + plane.offset_m;
    const double range_m = point.norm();
    const double sideways_m = matching.angle_sigma_rad * range_m;
    const double variance = matching.range_sigma_m * matching.range_sigma_m +
                            sideways_m * sideways_m + plane.thickness2_m2;
    ++matched;
    if (std::abs(r) < kFoundOnPlane_m) {  // what lies farther off speaks against the fit already
      ++near;
      chi2 += r * r / variance;
    }
  }
  const auto share_of = [](std::size_t part, std::size_t all) {
    return static_cast<double>(part) / static_cast<double>(std::max<std::size_t>(1, all));
  };
  registration.share = share_of(near, parts.tall_level_m.size());
  registration.fit = share_of(near, matched);
  registration.chi2 = chi2 / static_cast<double>(std::max<std::size_t>(1, near));
}

/// Of several places the one on which most of the scan lies, and how well the next one does.
Registration best_found(const std::vector<Registration>& found) {
  Registration best = *std::max_element(
      found.begin(), found.end(), [](const auto& a, const auto& b) { return a.share < b.share; });
  for (const Registration& other : found) {
    if (!are_same(other.T_odom_base.p,
                  yaw_of(other.T_odom_base.q),
                  best.T_odom_base.p,
                  yaw_of(best.T_odom_base.q))) {
      best.runner_up_share = std::max(best.runner_up_share, other.share);
    }
  }
  return best;
}

double away_m(const Registration& best) {
  return (best.T_odom_base.p - best.centre.p).head<2>().norm();
}

/// Empty when nothing speaks against it.
std::string obstacle_to(const Registration& best, double farthest_m, const RecoveryConfig& config) {
  const bool covered = best.share >= config.min_share;
  const bool fits = best.fit >= config.min_fit;
  const bool leads = best.share - best.runner_up_share >= config.min_lead;
  if (!covered || !fits || !leads) {
    char text[240];
    std::snprintf(text,
                  sizeof text,
                  "%.0f %% of what stands out lies on the map (at least %.0f needed), which is "
                  "%.0f %% of what meets a plane (%.0f), and %.0f %% at another place (%.0f less)",
                  100.0 * best.share,
                  100.0 * config.min_share,
                  100.0 * best.fit,
                  100.0 * config.min_fit,
                  100.0 * best.runner_up_share,
                  100.0 * config.min_lead);
    return text;
  }
  if (away_m(best) > farthest_m) {
    char text[120];
    std::snprintf(text,
                  sizeof text,
                  "the best place is %.1f m from the expected one (at most %.1f)",
                  away_m(best),
                  farthest_m);
    return text;
  }
  if (best.chi2 > kMostChi2) {
    return "residuals are " + std::to_string(best.chi2) + " times as large as their noise";
  }
  return "";
}

}  // namespace

RegistrationResult register_scan(const LevelScan& scan,
                                 const LocalMap& map,
                                 const SearchArea& area,
                                 const MatchingConfig& matching,
                                 const RecoveryConfig& config,
                                 Workers& workers) {
  RegistrationResult result;
  const Parts parts = parts_of(scan);
  if (map.empty() || parts.count < kFewestPoints) {
    result.obstacle = map.empty() ? "the map is empty there"
                                  : std::to_string(parts.count) +
                                        " points stand out of the ground, at least " +
                                        std::to_string(kFewestPoints) + " needed";
    return result;
  }
  std::vector<Hypothesis> all;
  for (std::size_t i = 0; i < area.centres_odom.size(); ++i) {
    add_grid(area, i, map, parts.ground_m, all);
  }
  constexpr std::size_t kBlock = 64;
  workers.run((all.size() + kBlock - 1) / kBlock, [&](std::size_t block) {
    for (std::size_t i = block * kBlock; i < std::min(all.size(), (block + 1) * kBlock); ++i) {
      all[i].score = score_of(all[i], parts.near_level_m, map);
    }
  });
  std::vector<Hypothesis> best = best_of(std::move(all));
  workers.run(best.size(),
              [&](std::size_t i) { best[i] = climbed(best[i], parts.climb_level_m, map); });
  std::vector<Registration> found;
  for (const Hypothesis& h : best) {
    const auto T = refined(h, scan, scan.points_base, map, matching, workers);
    if (T) {
      Registration& registration = found.emplace_back();
      registration.T_odom_base = *T;
      registration.centre = area.centres_odom[h.centre];
      judge(parts, scan, map, matching, registration);
    }
  }
  if (found.empty()) {
    result.obstacle = "the scan matches nowhere";
    return result;
  }
  result.best = best_found(found);
  result.obstacle = obstacle_to(*result.best, area.farthest_m, config);
  result.accepted = result.obstacle.empty();
  return result;
}

}  // namespace trigpoint::lio_mapper
