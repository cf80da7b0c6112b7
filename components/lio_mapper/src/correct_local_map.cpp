// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/point_cloud.hpp"
#include "trigpoint/lio_mapper/past.hpp"

#include "local_map.hpp"
#include "pose_graph_factors.hpp"
#include "relative_sigma.hpp"
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

namespace trigpoint::lio_mapper {

namespace {

/// Driven, over which the filter's own poses go over into the graph's.
constexpr double kNewestStretch_m = 60.0;
/// What has moved less is where odom had it anyway.
constexpr double kStayed_m = 0.05;
/// What has moved more must be known so well, relative to the robot.
constexpr double kBacked_m = 0.15;
/// The uncertainty of neighbours hardly differs.
constexpr double kAskEvery_m = 10.0;

class Placement {
 public:
  Placement(const PastSnapshot& snapshot, const CorrectedPast& past)
      : input_(snapshot.input),
        past_(past),
        newest_(input_.keyframes.size() - 1),
        driven_m_(driven_of(input_)),
        T_odom_frame_(input_.keyframes[newest_].T_odom_base * past.T_map_base[newest_]->inverse()),
        sigma_(with_loops(snapshot, past), nodes_of(past), newest_) {}

  const Pose& T_odom_frame() const { return T_odom_frame_; }

  double driven_back_m(std::size_t keyframe) const {
    return driven_m_[newest_] - driven_m_[keyframe];
  }

  /// The keyframes whose points the mapper's map holds: the robot has never since been farther from
  /// them than that reaches. What was forgotten is not brought back: where it has drifted within
  /// what counts as the same place it would only pull.
  std::vector<std::size_t> held(double half_side_m) const {
    std::vector<std::size_t> keyframes;
    Eigen::AlignedBox2d driven_since;
    for (std::size_t i = newest_ + 1; i-- > 0;) {
      if (input_.keyframes[i].odom_epoch != input_.keyframes[newest_].odom_epoch) {
        break;
      }
      const Eigen::Vector2d p = input_.keyframes[i].T_odom_base.p.head<2>();
      driven_since.extend(p);
      const Eigen::Vector2d reach = (driven_since.max() - p).cwiseMax(p - driven_since.min());
      if (past_.T_map_base[i] && reach.maxCoeff() <= half_side_m) {
        keyframes.push_back(i);
      }
    }
    std::reverse(keyframes.begin(), keyframes.end());
    return keyframes;
  }

  /// The newest one stays, and what lies farther back than the newest stretch is where the graph
  /// has it, seen from the newest one.
  Pose T_odom_base(std::size_t keyframe) const {
    const Pose corrected = T_odom_frame_ * *past_.T_map_base[keyframe];
    return interpolate(input_.keyframes[keyframe].T_odom_base,
                       corrected,
                       std::min(1.0, driven_back_m(keyframe) / kNewestStretch_m));
  }

  double moved_m(std::size_t keyframe, const Pose& T_odom_base) const {
    return (T_odom_base.p - input_.keyframes[keyframe].T_odom_base.p).norm();
  }

  bool is_trusted(std::size_t keyframe, const Pose& T_odom_base) {
    if (driven_back_m(keyframe) < kNewestStretch_m || moved_m(keyframe, T_odom_base) < kStayed_m) {
      return true;
    }
    if (!asked_at_m_ || std::abs(driven_m_[keyframe] - *asked_at_m_) > kAskEvery_m) {
      asked_at_m_ = driven_m_[keyframe];
      sigma_m_ = sigma_.of(keyframe);
    }
    return sigma_m_ < kBacked_m;
  }

 private:
  static std::vector<Pose> nodes_of(const CorrectedPast& past) {
    std::vector<Pose> nodes;
    for (const std::optional<Pose>& pose : past.T_map_base) {
      nodes.push_back(pose.value_or(Pose{}));
    }
    return nodes;
  }

  static Graph with_loops(const PastSnapshot& snapshot, const CorrectedPast& past) {
    Graph graph = factors_of(snapshot.input, place_online(snapshot.input), snapshot.options);
    for (const Loop& loop : past.loops) {
      graph.loops.push_back({loop.earlier, loop.later, loop.T_earlier_later, loop.covariance});
    }
    return graph;
  }

  const GraphInput& input_;
  const CorrectedPast& past_;
  std::size_t newest_;
  std::vector<double> driven_m_;
  Pose T_odom_frame_;
  RelativeSigma sigma_;
  std::optional<double> asked_at_m_;
  double sigma_m_{0.0};
};

struct Placed {
  std::size_t keyframe;
  Pose T_odom_base;
};

std::vector<Placed> place_all(const PastSnapshot& snapshot,
                              Placement& placement,
                              PastReport& report) {
  std::vector<Placed> placed;
  for (const std::size_t i : placement.held(snapshot.local_map.half_side_m)) {
    const Pose T_odom_base = placement.T_odom_base(i);
    if (!placement.is_trusted(i, T_odom_base)) {
      ++report.left_out;
      continue;
    }
    placed.push_back({i, T_odom_base});
    report.largest_move_m = std::max(report.largest_move_m, placement.moved_m(i, T_odom_base));
  }
  report.placed = placed.size();
  report.changed = report.left_out > 0 || report.largest_move_m > kStayed_m;
  return placed;
}

}  // namespace

std::optional<CorrectedMap> correct_local_map(PastSnapshot snapshot,
                                              const CloudOfKeyframe& cloud_of,
                                              const std::function<void(double)>& progress) {
  if (snapshot.input.keyframes.empty()) {
    return std::nullopt;
  }
  CorrectedPast past = correct_past(snapshot.input, cloud_of, snapshot.options, progress);
  if (!past.T_map_base.back()) {
    return std::nullopt;
  }
  PastReport report;
  report.keyframes = past.report.keyframes;
  report.rows = past.report.rows;
  report.loops = past.loops.size();
  std::unique_ptr<LocalMap> map = make_local_map(snapshot.local_map);
  Placement placement(snapshot, past);
  const std::vector<Placed> placed = place_all(snapshot, placement, report);
  if (report.changed) {
    for (const Placed& keyframe : placed) {
      map->insert(moved(cloud_of(keyframe.keyframe), keyframe.T_odom_base));
    }
    map->prune(snapshot.input.keyframes.back().T_odom_base.p, snapshot.local_map.half_side_m);
  }
  const Pose T_odom_frame = placement.T_odom_frame();
  CorrectedMap corrected(std::move(map), std::move(snapshot), std::move(past), T_odom_frame);
  corrected.report = report;
  return corrected;
}

}  // namespace trigpoint::lio_mapper
