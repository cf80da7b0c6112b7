// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The correlative search behind register_scan.
#pragma once

#include "trigpoint/base/so3.hpp"

#include "ground_grid.hpp"
#include "likelihood_field.hpp"
#include "relocaliser.hpp"
#include "scan_parts.hpp"
#include "workers.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

namespace trigpoint::lio_mapper {

/// Where the robot may be: a place, level but for its heading.
struct Hypothesis {
  Eigen::Vector3d p_odom_m;
  double yaw_rad{0.0};
  std::size_t centre{0};
  double score{0.0};
};

/// The search of one area.
class HillSearch {
 public:
  static constexpr double kStep_m = 0.5;  // of the grid: two sigmas of the field

  HillSearch(const SearchArea& area, const ScanParts& parts, const LocalMap& map, Workers& workers)
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
  Eigen::Matrix2d spread_about(const Hypothesis& top) const {
    const auto points = turned(parts_.fine_level_m, from_yaw(top.yaw_rad));
    const LikelihoodField& field = field_of(top.centre);
    const double least = mean_likelihood(field, points, top.p_odom_m) - kAsGood;
    // Beyond that a place as good is a rival, unless the robot must be in the area.
    const double reach_m = area_.holds_robot ? area_.radius_m + kStep_m : kSame_m;
    const int steps = static_cast<int>(reach_m / kSpreadStep_m);
    Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
    int count = 0;
    for (int x = -steps; x <= steps; ++x) {
      for (int y = -steps; y <= steps; ++y) {
        const Eigen::Vector3d offset_m = kSpreadStep_m * Eigen::Vector3d(x, y, 0.0);
        if (mean_likelihood(field, points, top.p_odom_m + offset_m) >= least) {
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

  /// The best share of a place that is another one. Where the robot must be in the area, it is one
  /// only when worse places lie between: along a corridor all are one.
  double runner_up_share(const Hypothesis& top, const std::vector<Hypothesis>& hills) const {
    double best = 0.0;
    for (const Hypothesis& other : hills) {
      const double apart_m = area_.holds_robot ? kNeighbour_m : kSame_m;
      if (!is_near(other, top, apart_m, kSame_rad)) {
        const double share = share_at(other);
        if (!area_.holds_robot || share_at(between(top, other)) < share - kValley) {
          best = std::max(best, share);
        }
      }
    }
    return best;
  }

 private:
  static constexpr double kYawStep_rad = 0.05;  // 0.6 m at half a step and 25 m
  /// So far from the ground's height, or the predicted one, the height that fits best is looked
  /// for.
  static constexpr double kHeightReach_m = 0.6;
  static constexpr double kHeightStep_m = 0.1;
  static constexpr double kSameHeight_m = LikelihoodField::kSigma_m;
  /// Heights count by this power of their share: cells are as high as the field's sigma nearly, so
  /// that the middle of the best ones is meant.
  static constexpr double kHeightPower = 20.0;
  static constexpr double kGroundRadius_m = ScanParts::kGroundRadius_m;
  /// The ground below a robot may be hidden from it, but not all around.
  static constexpr double kGroundBeside_m = 2.0;
  static constexpr double kSomething = 0.05;  // likelihood of a point that has any other near
  /// The best places of the grid climb, and the best hills' too: so often at half the steps, within
  /// a step of the grid.
  static constexpr std::size_t kClimbing = 8;
  static constexpr int kHalvings = 4;
  static constexpr int kMostClimbs = 4;  // at steps of one size
  /// Of the grid's places that climb, none is so near to a better one.
  static constexpr double kNeighbour_m = 1.0;
  static constexpr double kNeighbour_rad = 0.1;
  /// Two places or headings that differ by less are on one hill of the field.
  static constexpr double kSame_m = 2.0;
  static constexpr double kSame_rad = 0.2;
  /// Where the robot must be within the area, its middle is as good as this much more share at the
  /// rim: along a corridor nothing else tells.
  static constexpr double kMiddleLead = 0.1;
  /// Places with so much less share are as good: it is the mean over points of which many are
  /// alike.
  static constexpr double kAsGood = 0.02;
  static constexpr double kSpreadStep_m = 0.25;
  /// Between two hills the share is lower by as much at least.
  static constexpr double kValley = 0.1;
  /// Centres so near to each other share one field.
  static constexpr double kSameField_m = 5.0;

  static bool is_near(const Hypothesis& a,
                      const Hypothesis& b,
                      double distance_m,
                      double turn_rad) {
    return (a.p_odom_m - b.p_odom_m).norm() < distance_m &&  // another floor is another place
           std::abs(wrap_angle(a.yaw_rad - b.yaw_rad)) < turn_rad;
  }

  static GroundGrid ground_of(const PointCloud& map_points, const Pose& centre, double radius_m) {
    GroundGrid grid(centre.p.head<2>(), radius_m + kGroundRadius_m);
    for (const PointXyzi& point : map_points) {
      grid.add(point.position().cast<double>());
    }
    return grid;
  }

  /// The points in axes of odom, about the robot.
  static std::vector<Eigen::Vector3d> turned(const std::vector<Eigen::Vector3d>& level_m,
                                             const Eigen::Quaterniond& q_odom_level) {
    const Eigen::Matrix3d R = q_odom_level.toRotationMatrix();
    std::vector<Eigen::Vector3d> result;
    result.reserve(level_m.size());
    for (const Eigen::Vector3d& p : level_m) {
      result.push_back(R * p);
    }
    return result;
  }

  static double mean_likelihood(const LikelihoodField& field,
                                const std::vector<Eigen::Vector3d>& turned_m,
                                const Eigen::Vector3d& place_odom_m) {
    double sum = 0.0;
    for (const Eigen::Vector3d& p : turned_m) {
      sum += field.at(p + place_odom_m);
    }
    return sum / static_cast<double>(turned_m.size());
  }

  static Hypothesis between(const Hypothesis& a, const Hypothesis& b) {
    Hypothesis middle = a;
    middle.p_odom_m = 0.5 * (a.p_odom_m + b.p_odom_m);
    middle.yaw_rad = wrap_angle(a.yaw_rad + 0.5 * wrap_angle(b.yaw_rad - a.yaw_rad));
    return middle;
  }

  static bool better(const Hypothesis& a, const Hypothesis& b) { return a.score > b.score; }

  void add_field(const Eigen::Vector3d& centre_m) {
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
  double lead_of_middle(const Eigen::Vector3d& place_m, std::size_t centre) const {
    if (!area_.holds_robot) {
      return 0.0;
    }
    const double away_m = (place_m - area_.centres_odom[centre].p).head<2>().norm();
    const double ratio = away_m / std::max(area_.radius_m, kStep_m);
    return kMiddleLead * (1.0 - ratio * ratio);
  }

  double score_of(const Eigen::Vector3d& place_m,
                  const std::vector<Eigen::Vector3d>& turned_m,
                  std::size_t centre) const {
    return mean_likelihood(field_of(centre), turned_m, place_m) + lead_of_middle(place_m, centre);
  }

  /// Whether the map has something where the ground would be: walls alone let a robot float.
  bool has_ground_at(const Eigen::Vector3d& place_m, std::size_t centre) const {
    if (!parts_.ground_m) {
      return true;
    }
    const Eigen::Vector3d below_m = place_m + Eigen::Vector3d(0.0, 0.0, *parts_.ground_m);
    const std::array<Eigen::Vector3d, 5> around{
        below_m,
        below_m + kGroundBeside_m * Eigen::Vector3d::UnitX(),
        below_m - kGroundBeside_m * Eigen::Vector3d::UnitX(),
        below_m + kGroundBeside_m * Eigen::Vector3d::UnitY(),
        below_m - kGroundBeside_m * Eigen::Vector3d::UnitY()};
    return std::any_of(around.begin(), around.end(), [&](const Eigen::Vector3d& p) {
      return field_of(centre).at(p) > kSomething;
    });
  }

  /// Places about a centre: at its height, and on the ground where that is another one. There may
  /// be a bridge, or a floor below.
  std::vector<Eigen::Vector3d> places_about(std::size_t centre) const {
    const Pose& T = area_.centres_odom[centre];
    const bool on_ground_too = !area_.holds_robot && parts_.ground_m;
    std::optional<GroundGrid> ground;
    if (on_ground_too) {
      ground = ground_of(map_points_, T, area_.radius_m);
    }
    const int steps = static_cast<int>(std::ceil(area_.radius_m / kStep_m));
    std::vector<Eigen::Vector3d> places;
    for (int x = -steps; x <= steps; ++x) {
      for (int y = -steps; y <= steps; ++y) {
        const Eigen::Vector3d place_m = T.p + kStep_m * Eigen::Vector3d(x, y, 0.0);
        if ((place_m - T.p).norm() > area_.radius_m + kStep_m) {
          continue;
        }
        const std::size_t before = places.size();
        if (has_ground_at(place_m, centre)) {
          places.push_back(place_m);
        }
        const std::optional<double> height =
            on_ground_too ? ground->height_at(place_m.head<2>(), kGroundRadius_m) : std::nullopt;
        if (height) {
          const double z = *height - *parts_.ground_m;
          if (std::abs(z - place_m.z()) > kSameHeight_m || places.size() == before) {
            places.emplace_back(place_m.x(), place_m.y(), z);
          }
        }
        if (places.size() == before) {
          places.push_back(place_m);
        }
      }
    }
    return places;
  }

  /// The best of all places and headings about a centre.
  std::vector<Hypothesis> scored_grid(std::size_t centre) {
    const std::vector<Eigen::Vector3d> places = places_about(centre);
    const int turns = static_cast<int>(std::ceil(area_.yaw_rad / yaw_step_rad_));
    std::vector<std::vector<Hypothesis>> best(static_cast<std::size_t>(2 * turns + 1));
    workers_.run(best.size(), [&](std::size_t heading) {
      const double yaw_rad = wrap_angle(yaw_of(area_.centres_odom[centre].q) +
                                        yaw_step_rad_ * (static_cast<int>(heading) - turns));
      const std::vector<Eigen::Vector3d> points = turned(parts_.coarse_level_m, from_yaw(yaw_rad));
      std::vector<Hypothesis> all;
      all.reserve(places.size());
      for (const Eigen::Vector3d& place_m : places) {
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
      const Eigen::Vector3d offset_m(0.0, 0.0, i * kHeightStep_m);
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
    const auto moved = [&](const Eigen::Vector3d& steps) {
      Hypothesis h = start;
      h.p_odom_m.head<2>() += kStep_m * steps.head<2>();
      h.yaw_rad = wrap_angle(h.yaw_rad + yaw_step_rad_ * steps.z());
      h.score = score_of(h.p_odom_m, turned(parts_.fine_level_m, from_yaw(h.yaw_rad)), h.centre);
      return h;
    };
    Eigen::Vector3d at = Eigen::Vector3d::Zero();  // in steps of the grid
    Hypothesis best = moved(at);
    double step = 1.0;
    for (int halving = 0; halving < kHalvings; ++halving) {
      step *= 0.5;
      for (int climb = 0; climb < kMostClimbs; ++climb) {
        const Eigen::Vector3d from = at;
        for (int i = 0; i < 6; ++i) {
          const Eigen::Vector3d to =
              from + (i % 2 == 0 ? step : -step) * Eigen::Vector3d::Unit(i / 2);
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
    best = settled(best);
    best.score =
        score_of(best.p_odom_m, turned(parts_.fine_level_m, from_yaw(best.yaw_rad)), best.centre);
    return best;
  }

  const SearchArea& area_;
  const ScanParts& parts_;
  PointCloud map_points_;
  Workers& workers_;
  double yaw_step_rad_;
  std::vector<LikelihoodField> fields_;
  std::vector<Eigen::Vector3d> field_at_m_;
  std::vector<std::size_t> field_of_centre_;
};

}  // namespace trigpoint::lio_mapper
