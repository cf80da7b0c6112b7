// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/pose_graph.hpp"

#include "trigpoint/base/so3.hpp"

#include "pose_graph_factors.hpp"
#include "pose_graph_loops.hpp"
#include "pose_graph_solver.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

RelativeFactor factor_of(const Loop& loop) {
  return {loop.earlier, loop.later, loop.T_earlier_later, loop.covariance};
}

class Correction {
 public:
  Correction(const GraphInput& input,
             const CloudOfKeyframe& cloud_of,
             const PoseGraphOptions& options,
             const std::function<void(double)>& progress)
      : input_(input),
        options_(options),
        progress_(progress),
        places_(place_online(input)),
        graph_(factors_of(input, places_, options)),
        search_(input, cloud_of, options, places_) {
    for (const std::optional<Pose>& place : places_.T_map_base) {
      nodes_.push_back(place.value_or(Pose{}));
    }
    report_.keyframes = nodes_.size();
    report_.keyframes_left_out = static_cast<std::size_t>(
        std::count_if(places_.T_map_base.begin(), places_.T_map_base.end(), [](const auto& place) {
          return !place.has_value();
        }));
    report_.rows = graph_.positions.size();
  }

  CorrectedPast run() {
    solve_once();
    const auto rounds = options_.loops ? std::max<std::int64_t>(0, options_.rounds) : 0;
    for (std::int64_t round = 0; round < rounds; ++round) {
      search_.search(nodes_, [&](double share) {
        tell((static_cast<double>(round) + share) / static_cast<double>(rounds));
      });
      solve_with_loops();
    }
    tell(1.0);
    return result();
  }

 private:
  void tell(double share) const {
    if (progress_) {
      progress_(share);
    }
  }

  void solve_once() {
    const SolverSummary summary = solve(graph_, nodes_);
    report_.iterations += summary.iterations;
    report_.initial_cost =
        std::isnan(report_.initial_cost) ? summary.initial_cost : report_.initial_cost;
    report_.final_cost = summary.final_cost;
    report_.converged = summary.converged;
  }

  /// What contradicts the solution is left out, and the rest solved again.
  void solve_with_loops() {
    loops_ = search_.consistent();
    outvoted_ = 0;
    do {
      graph_.loops.clear();
      for (const Loop& loop : loops_) {
        graph_.loops.push_back(factor_of(loop));
      }
      solve_once();
    } while (drop_contradicting());
  }

  bool drop_contradicting() {
    const std::size_t before = loops_.size();
    std::erase_if(loops_, [&](Loop& loop) {
      loop.sigmas = sigmas_of(factor_of(loop), nodes_);
      return loop.sigmas > options_.loop_max_sigmas;
    });
    outvoted_ += before - loops_.size();
    return loops_.size() < before;
  }

  CorrectedPast result() {
    CorrectedPast past;
    past.frame = places_.frame;
    past.loops = loops_;
    past.registered = search_.found();
    report_.loops = loops_.size();
    report_.loops_refused = search_.refused();
    if (outvoted_ > 0) {
      report_.loops_refused.push_back({"outvoted", outvoted_});
    }
    report_.rows_doubted = static_cast<std::size_t>(
        std::count_if(graph_.positions.begin(), graph_.positions.end(), [&](const auto& factor) {
          return sigmas_of(factor, nodes_) > options_.row_width;
        }));
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const std::optional<Pose>& online = places_.T_map_base[i];
      past.T_map_base.push_back(online ? std::optional(nodes_[i]) : std::nullopt);
      if (online) {
        report_.largest_correction_m =
            std::max(report_.largest_correction_m, (nodes_[i].p - online->p).norm());
      }
    }
    past.report = report_;
    return past;
  }

  const GraphInput& input_;
  const PoseGraphOptions& options_;
  const std::function<void(double)>& progress_;
  OnlinePlaces places_;
  Graph graph_;
  LoopSearch search_;
  std::vector<Pose> nodes_;
  std::vector<Loop> loops_;
  std::size_t outvoted_{0};
  PoseGraphReport report_;
};

/// Weighted by nearness in time, of the keyframes before and after.
Pose carried_over(const GraphInput& input,
                  const CorrectedPast& past,
                  std::size_t after,
                  const EpochRange& epoch,
                  const OdomSample& sample) {
  const auto by = [&](std::size_t keyframe) {
    return *past.T_map_base[keyframe] *
           (input.keyframes[keyframe].T_odom_base.inverse() * sample.T_odom_base);
  };
  if (after == epoch.first || after == epoch.last) {
    return by(after == epoch.first ? after : after - 1);
  }
  const Nanoseconds from_ns = input.keyframes[after - 1].stamp_ns;
  const Nanoseconds to_ns = input.keyframes[after].stamp_ns;
  return interpolate(by(after - 1),
                     by(after),
                     static_cast<double>(sample.stamp_ns - from_ns) /
                         static_cast<double>(std::max<Nanoseconds>(1, to_ns - from_ns)));
}

}  // namespace

CorrectedPast correct_past(const GraphInput& input,
                           const CloudOfKeyframe& cloud_of,
                           const PoseGraphOptions& options,
                           const std::function<void(double)>& progress) {
  if (input.keyframes.empty()) {
    return {};
  }
  return Correction(input, cloud_of, options, progress).run();
}

std::vector<MapSample> corrected_trajectory(const GraphInput& input, const CorrectedPast& past) {
  std::vector<MapSample> samples;
  for (const EpochRange& epoch : epochs_of(input)) {
    if (!past.T_map_base[epoch.first]) {
      continue;
    }
    std::size_t after = epoch.first;
    for (std::size_t i = epoch.first_sample; i < epoch.last_sample; ++i) {
      const OdomSample& sample = input.trajectory[i];
      while (after < epoch.last && input.keyframes[after].stamp_ns <= sample.stamp_ns) {
        ++after;
      }
      samples.push_back({sample.stamp_ns, carried_over(input, past, after, epoch, sample), i});
    }
  }
  return samples;
}

void merge_sessions(GraphInput& into, GraphInput second, const Pose& T_map_second) {
  std::uint32_t first_epoch = 0;
  for (const GraphKeyframe& keyframe : into.keyframes) {
    first_epoch = std::max(first_epoch, keyframe.odom_epoch + 1);
  }
  const auto moved = [&](const YawPose& T) {
    // The tilt belongs to odom; what the second map leans by (its datum lies elsewhere on the
    // Earth, 0.01 degree per km) the graph corrects.
    YawPose result = T;
    result.yaw_rad = wrap_angle(T.yaw_rad + yaw_of(T_map_second.q));
    result.p = T_map_second * T.p;
    return result;
  };
  for (GraphKeyframe& keyframe : second.keyframes) {
    keyframe.odom_epoch += first_epoch;
    keyframe.T_map_odom = moved(keyframe.T_map_odom);
  }
  for (OdomSample& sample : second.trajectory) {
    sample.odom_epoch += first_epoch;
  }
  const Eigen::Matrix3d R = T_map_second.q.toRotationMatrix();
  for (StoredRow& row : second.rows) {
    row.odom_epoch += first_epoch;
    row.update.position_map_m = T_map_second * row.update.position_map_m;
    row.update.covariance_map_m2 = R * row.update.covariance_map_m2 * R.transpose();
  }
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  append(into.keyframes, second.keyframes);
  append(into.trajectory, second.trajectory);
  append(into.rows, second.rows);
}

}  // namespace trigpoint::lio_mapper
