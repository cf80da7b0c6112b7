// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "pose_graph_loops.hpp"

#include "trigpoint/base/point_cloud.hpp"
#include "trigpoint/base/so3.hpp"

#include "downsample.hpp"
#include "pose_graph_registration.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace trigpoint::lio_mapper {

using Eigen::Vector3d;

namespace {

/// Middles of the maps that are matched against, so that neighbours share one.
constexpr double kMapEvery_m = 8.0;
constexpr std::size_t kMostMaps = 12;
constexpr std::size_t kMostVisits = 2;  // that one keyframe is tied to
constexpr double kMapVoxel_m = 0.3;
constexpr double kScanVoxel_m = 0.6;
constexpr std::size_t kMostPoints = 2000;
/// The same two visits, farther along.
constexpr double kNeighbours_m = 30.0;
/// What two registrations may disagree in, besides the odometry between them.
constexpr double kAgree_m = 0.12;
constexpr double kAgreePerMetre = 0.004;
constexpr double kAgree_rad = 0.012;

Pose odom_between(const GraphInput& input, std::size_t a, std::size_t b) {
  return input.keyframes[a].T_odom_base.inverse() * input.keyframes[b].T_odom_base;
}

}  // namespace

LoopSearch::LoopSearch(const GraphInput& input,
                       const CloudOfKeyframe& cloud_of,
                       const PoseGraphOptions& options,
                       const OnlinePlaces& places)
    : input_(input),
      cloud_of_(cloud_of),
      options_(options),
      places_(places),
      driven_m_(driven_of(input)),
      loops_(options.known_loops) {
  for (const Loop& loop : loops_) {
    registered_.insert({loop.earlier, loop.later});
  }
}

/// Of every earlier visit the nearest keyframe, nearest visits first.
std::vector<std::size_t> LoopSearch::visits_near(std::size_t from,
                                                 const std::vector<Pose>& nodes) const {
  struct Visit {
    double distance_m;
    std::size_t keyframe;
    std::size_t last;
  };

  std::vector<Visit> visits;
  for (std::size_t i = 0; i < from && driven_m_[from] - driven_m_[i] > options_.loop_apart_m; ++i) {
    const Vector3d apart = nodes[i].p - nodes[from].p;
    const double distance_m = apart.head<2>().norm();
    if (!places_.T_map_base[i] || distance_m > options_.loop_radius_m ||
        std::abs(apart.z()) > options_.loop_height_m) {
      continue;
    }
    if (visits.empty() || driven_m_[i] - driven_m_[visits.back().last] > options_.loop_apart_m) {
      visits.push_back({distance_m, i, i});
    } else if (distance_m < visits.back().distance_m) {
      visits.back() = {distance_m, i, i};
    }
    visits.back().last = i;
  }
  std::stable_sort(visits.begin(), visits.end(), [](const Visit& a, const Visit& b) {
    return a.distance_m < b.distance_m;
  });
  std::vector<std::size_t> keyframes;
  for (const Visit& visit : visits) {
    if (keyframes.size() < kMostVisits) {
      keyframes.push_back(visit.keyframe);
    }
  }
  return keyframes;
}

std::vector<LoopSearch::Pair> LoopSearch::pairs_near(const std::vector<Pose>& nodes) const {
  std::vector<Pair> pairs;
  std::optional<double> newest_m;
  for (std::size_t from = 0; from < nodes.size(); ++from) {
    if (!places_.T_map_base[from] ||
        (newest_m && driven_m_[from] - *newest_m < options_.loop_every_m)) {
      continue;
    }
    newest_m = driven_m_[from];
    if (from < options_.search_from) {
      continue;
    }
    for (const std::size_t visit : visits_near(from, nodes)) {
      // The first keyframe of its stretch of some metres stands for the others.
      std::size_t to = visit;
      const double stretch = std::floor(driven_m_[visit] / kMapEvery_m);
      while (to > 0 && std::floor(driven_m_[to - 1] / kMapEvery_m) == stretch &&
             input_.keyframes[to - 1].odom_epoch == input_.keyframes[to].odom_epoch) {
        --to;
      }
      pairs.push_back({to, from});
    }
  }
  return pairs;
}

std::pair<std::size_t, std::size_t> LoopSearch::stretch_about(std::size_t keyframe,
                                                              double half_m) const {
  const std::uint32_t epoch = input_.keyframes[keyframe].odom_epoch;
  std::size_t first = keyframe;
  std::size_t last = keyframe + 1;
  while (first > 0 && input_.keyframes[first - 1].odom_epoch == epoch &&
         driven_m_[keyframe] - driven_m_[first - 1] <= half_m) {
    --first;
  }
  while (last < driven_m_.size() && input_.keyframes[last].odom_epoch == epoch &&
         driven_m_[last] - driven_m_[keyframe] <= half_m) {
    ++last;
  }
  return {first, last};
}

/// In base axes of the keyframe in its middle.
const LocalMap& LoopSearch::map_about(std::size_t keyframe) {
  const auto known = maps_.find(keyframe);
  if (known != maps_.end()) {
    return *known->second;
  }
  if (maps_by_age_.size() >= kMostMaps) {
    maps_.erase(maps_by_age_.front());
    maps_by_age_.erase(maps_by_age_.begin());
  }
  SurfelMapConfig config;
  config.max_residual_m = 1.0;
  config.nearest_points = false;
  std::unique_ptr<LocalMap> map = make_surfel_map(config);
  const auto [first, last] = stretch_about(keyframe, options_.loop_half_map_m);
  for (std::size_t i = first; i < last; ++i) {
    map->insert(moved(downsample(cloud_of_(i), kMapVoxel_m), odom_between(input_, keyframe, i)));
  }
  maps_by_age_.push_back(keyframe);
  return *(maps_[keyframe] = std::move(map));
}

std::vector<Vector3d> LoopSearch::scan_of(std::size_t keyframe) {
  const PointCloud points = downsample(cloud_of_(keyframe), kScanVoxel_m);
  const std::size_t step =
      std::max<std::size_t>(1, (points.size() + kMostPoints - 1) / kMostPoints);
  std::vector<Vector3d> scan;
  for (std::size_t i = 0; i < points.size(); i += step) {
    scan.push_back(points[i].position().cast<double>());
  }
  return scan;
}

/// Why not, or nullptr.
const char* LoopSearch::register_pair(const Pair& pair, const std::vector<Pose>& nodes) {
  const Pose start = nodes[pair.to].inverse() * nodes[pair.from];
  const std::optional<CloudFit> found = fit_cloud(scan_of(pair.from), map_about(pair.to), start);
  if (!found) {
    return "no_match";
  }
  if (found->overlap < options_.min_overlap) {
    return "little_overlap";
  }
  if (found->fit < options_.min_fit) {
    return "poor_fit";
  }
  if ((found->T_map_cloud.p - start.p).norm() > options_.max_shift_m ||
      found->T_map_cloud.q.angularDistance(start.q) > options_.max_turn_rad) {
    return "far_from_estimate";
  }
  loops_.push_back({pair.to,
                    pair.from,
                    found->T_map_cloud,
                    found->covariance,
                    found->overlap,
                    found->fit,
                    kNaN});
  return nullptr;
}

void LoopSearch::search(const std::vector<Pose>& nodes,
                        const std::function<void(double)>& progress) {
  const std::vector<Pair> pairs = pairs_near(nodes);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::pair key{pairs[i].to, pairs[i].from};
    if (!registered_.contains(key)) {
      const char* const reason = register_pair(pairs[i], nodes);
      if (reason == nullptr) {
        registered_.insert(key);
        failed_.erase(key);
      } else {
        failed_[key] = reason;
      }
    }
    if (progress) {
      progress(static_cast<double>(i + 1) / static_cast<double>(pairs.size()));
    }
  }
}

bool LoopSearch::same_visits(const Loop& a, const Loop& b) const {
  return std::abs(driven_m_[a.earlier] - driven_m_[b.earlier]) < kNeighbours_m &&
         std::abs(driven_m_[a.later] - driven_m_[b.later]) < kNeighbours_m;
}

/// Round the cycle a.earlier, a.later, b.later, b.earlier, with odometry along both visits.
bool LoopSearch::agree(const Loop& a, const Loop& b) const {
  const Pose there = a.T_earlier_later * odom_between(input_, a.later, b.later);
  const Pose back = odom_between(input_, a.earlier, b.earlier) * b.T_earlier_later;
  const double driven_m = std::abs(driven_m_[a.earlier] - driven_m_[b.earlier]) +
                          std::abs(driven_m_[a.later] - driven_m_[b.later]);
  return (there.p - back.p).norm() < kAgree_m + kAgreePerMetre * driven_m &&
         there.q.angularDistance(back.q) < kAgree_rad;
}

std::vector<Loop> LoopSearch::consistent() const {
  std::vector<Loop> kept;
  for (const Loop& loop : loops_) {
    std::size_t agreeing = 0;
    std::size_t contradicting = 0;
    for (const Loop& other : loops_) {
      if (&other != &loop && same_visits(loop, other)) {
        ++(agree(loop, other) ? agreeing : contradicting);
      }
    }
    if (agreeing > 0 && agreeing >= contradicting) {
      kept.push_back(loop);
    }
  }
  return kept;
}

std::vector<NamedCount> LoopSearch::refused() const {
  std::map<std::string, std::uint64_t> counts;
  for (const auto& [pair, reason] : failed_) {
    ++counts[reason];
  }
  counts["inconsistent"] = loops_.size() - consistent().size();
  std::vector<NamedCount> named;
  for (const auto& [name, count] : counts) {
    if (count > 0) {
      named.push_back({name, count});
    }
  }
  return named;
}

}  // namespace trigpoint::lio_mapper
