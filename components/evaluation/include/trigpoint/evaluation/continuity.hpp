// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What happens between fixes, and whether what is published steps.
#pragma once

#include "trigpoint/evaluation/trajectory_error.hpp"

#include <optional>
#include <vector>

namespace trigpoint::evaluation {

struct Step {
  double distance_m{0.0};
  double rotation_deg{0.0};     ///< at the same moment
  Nanoseconds stamp_ns{0};      ///< of the pose after it
  std::size_t intervals{0};     ///< looked at
  bool relative_to_lio{false};  ///< else the plain change between consecutive poses
};

/// Largest of |p_fused(k+1) - T_map_odom(k) p_lio(k+1)| with T_map_odom(k) = fused(k) lio(k)^-1:
/// the change of what is published minus the change of odom over the same interval, at base_link.
/// Intervals with a break in them are not looked at.
Step largest_step(const Trajectory& fused, const Trajectory& lio, const Breaks& breaks = {});

/// The same over `interval_ns` instead of between consecutive poses: from each pose to the first
/// one that is no less than the interval later (and less than twice of it). The frames are those of
/// the earlier pose, so both trajectories need poses at the same rate, as fusion/odometry and
/// lio/odometry_imu_rate have.
Step largest_step_over(const Trajectory& fused, const Trajectory& odom, Nanoseconds interval_ns);

/// Largest plain change of position between consecutive poses without a break between them.
Step largest_step(const Trajectory& trajectory, const Breaks& breaks = {});

struct Window {
  Nanoseconds begin_ns{0};
  Nanoseconds end_ns{0};
};

/// Gaps longer than `shortest_ns` between consecutive fixes, and from the last fix to `end_ns`.
/// Before the first fix there is none. `fixes_ns` in order of time.
std::vector<Window> find_outages(const std::vector<Nanoseconds>& fixes_ns,
                                 Nanoseconds end_ns,
                                 Nanoseconds shortest_ns = 2 * kNanosecondsPerSecond);

bool is_inside(const std::vector<Window>& windows, Nanoseconds stamp_ns);

struct OutageError {
  Window window;
  std::size_t pairs{0};
  double begin_m{kNaN};  ///< position error at the first pair inside
  double max_m{kNaN};
  double end_m{kNaN};       ///< at the last pair inside
  double distance_m{kNaN};  ///< along the reference, from the first to the last pair inside
};

/// One per window, in order; NaN where no pair lies inside.
std::vector<OutageError> outage_errors(const std::vector<PosePair>& pairs,
                                       const std::vector<Window>& windows);

}  // namespace trigpoint::evaluation
