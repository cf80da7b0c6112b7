// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include "checks/accepted_fix.hpp"
#include "control/algorithm_one.hpp"

#include <optional>

namespace trigpoint::fusion_gate {

/// Variance of a fix, floored at `min_sigma_m` per axis (added on the diagonal: stays positive).
Eigen::Matrix3d floored(const Eigen::Matrix3d& covariance_m2, double min_sigma_m);

/// Makes the rows of a fix: at most one StateUpdate a fix, at the fix's stamp.
class RowMaker {
 public:
  RowMaker(const Config& config, const Eigen::Vector3d& antenna_position_base_m);

  /// The covariance grows by 1 + 2 tau / dt, dt since the last row: n rows of errors with
  /// correlation time tau then weigh as much as the independent ones among them (the variance of
  /// the mean of a first-order Gauss-Markov process over T >> tau is 2 tau / T of the variance of
  /// one).
  StateUpdate make(const AcceptedFix& fix, const AxisChoices& choices);

  /// The statement that carries the first alignment: no rows, because the fix is in the alignment.
  StateUpdate make_alignment(const AcceptedFix& fix, const Alignment& alignment) const;

  double inflation(Nanoseconds fix_stamp_ns) const;

 private:
  StateUpdate describe(const AcceptedFix& fix) const;

  Config config_;
  Eigen::Vector3d lever_arm_base_m_;
  std::optional<Nanoseconds> last_row_ns_;
};

}  // namespace trigpoint::fusion_gate
