// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion/rows.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::fusion_gate {

Eigen::Matrix3d floored(const Eigen::Matrix3d& covariance_m2, double min_sigma_m) {
  Eigen::Matrix3d result = covariance_m2;
  const Eigen::Vector3d lack_m2 =
      (Eigen::Vector3d::Constant(min_sigma_m * min_sigma_m) - covariance_m2.diagonal())
          .cwiseMax(0.0);
  result.diagonal() += lack_m2;
  return result;
}

RowMaker::RowMaker(const Config& config, const Eigen::Vector3d& antenna_position_base_m)
    : config_(config), lever_arm_base_m_(antenna_position_base_m) {}

StateUpdate RowMaker::make(const AcceptedFix& fix, const AxisChoices& choices) {
  StateUpdate update = describe(fix);
  update.inflation = inflation(fix.stamp_ns);
  update.covariance_map_m2 *= update.inflation;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    update.decision[axis] = choices[axis].decision;
  }
  if (any_fused(choices)) {
    last_row_ns_ = std::max(last_row_ns_.value_or(fix.stamp_ns), fix.stamp_ns);
  }
  return update;
}

StateUpdate RowMaker::make_alignment(const AcceptedFix& fix, const Alignment& alignment) const {
  StateUpdate update = describe(fix);
  update.first_alignment = alignment;
  return update;
}

double RowMaker::inflation(Nanoseconds fix_stamp_ns) const {
  if (!last_row_ns_) {
    return 1.0;
  }
  const double interval_s = std::abs(to_seconds(fix_stamp_ns - *last_row_ns_));
  const double factor = 1.0 + 2.0 * config_.gps_correlation_time_s / std::max(interval_s, 1e-3);
  return std::min(factor, config_.max_inflation);
}

StateUpdate RowMaker::describe(const AcceptedFix& fix) const {
  StateUpdate update;
  update.fix_stamp_ns = fix.stamp_ns;
  update.mode =
      mode_of(config_.mode) == Mode::kLiteral ? UpdateMode::kOverwrite : UpdateMode::kRows;
  update.position_map_m = fix.antenna_map_m;
  update.covariance_map_m2 = floored(fix.covariance_map_m2, config_.min_sigma_m);
  update.lever_arm_base_m = lever_arm_base_m_;
  return update;
}

}  // namespace trigpoint::fusion_gate
