// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "relocaliser.hpp"

#include "trigpoint/base/so3.hpp"

#include "ground_grid.hpp"
#include "iterated_update.hpp"
#include "likelihood_field.hpp"
#include "scan_matcher.hpp"
#include "scan_parts.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

namespace trigpoint::lio_mapper {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr double kStep_m = 0.5;        // of the grid: two sigmas of the field
constexpr double kYawStep_rad = 0.05;  // 0.6 m at half a step and 25 m
/// So far from the ground's height, or the predicted one, the height that fits best is looked for.
constexpr double kHeightReach_m = 0.6;
constexpr double kHeightStep_m = 0.1;
constexpr double kSameHeight_m = 0.25;  // as the field's sigma
/// Heights count by this power of their share: cells are as high as the field's sigma nearly, so
/// that the middle of the best ones is meant.
constexpr double kHeightPower = 20.0;
constexpr double kGroundRadius_m = 12.0;
constexpr std::size_t kRefinedPoints = 3000;
/// The best places of the grid climb, and the best hills' too: so often at half the steps, within a
/// step of the grid.
constexpr std::size_t kClimbing = 8;
constexpr int kHalvings = 4;
constexpr int kMostClimbs = 4;  // at steps of one size
/// Of the grid's places that climb, none is so near to a better one.
constexpr double kNeighbour_m = 1.0;
constexpr double kNeighbour_rad = 0.1;
/// Two places or headings that differ by less are on one hill of the field.
constexpr double kSame_m = 2.0;
constexpr double kSame_rad = 0.2;
/// Where the robot must be within the area, its middle is as good as this much more share at the
/// rim: along a corridor nothing else tells.
constexpr double kMiddleLead = 0.1;
/// Places with so much less share are as good: it is the mean over points of which many are alike.
constexpr double kAsGood = 0.02;
constexpr double kSpreadStep_m = 0.25;
/// Centres so near to each other share one field.
constexpr double kSameField_m = 5.0;
/// The matcher goes at most so far from the top of the hill: beyond it slid somewhere else.
constexpr double kRefined_m = 0.5;
constexpr double kRefined_rad = 0.05;
constexpr std::int64_t kMaxIterations = 20;
/// Of the top of a hill.
constexpr double kTopPosition_m = 0.15;
constexpr double kTopYaw_rad = 0.02;
constexpr double kLevel_rad = 0.01;  // of the scan's

struct Hypothesis {
  Vector3d p_odom_m;
  double yaw_rad{0.0};
  std::size_t centre{0};
  double score{0.0};
};

bool is_near(const Hypothesis& a, const Hypothesis& b, double distance_m, double turn_rad) {
  return (a.p_odom_m - b.p_odom_m).norm() < distance_m &&  // another floor is another place
         std::abs(wrap_angle(a.yaw_rad - b.yaw_rad)) < turn_rad;
}

GroundGrid ground_of(const PointCloud& map_points, const Pose& centre, double radius_m) {
  GroundGrid grid(centre.p.head<2>(), radius_m + kGroundRadius_m);
  for (const PointXyzi& point : map_points) {
    grid.add(point.position().cast<double>());
  }
  return grid;
}

/// The points in axes of odom, about the robot.
std::vector<Vector3d> turned(const std::vector<Vector3d>& level_m,
                             const Quaterniond& q_odom_level) {
  const Eigen::Matrix3d R = q_odom_level.toRotationMatrix();
  std::vector<Vector3d> result;
  result.reserve(level_m.size());
  for (const Vector3d& p : level_m) {
    result.push_back(R * p);
  }
  return result;
}

double mean_likelihood(const LikelihoodField& field,
                       const std::vector<Vector3d>& turned_m,
                       const Vector3d& place_odom_m) {
  double sum = 0.0;
  for (const Vector3d& p : turned_m) {
    sum += field.at(p + place_odom_m);
  }
  return sum / static_cast<double>(turned_m.size());
}

/// The search of one area.
class Search {
 public:
  Search(const SearchArea& area, const ScanParts& parts, const LocalMap& map, Workers& workers)
      : area_(area),
        parts_(parts),
        map_points_(map.points()),
        workers_(workers),
        yaw_step_rad_(kYawStep_rad * ScanParts::kNear_m / parts.reach_m) {
    for (const Pose& centre : area.centres_odom) {
      add_field(centre.p);
    }
  }

  /// The tops of hills of the field, best first.
  std::vector<Hypothesis> hills() {
    std::vector<Hypothesis> all;
    for (std::size_t i = 0; i < area_.centres_odom.size(); ++i) {
      const std::vector<Hypothesis> here = scored_grid(i);
      all.insert(all.end(), here.begin(), here.end());
    }
    std::vector<Hypothesis> best = hills_and_rivals(std::move(all));
    workers_.run(best.size(), [&](std::size_t i) { best[i] = climbed(best[i]); });
    std::stable_sort(best.begin(), best.end(), better);
    return best;
  }

  double share_at(const Pose& T_odom_level, std::size_t centre) const {
    const auto points = turned(parts_.fine_level_m, T_odom_level.q);
    return mean_likelihood(field_of(centre), points, T_odom_level.p);
  }

  /// Scatter, in the plane, of the places about this one that are as good.
  Eigen::Matrix2d spread_about(const Pose& T_odom_level, std::size_t centre) const {
    const auto points = turned(parts_.fine_level_m, T_odom_level.q);
    const LikelihoodField& field = field_of(centre);
    const double least = mean_likelihood(field, points, T_odom_level.p) - kAsGood;
    const int steps = static_cast<int>(std::min(area_.radius_m + kStep_m, kSame_m) / kSpreadStep_m);
    Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
    int count = 0;
    for (int x = -steps; x <= steps; ++x) {
      for (int y = -steps; y <= steps; ++y) {
        const Vector3d offset_m = kSpreadStep_m * Vector3d(x, y, 0.0);
        if (mean_likelihood(field, points, T_odom_level.p + offset_m) >= least) {
          sum += offset_m.head<2>() * offset_m.head<2>().transpose();
          ++count;  // the place itself at least
        }
      }
    }
    return sum / count;
  }

  double share_at(const Hypothesis& h) const {
    return share_at({from_yaw(h.yaw_rad), h.p_odom_m}, h.centre);
  }

 private:
  static bool better(const Hypothesis& a, const Hypothesis& b) { return a.score > b.score; }

  void add_field(const Vector3d& centre_m) {
    for (std::size_t i = 0; i < field_at_m_.size(); ++i) {
      if ((field_at_m_[i] - centre_m).norm() < kSameField_m) {
        field_of_centre_.push_back(i);
        return;
      }
    }
    field_of_centre_.push_back(fields_.size());
    field_at_m_.push_back(centre_m);
    fields_.emplace_back(
        map_points_, centre_m, parts_.reach_m + area_.radius_m + kSameField_m + kStep_m);
  }

  const LikelihoodField& field_of(std::size_t centre) const {
    return fields_[field_of_centre_[centre]];
  }

  /// What counts for a place beside its likelihood.
  double lead_of_middle(const Vector3d& place_m, std::size_t centre) const {
    if (!area_.holds_robot) {
      return 0.0;
    }
    const double away_m = (place_m - area_.centres_odom[centre].p).head<2>().norm();
    const double ratio = away_m / std::max(area_.radius_m, kStep_m);
    return kMiddleLead * (1.0 - ratio * ratio);
  }

  double score_of(const Vector3d& place_m,
                  const std::vector<Vector3d>& turned_m,
                  std::size_t centre) const {
    return mean_likelihood(field_of(centre), turned_m, place_m) + lead_of_middle(place_m, centre);
  }

  /// Places about a centre: at its height, and on the ground where that is another one. There may
  /// be a bridge, or a floor below.
  std::vector<Vector3d> places_about(std::size_t centre) const {
    const Pose& T = area_.centres_odom[centre];
    const GroundGrid ground = ground_of(map_points_, T, area_.radius_m);
    const int steps = static_cast<int>(std::ceil(area_.radius_m / kStep_m));
    std::vector<Vector3d> places;
    for (int x = -steps; x <= steps; ++x) {
      for (int y = -steps; y <= steps; ++y) {
        const Vector3d place_m = T.p + kStep_m * Vector3d(x, y, 0.0);
        if ((place_m - T.p).norm() > area_.radius_m + kStep_m) {
          continue;
        }
        places.push_back(place_m);
        const std::optional<double> height = ground.height_at(place_m.head<2>(), kGroundRadius_m);
        if (area_.holds_robot || !height || !parts_.ground_m) {
          continue;
        }
        const double z = *height - *parts_.ground_m;
        if (std::abs(z - place_m.z()) > kSameHeight_m) {
          places.emplace_back(place_m.x(), place_m.y(), z);
        }
      }
    }
    return places;
  }

  /// The best of all places and headings about a centre.
  std::vector<Hypothesis> scored_grid(std::size_t centre) {
    const std::vector<Vector3d> places = places_about(centre);
    const int turns = static_cast<int>(std::ceil(area_.yaw_rad / yaw_step_rad_));
    std::vector<std::vector<Hypothesis>> best(static_cast<std::size_t>(2 * turns + 1));
    workers_.run(best.size(), [&](std::size_t heading) {
      const double yaw_rad = wrap_angle(yaw_of(area_.centres_odom[centre].q) +
                                        yaw_step_rad_ * (static_cast<int>(heading) - turns));
      const std::vector<Vector3d> points = turned(parts_.coarse_level_m, from_yaw(yaw_rad));
      std::vector<Hypothesis> all;
      all.reserve(places.size());
      for (const Vector3d& place_m : places) {
        all.push_back({place_m, yaw_rad, centre, score_of(place_m, points, centre)});
      }
      best[heading] = hills_and_rivals(std::move(all));
    });
    std::vector<Hypothesis> all;
    for (const std::vector<Hypothesis>& of_heading : best) {
      all.insert(all.end(), of_heading.begin(), of_heading.end());
    }
    return all;
  }

  /// The best places, close to each other too, and the best that are on other hills.
  static std::vector<Hypothesis> hills_and_rivals(std::vector<Hypothesis> all) {
    std::stable_sort(all.begin(), all.end(), better);
    std::vector<Hypothesis> best = best_of(all, kNeighbour_m, kNeighbour_rad);
    const std::vector<Hypothesis> rivals = best_of(all, kSame_m, kSame_rad);
    best.insert(best.end(), rivals.begin(), rivals.end());
    return best;
  }

  /// The first ones of a sorted list, none of them so near to a better one.
  static std::vector<Hypothesis> best_of(const std::vector<Hypothesis>& all,
                                         double apart_m,
                                         double apart_rad) {
    std::vector<Hypothesis> best;
    for (const Hypothesis& h : all) {
      const bool is_new = std::none_of(best.begin(), best.end(), [&](const Hypothesis& other) {
        return is_near(h, other, apart_m, apart_rad);
      });
      if (is_new) {
        best.push_back(h);
      }
      if (best.size() == kClimbing) {
        break;
      }
    }
    return best;
  }

  /// At the height at which the scan's ground lies best on the map.
  Hypothesis settled(Hypothesis h) const {
    if (parts_.ground_level_m.empty()) {
      return h;
    }
    const auto points = turned(parts_.ground_level_m, from_yaw(h.yaw_rad));
    const int steps = static_cast<int>(kHeightReach_m / kHeightStep_m);
    double sum = 0.0;
    double weighted_m = 0.0;
    for (int i = -steps; i <= steps; ++i) {
      const Vector3d offset_m(0.0, 0.0, i * kHeightStep_m);
      const double share = mean_likelihood(field_of(h.centre), points, h.p_odom_m + offset_m);
      const double weight = std::pow(share, kHeightPower);
      sum += weight;
      weighted_m += weight * offset_m.z();
    }
    if (sum > 0.0) {
      h.p_odom_m.z() += weighted_m / sum;
    }
    return h;
  }

  /// The best place within a step of a hypothesis of the grid.
  Hypothesis climbed(const Hypothesis& on_grid) const {
    const Hypothesis start = settled(on_grid);
    const auto moved = [&](const Vector3d& steps) {
      Hypothesis h = start;
      h.p_odom_m.head<2>() += kStep_m * steps.head<2>();
      h.yaw_rad = wrap_angle(h.yaw_rad + yaw_step_rad_ * steps.z());
      h.score = score_of(h.p_odom_m, turned(parts_.fine_level_m, from_yaw(h.yaw_rad)), h.centre);
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
    return settled(best);
  }

  const SearchArea& area_;
  const ScanParts& parts_;
  PointCloud map_points_;
  Workers& workers_;
  double yaw_step_rad_;
  std::vector<LikelihoodField> fields_;
  std::vector<Vector3d> field_at_m_;
  std::vector<std::size_t> field_of_centre_;
};

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
  if (!area.holds_robot && best.share - best.runner_up_share < config.min_lead) {
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
  if (area.holds_robot && away_m > area.radius_m + kStep_m) {
    char text[120];
    std::snprintf(text,
                  sizeof text,
                  "the best place is %.1f m from the expected one (at most %.1f)",
                  away_m,
                  area.radius_m + kStep_m);
    return text;
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
  Search search(area, parts, map, workers);
  const std::vector<Hypothesis> hills = search.hills();
  const Hypothesis& top = hills.front();
  const auto T =
      refined(top, scan, thinned(scan.points_base, kRefinedPoints), map, matching, workers);
  if (!T) {
    result.obstacle = "the scan matches nowhere";
    return result;
  }
  Registration& best = result.best.emplace();
  best.T_odom_base = *T;
  best.centre = area.centres_odom[top.centre];
  const Pose T_odom_level(T->q * scan.q_level_base.conjugate(), T->p);
  best.share = search.share_at(T_odom_level, top.centre);
  best.spread_m2 = search.spread_about(T_odom_level, top.centre);
  for (const Hypothesis& other : hills) {
    if (!is_near(other, top, kSame_m, kSame_rad)) {
      best.runner_up_share = std::max(best.runner_up_share, search.share_at(other));
    }
  }
  result.obstacle = obstacle_to(best, top, area, config);
  result.accepted = result.obstacle.empty();
  return result;
}

}  // namespace trigpoint::lio_mapper
