// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/fusion_gate/config.hpp"

#include "checks/displacement.hpp"

#include <optional>

namespace trigpoint::fusion_gate {

/// After a silence of GPS: does T_map_odom's own covariance know how far LIO slid meanwhile? A
/// mapper that holds itself for certain gives rows no weight, however well the fixes agree.
class Settling {
 public:
  explicit Settling(const Config& config) : config_(config) {}

  /// Fixes came back.
  void begin();

  void end() { is_open_ = false; }

  /// What was gathered does not count: a fix was doubted, or LIO slides on.
  void interrupt();

  /// `off_by`: a trusted fix against T_map_odom, with the covariance that the mapper admits. Once
  /// enough agree the question is answered: their mean, if it contradicts that covariance.
  std::optional<Eigen::Vector3d> add(Nanoseconds stamp_ns, const Difference& off_by);

 private:
  Config config_;
  bool is_open_{false};
  Nanoseconds first_ns_{0};
  std::int64_t count_{0};
  Eigen::Vector3d sum_map_m_{Eigen::Vector3d::Zero()};
};

}  // namespace trigpoint::fusion_gate
