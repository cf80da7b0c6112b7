// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/heading.hpp"

#include "alignment/pose_buffer.hpp"
#include "alignment/yaw_alignment.hpp"

#include <deque>
#include <optional>

namespace trigpoint::fusion_gate {

/// What measured headings say about the yaw of T_map_odom, by LIO's attitude at their stamps.
class HeadingPrior {
 public:
  /// A heading; no more than one in 0.5 s is kept, and those that LIO never covers are forgotten.
  void hear(const Heading& heading);

  /// Takes the headings whose stamps LIO covers by now.
  void match(const PoseBuffer& lio_poses);

  void clear();

  /// The median of the newest 30 s; nullopt for less than five. Sigma is the median of the reported
  /// ones or, where it is larger, the scatter (1.4826 times the median of the absolute deviations).
  /// It does not shrink with their number: iron, declination and mounting do not average out.
  std::optional<YawPrior> prior() const;

 private:
  struct Sighting {
    Nanoseconds stamp_ns;
    double yaw_map_odom_rad;
    double sigma_rad;
  };

  std::deque<Heading> waiting_;
  std::deque<Sighting> sightings_;
};

}  // namespace trigpoint::fusion_gate
