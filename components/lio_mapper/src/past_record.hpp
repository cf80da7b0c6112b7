// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a mapper remembers of its past, and when that is worth correcting.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/lio_mapper/past.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// Poses and rows only, some hundred bytes each; clouds while a correction is under way.
class PastRecord {
 public:
  PastRecord(const PastConfig& config, const GraphInput& earlier);

  void on_scan(const OdomSample& sample);
  void on_keyframe(const GraphKeyframe& keyframe);
  /// `T_map_odom` after the row, `p_odom_m` of the robot.
  void on_row(const StoredRow& row, const YawPose& T_map_odom, const Eigen::Vector3d& p_odom_m);
  void on_new_epoch();
  void on_inserted(PointCloud points_odom);

  /// Why the past should be corrected now.
  std::optional<std::string> due() const;

  PastSnapshot snapshot(const Config& config);

  /// False when the epoch has ended since the snapshot, or it is too long ago.
  bool is_current(const PastSnapshot& snapshot) const {
    return keeping_ && began_ns_ == snapshot.stamp_ns;
  }

  std::vector<PointCloud> take_inserted();
  void conclude();
  void conclude(const PastSnapshot& snapshot, const CorrectedPast& past, const Pose& T_odom_frame);

 private:
  struct Place {
    bool in_map{false};
    Eigen::Vector3d p_m{Eigen::Vector3d::Zero()};
    double driven_m{0.0};
  };

  Place place_of(const GraphKeyframe& keyframe) const;
  bool was_here_before() const;
  void judge_revisit(double step_m);
  bool gps_has_returned() const;
  bool may_begin() const;

  PastConfig config_;
  GraphInput input_;
  std::vector<Place> places_;  ///< of the keyframes, as far as corrected
  std::vector<Loop> loops_;    ///< registered in earlier corrections
  std::size_t searched_{0};    ///< keyframes among which loops were looked for
  Pose T_frame_odom_;          ///< of the last correction, for epochs without alignment
  bool overwritten_{false};    ///< rows have moved odom itself

  std::optional<Nanoseconds> began_ns_;
  Nanoseconds newest_row_ns_{0};
  Pose T_map_odom_;  ///< after the newest row
  Eigen::Vector3d p_odom_m_{Eigen::Vector3d::Zero()};
  std::optional<Nanoseconds> returned_ns_;  ///< first row after an outage
  Pose T_map_odom_before_outage_;
  double revisit_m_{0.0};       ///< driven near an earlier visit
  double apart_m_{0.0};         ///< driven since without one
  double corrected_at_m_{0.0};  ///< of revisit_m_

  bool keeping_{false};
  std::vector<PointCloud> inserted_;  ///< since the snapshot or the last take_inserted()
};

}  // namespace trigpoint::lio_mapper
