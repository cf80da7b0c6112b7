// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How an estimate fares while its sensors lie, when they come back, and whether its covariance is
// honest. When and how they lied is known of simulated drives only.
#pragma once

#include "trigpoint/base/pose.hpp"
#include "trigpoint/evaluation/continuity.hpp"
#include "trigpoint/evaluation/trajectory_error.hpp"

#include <optional>
#include <utility>
#include <vector>

namespace trigpoint::evaluation {

/// Largest position error inside the windows (borders excluded); nullopt without a pair in them.
std::optional<double> worst_error_m(const std::vector<PosePair>& pairs,
                                    const std::vector<Window>& windows);

/// Root mean square of the same.
std::optional<double> rms_error_m(const std::vector<PosePair>& pairs,
                                  const std::vector<Window>& windows);

/// Seconds from `from_ns` to the first pair from which on the position error stays within
/// `within_m` for `hold_ns` (or to the last pair, if that is a full hold away or less); nullopt
/// when it never does.
std::optional<double> time_to_return_s(const std::vector<PosePair>& pairs,
                                       Nanoseconds from_ns,
                                       double within_m,
                                       Nanoseconds hold_ns = kNanosecondsPerSecond);

/// Largest excess of |error along `axis`| over `share` times the distance that the reference has
/// driven since `from_ns`; nullopt without a pair since then. Negative: always below.
std::optional<double> excess_over_distance_m(const std::vector<PosePair>& pairs,
                                             Nanoseconds from_ns,
                                             Eigen::Index axis,
                                             double share);

/// One wrong fix that was delivered, in order of time, and whether it moved the estimate.
using WrongFix = std::pair<Nanoseconds, bool>;

/// How a gate fared against a stretch of wrong fixes.
struct GateClosing {
  std::size_t delivered{0};
  std::size_t used{0};  ///< of them, at any time of the stretch: a gate that reopens pays for it
  double last_used_s{0.0};  ///< from the stretch's first fix to the last one used; 0 = none, or it
};

GateClosing gate_closing(const std::vector<WrongFix>& stretch);

/// Largest distance between the positions of `trajectory` and `reference` (interpolated), at
/// moments outside the windows; nullopt when there is no common one.
std::optional<double> largest_difference_m(const Trajectory& trajectory,
                                           const Trajectory& reference,
                                           const std::vector<Window>& excluded);

/// Normalised estimation error squared, per degree of freedom (1 = honest on average): e^T P^-1 e /
/// n with e = (p_est - p_ref, log(q_est q_ref^-1)), both in the parent frame, as PoseCovariance is
/// ordered (Y. Bar-Shalom, X.-R. Li, T. Kirubarajan, Estimation with Applications to Tracking and
/// Navigation, 2001, 5.4.2). NaN when P is not positive definite.
struct Nees {
  double pose{0.0};      ///< n = 6
  double position{0.0};  ///< n = 3
};

Nees nees_of(const Pose& estimate, const PoseCovariance& covariance, const Pose& reference);

}  // namespace trigpoint::evaluation
