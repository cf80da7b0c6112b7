// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/fault_scores.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

namespace trigpoint::evaluation {

namespace {

double error_m(const PosePair& pair) {
  return (pair.estimate.p - pair.reference.p).norm();
}

Statistics statistics_inside(const std::vector<PosePair>& pairs,
                             const std::vector<Window>& windows) {
  std::vector<double> errors;
  for (const PosePair& pair : pairs) {
    if (is_inside(windows, pair.stamp_ns)) {
      errors.push_back(error_m(pair));
    }
  }
  return statistics_of(std::move(errors));
}

template <int n>
double nees_per_freedom(const Eigen::Matrix<double, n, 1>& error,
                        const Eigen::Matrix<double, n, n>& covariance) {
  const Eigen::LLT<Eigen::Matrix<double, n, n>> llt(covariance);
  return llt.info() == Eigen::Success ? error.dot(llt.solve(error)) / n : kNaN;
}

}  // namespace

std::optional<double> worst_error_m(const std::vector<PosePair>& pairs,
                                    const std::vector<Window>& windows) {
  const Statistics statistics = statistics_inside(pairs, windows);
  return statistics.count > 0 ? std::optional(statistics.max) : std::nullopt;
}

std::optional<double> rms_error_m(const std::vector<PosePair>& pairs,
                                  const std::vector<Window>& windows) {
  const Statistics statistics = statistics_inside(pairs, windows);
  return statistics.count > 0 ? std::optional(statistics.rmse) : std::nullopt;
}

std::optional<double> time_to_return_s(const std::vector<PosePair>& pairs,
                                       Nanoseconds from_ns,
                                       double within_m,
                                       Nanoseconds hold_ns) {
  std::optional<Nanoseconds> back_ns;
  for (const PosePair& pair : pairs) {
    if (pair.stamp_ns < from_ns) {
      continue;
    }
    if (back_ns && pair.stamp_ns - *back_ns > hold_ns) {
      break;
    }
    if (!(error_m(pair) <= within_m)) {
      back_ns.reset();
    } else if (!back_ns) {
      back_ns = pair.stamp_ns;
    }
  }
  return back_ns ? std::optional(to_seconds(*back_ns - from_ns)) : std::nullopt;
}

std::optional<double> excess_over_distance_m(const std::vector<PosePair>& pairs,
                                             Nanoseconds from_ns,
                                             Eigen::Index axis,
                                             double share) {
  std::optional<double> largest_m;
  std::optional<Eigen::Vector3d> last_m;
  double driven_m = 0.0;
  for (const PosePair& pair : pairs) {
    if (pair.stamp_ns < from_ns) {
      continue;
    }
    driven_m += last_m ? (pair.reference.p - *last_m).norm() : 0.0;
    last_m = pair.reference.p;
    const double excess_m = std::abs((pair.estimate.p - pair.reference.p)[axis]) - share * driven_m;
    largest_m = std::max(largest_m.value_or(excess_m), excess_m);
  }
  return largest_m;
}

GateClosing gate_closing(const std::vector<WrongFix>& stretch) {
  GateClosing closing;
  for (const auto& [stamp_ns, used] : stretch) {
    ++closing.delivered;
    if (used) {
      ++closing.used;
      closing.last_used_s = to_seconds(stamp_ns - stretch.front().first);
    }
  }
  return closing;
}

std::optional<double> largest_difference_m(const Trajectory& trajectory,
                                           const Trajectory& reference,
                                           const std::vector<Window>& excluded) {
  std::optional<double> largest_m;
  for (const StampedPose& pose : trajectory) {
    const auto other =
        is_inside(excluded, pose.stamp_ns) ? std::nullopt : pose_at(reference, pose.stamp_ns);
    if (other) {
      largest_m = std::max(largest_m.value_or(0.0), (pose.pose.p - other->p).norm());
    }
  }
  return largest_m;
}

Nees nees_of(const Pose& estimate, const PoseCovariance& covariance, const Pose& reference) {
  Eigen::Matrix<double, 6, 1> error;
  error << estimate.p - reference.p, so3_log((estimate.q * reference.q.conjugate()).normalized());
  return {nees_per_freedom<6>(error, covariance),
          nees_per_freedom<3>(error.head<3>(), covariance.topLeftCorner<3, 3>())};
}

}  // namespace trigpoint::evaluation
