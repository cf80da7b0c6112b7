// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fix_reference.hpp"

#include "trigpoint/geodesy/local_frame.hpp"

#include <algorithm>

namespace trigpoint::evaluation {

Trajectory fix_positions(const std::vector<exporter::LoggedFix>& fixes,
                         const Datum& datum,
                         FixChoice choice) {
  const geodesy::LocalFrame frame(datum);
  Trajectory positions;
  for (const auto& [fix, receive_ns, withheld] : fixes) {
    const bool is_chosen = choice == FixChoice::kAll || withheld;
    if (!is_chosen || fix.status == FixStatus::kNoFix) {
      continue;
    }
    const auto p = frame.to_map({fix.latitude_deg, fix.longitude_deg, fix.altitude_m});
    if (p) {
      positions.push_back({fix.stamp_ns, Pose(Eigen::Quaterniond::Identity(), *p)});
    }
  }
  const auto earlier = [](const StampedPose& a, const StampedPose& b) {
    return a.stamp_ns < b.stamp_ns;
  };
  std::stable_sort(positions.begin(), positions.end(), earlier);
  const auto last =
      std::unique(positions.begin(), positions.end(), [](const auto& a, const auto& b) {
        return a.stamp_ns == b.stamp_ns;
      });
  positions.erase(last, positions.end());
  return positions;
}

Association associate_fixes(const Trajectory& estimate,
                            const Trajectory& fix_positions_map,
                            const Eigen::Vector3d& antenna_position_base_m,
                            Nanoseconds largest_gap_ns) {
  Association result;
  const Pose T_base_antenna(Eigen::Quaterniond::Identity(), antenna_position_base_m);
  std::size_t since_first = 0;
  for (const auto& fix : fix_positions_map) {
    since_first += !estimate.empty() && fix.stamp_ns >= estimate.front().stamp_ns ? 1 : 0;
    if (const auto pose = pose_at(estimate, fix.stamp_ns, largest_gap_ns)) {
      result.pairs.push_back({fix.stamp_ns, *pose * T_base_antenna, fix.pose});
    }
  }
  const auto matched = static_cast<double>(result.pairs.size());
  if (since_first > 0) {
    result.coverage.from_first = matched / static_cast<double>(since_first);
  }
  if (!fix_positions_map.empty()) {
    result.coverage.whole = matched / static_cast<double>(fix_positions_map.size());
  }
  return result;
}

}  // namespace trigpoint::evaluation
