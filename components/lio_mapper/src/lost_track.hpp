// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include "relocaliser.hpp"
#include "scan_filter.hpp"

#include <optional>

namespace trigpoint::lio_mapper {

/// After a while without a usable scan, or over a gap in the IMU, the pose is carried too far for
/// matching, which finds wrong planes instead of none. Then a scan is looked for in the local map
/// around the prediction, the farther the less that is certain.
class LostTrack {
 public:
  LostTrack(const MatchingConfig& matching, const RecoveryConfig& config)
      : matching_(matching), config_(config) {}

  /// What ScanFilter::process is to be given: empty while the scan can be matched as usual.
  /// `doubtful`: the scan comes after either of those. `filter` must live as long as it.
  PoseSearch search_for(ScanFilter& filter,
                        const Eigen::Vector3d& lidar_position_base_m,
                        Nanoseconds scan_ns,
                        bool doubtful);

  /// After a scan that was searched for. The event says where it was found, or that it was not.
  std::optional<Event> conclude(const ScanOutcome& outcome, Nanoseconds scan_ns);

  bool is_searching() const { return since_ns_.has_value(); }

  /// Searched for long enough: odom must begin anew.
  bool must_begin_anew(Nanoseconds scan_ns) const;

  void forget() { since_ns_.reset(); }

  /// What the newest recovery moved: T_new = delta T_old.
  const YawPose& delta() const { return delta_; }

 private:
  Sighting search(ScanFilter& filter,
                  const Eigen::Vector3d& lidar_position_base_m,
                  const State& predicted,
                  const ErrorMatrix& covariance,
                  const PointCloud& thinned_base);

  MatchingConfig matching_;
  RecoveryConfig config_;
  std::optional<Nanoseconds> since_ns_;  ///< of the first search
  Pose predicted_;
  std::optional<Registration> found_;
  std::string obstacle_;
  YawPose delta_;
};

}  // namespace trigpoint::lio_mapper
