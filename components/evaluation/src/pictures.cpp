// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "pictures.hpp"

#include <algorithm>

namespace trigpoint::evaluation {

std::optional<Pose> lio_placement(const SessionData& data) {
  const auto& target = data.truth.empty() ? data.fused : data.truth;
  return align(associate(data.lio, target).pairs, AlignmentKind::kYawTranslation);
}

const char* lio_title(bool is_placed) {
  return is_placed ? "lio (yaw + translation)" : "lio (odom, not aligned)";
}

double seconds_since(Nanoseconds begin_ns, Nanoseconds stamp_ns) {
  return to_seconds(stamp_ns - begin_ns);
}

Trajectory thinned(const Trajectory& trajectory, std::size_t most) {
  const std::size_t step = std::max<std::size_t>(1, trajectory.size() / most);
  Trajectory result;
  for (std::size_t i = 0; i < trajectory.size(); i += step) {
    result.push_back(trajectory[i]);
  }
  return result;
}

}  // namespace trigpoint::evaluation
