// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/continuity.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <numbers>

namespace trigpoint::evaluation {

namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

void keep_larger(Step& largest, const Pose& expected, const StampedPose& actual) {
  ++largest.intervals;
  const double distance_m = (actual.pose.p - expected.p).norm();
  if (distance_m > largest.distance_m) {
    largest.distance_m = distance_m;
    largest.rotation_deg = so3_log(expected.q.conjugate() * actual.pose.q).norm() * kDegrees;
    largest.stamp_ns = actual.stamp_ns;
  }
}

}  // namespace

Step largest_step(const Trajectory& fused, const Trajectory& lio, const Breaks& breaks) {
  Step largest;
  largest.relative_to_lio = true;
  std::optional<Pose> T_map_odom;
  Nanoseconds before_ns = 0;
  for (const auto& pose : fused) {
    const auto odom = pose_at(lio, pose.stamp_ns);
    if (odom && T_map_odom && !is_between(breaks, before_ns, pose.stamp_ns)) {
      keep_larger(largest, *T_map_odom * *odom, pose);
    }
    before_ns = pose.stamp_ns;
    T_map_odom = odom ? std::optional<Pose>(pose.pose * odom->inverse()) : std::nullopt;
  }
  return largest;
}

Step largest_step_over(const Trajectory& fused, const Trajectory& odom, Nanoseconds interval_ns) {
  Step largest;
  largest.relative_to_lio = true;
  std::vector<std::optional<Pose>> odom_at;
  odom_at.reserve(fused.size());
  for (const auto& pose : fused) {
    odom_at.push_back(pose_at(odom, pose.stamp_ns));
  }
  std::size_t to = 0;
  for (std::size_t from = 0; from < fused.size(); ++from) {
    while (to < fused.size() && fused[to].stamp_ns - fused[from].stamp_ns < interval_ns) {
      ++to;
    }
    if (to == fused.size()) {
      break;
    }
    const bool near = fused[to].stamp_ns - fused[from].stamp_ns < 2 * interval_ns;
    if (near && odom_at[from] && odom_at[to]) {
      const Pose T_map_odom = fused[from].pose * odom_at[from]->inverse();
      keep_larger(largest, T_map_odom * *odom_at[to], fused[to]);
    }
  }
  return largest;
}

Step largest_step(const Trajectory& trajectory, const Breaks& breaks) {
  Step largest;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    if (!is_between(breaks, trajectory[i - 1].stamp_ns, trajectory[i].stamp_ns)) {
      keep_larger(largest, trajectory[i - 1].pose, trajectory[i]);
    }
  }
  return largest;
}

std::vector<Window> find_outages(const std::vector<Nanoseconds>& fixes_ns,
                                 Nanoseconds end_ns,
                                 Nanoseconds shortest_ns) {
  std::vector<Window> windows;
  for (std::size_t i = 0; i < fixes_ns.size(); ++i) {
    const Nanoseconds next_ns = i + 1 < fixes_ns.size() ? fixes_ns[i + 1] : end_ns;
    if (next_ns - fixes_ns[i] > shortest_ns) {
      windows.push_back({fixes_ns[i], next_ns});
    }
  }
  return windows;
}

bool is_inside(const std::vector<Window>& windows, Nanoseconds stamp_ns) {
  return std::any_of(windows.begin(), windows.end(), [&](const Window& window) {
    return window.begin_ns < stamp_ns && stamp_ns < window.end_ns;
  });
}

std::vector<OutageError> outage_errors(const std::vector<PosePair>& pairs,
                                       const std::vector<Window>& windows) {
  std::vector<OutageError> errors;
  for (const auto& window : windows) {
    auto& result = errors.emplace_back();
    result.window = window;
    std::optional<Eigen::Vector3d> last_m;  // on the reference
    for (const auto& pair : pairs) {
      if (!is_inside({window}, pair.stamp_ns)) {
        continue;
      }
      const double moved_m = last_m ? (pair.reference.p - *last_m).norm() : 0.0;
      result.distance_m = last_m ? result.distance_m + moved_m : 0.0;
      last_m = pair.reference.p;
      const double error_m = (pair.estimate.p - pair.reference.p).norm();
      result.begin_m = result.pairs == 0 ? error_m : result.begin_m;
      result.max_m = result.pairs == 0 ? error_m : std::max(result.max_m, error_m);
      result.end_m = error_m;
      ++result.pairs;
    }
  }
  return errors;
}

}  // namespace trigpoint::evaluation
