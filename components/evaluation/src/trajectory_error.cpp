// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/trajectory_error.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace trigpoint::evaluation {

namespace {

constexpr double kErrorDegrees = 180.0 / std::numbers::pi;
/// A spread of positions below this (m, rms) does not tell a direction.
constexpr double kSmallestSpread_m = 1e-3;

using Points = Eigen::Matrix3Xd;

Points positions(const std::vector<PosePair>& pairs, Pose PosePair::*side) {
  Points points(3, static_cast<Eigen::Index>(pairs.size()));
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    points.col(static_cast<Eigen::Index>(i)) = (pairs[i].*side).p;
  }
  return points;
}

/// Root mean square extent along the strongest directions, in descending order.
Eigen::VectorXd spreads(const Points& points) {
  const Points centred = points.colwise() - points.rowwise().mean();
  const Eigen::Matrix3d scatter =
      centred * centred.transpose() / static_cast<double>(points.cols());
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(scatter);
  return svd.singularValues().cwiseSqrt();
}

/// Closed form: with centred positions e, r the sum |r - Rz(yaw) e|^2 is smallest where
/// tan(yaw) = sum(e x r)_z / sum(e . r)_xy, [2] section III.
std::optional<Pose> align_yaw(const Points& estimate, const Points& reference) {
  const Eigen::Vector3d mean_estimate = estimate.rowwise().mean();
  const Eigen::Vector3d mean_reference = reference.rowwise().mean();
  const auto e = (estimate.colwise() - mean_estimate).eval();
  const auto r = (reference.colwise() - mean_reference).eval();
  const double horizontal_m2 = e.topRows<2>().squaredNorm() / static_cast<double>(e.cols());
  if (!(horizontal_m2 > kSmallestSpread_m * kSmallestSpread_m)) {
    return std::nullopt;
  }
  const double sine = e.row(0).dot(r.row(1)) - e.row(1).dot(r.row(0));
  const double cosine = e.row(0).dot(r.row(0)) + e.row(1).dot(r.row(1));
  const Eigen::Quaterniond q = from_yaw(std::atan2(sine, cosine));
  return Pose(q, mean_reference - q * mean_estimate);
}

std::optional<Pose> align_se3(const Points& estimate, const Points& reference) {
  if (!(spreads(estimate)[1] > kSmallestSpread_m)) {
    return std::nullopt;  // on a line: the roll about it is free
  }
  constexpr bool kWithScale = false;
  const Eigen::Matrix4d T = Eigen::umeyama(estimate, reference, kWithScale);
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  return Pose(Eigen::Quaterniond(R).normalized(), T.topRightCorner<3, 1>());
}

/// [3]: distances along the reference from the first pair.
std::vector<double> distances_along(const std::vector<PosePair>& pairs, const Breaks& breaks) {
  std::vector<double> distances(pairs.size(), 0.0);
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    const bool driven = !is_between(breaks, pairs[i - 1].stamp_ns, pairs[i].stamp_ns);
    distances[i] = distances[i - 1] +
                   (driven ? (pairs[i].reference.p - pairs[i - 1].reference.p).norm() : 0.0);
  }
  return distances;
}

/// Motion of the estimate seen from the motion of the reference, [1] RPE and [3].
Pose motion_error(const PosePair& from, const PosePair& to) {
  const Pose reference = from.reference.inverse() * to.reference;
  const Pose estimate = from.estimate.inverse() * to.estimate;
  return reference.inverse() * estimate;
}

using SegmentError = std::function<Eigen::Vector2d(const PosePair& from, const PosePair& to)>;

/// `error` returns metres and degrees of one segment.
RelativeError mean_over_segments(const std::vector<PosePair>& pairs,
                                 double length_m,
                                 const Breaks& breaks,
                                 const SegmentError& error) {
  RelativeError result;
  result.length_m = length_m;
  const auto distances = distances_along(pairs, breaks);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  std::size_t to = 0;
  for (std::size_t from = 0; from < pairs.size(); ++from) {
    while (to < pairs.size() && distances[to] - distances[from] < length_m) {
      ++to;
    }
    if (to == pairs.size()) {
      break;
    }
    if (is_between(breaks, pairs[from].stamp_ns, pairs[to].stamp_ns)) {
      continue;
    }
    sum += error(pairs[from], pairs[to]);
    ++result.segments;
  }
  if (result.segments > 0) {
    sum /= static_cast<double>(result.segments) * length_m;
    result.translation_percent = 100.0 * sum[0];
    result.rotation_deg_per_m = sum[1];
  }
  return result;
}

double angle_deg(const Eigen::Quaterniond& q) {
  return so3_log(q).norm() * kErrorDegrees;
}

}  // namespace

std::string name_of(AlignmentKind kind) {
  switch (kind) {
    case AlignmentKind::kNone:
      return "none";
    case AlignmentKind::kYawTranslation:
      return "yaw + translation";
    case AlignmentKind::kSe3:
      break;
  }
  return "SE(3)";
}

std::optional<Pose> align(const std::vector<PosePair>& pairs, AlignmentKind kind) {
  if (kind == AlignmentKind::kNone) {
    return Pose{};
  }
  const std::size_t fewest = kind == AlignmentKind::kYawTranslation ? 2 : 3;
  if (pairs.size() < fewest) {
    return std::nullopt;
  }
  const Points estimate = positions(pairs, &PosePair::estimate);
  const Points reference = positions(pairs, &PosePair::reference);
  return kind == AlignmentKind::kYawTranslation ? align_yaw(estimate, reference)
                                                : align_se3(estimate, reference);
}

std::vector<PosePair> place_estimates(const Pose& T_reference_estimate,
                                      std::vector<PosePair> pairs) {
  for (auto& pair : pairs) {
    pair.estimate = T_reference_estimate * pair.estimate;
  }
  return pairs;
}

Statistics statistics_of(std::vector<double> values) {
  if (values.empty()) {
    return {0, kNaN, kNaN, kNaN, kNaN, kNaN, kNaN};
  }
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (double& value : values) {
    value = std::abs(value);
    sum += value;
    sum_of_squares += value * value;
  }
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  const auto count = static_cast<double>(n);
  const double mean = sum / count;
  double sum_about_mean = 0.0;
  for (const double value : values) {
    sum_about_mean += (value - mean) * (value - mean);
  }
  return {n,
          std::sqrt(sum_of_squares / count),
          mean,
          0.5 * (values[(n - 1) / 2] + values[n / 2]),
          values.back(),
          values.front(),
          std::sqrt(sum_about_mean / count)};
}

AbsoluteError absolute_error(const std::vector<PosePair>& pairs) {
  std::vector<double> position;
  std::vector<double> horizontal;
  std::vector<double> rotation;
  std::array<std::vector<double>, 3> axes;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& pair : pairs) {
    const Eigen::Vector3d error = pair.estimate.p - pair.reference.p;
    position.push_back(error.norm());
    horizontal.push_back(error.head<2>().norm());
    rotation.push_back(angle_deg(pair.reference.q.conjugate() * pair.estimate.q));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      axes[axis].push_back(error[static_cast<Eigen::Index>(axis)]);
    }
    sum += error;
  }
  AbsoluteError result;
  result.position_m = statistics_of(position);
  result.horizontal_m = statistics_of(horizontal);
  result.rotation_deg = statistics_of(rotation);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.axes_m[axis] = statistics_of(axes[axis]);
  }
  if (!pairs.empty()) {
    result.bias_m = sum / static_cast<double>(pairs.size());
  }
  return result;
}

bool is_between(const Breaks& breaks, Nanoseconds before_ns, Nanoseconds after_ns) {
  const auto next = std::upper_bound(breaks.begin(), breaks.end(), before_ns);
  return next != breaks.end() && *next <= after_ns;
}

RelativeError relative_error(const std::vector<PosePair>& pairs,
                             double length_m,
                             const Breaks& breaks) {
  const auto error_of = [](const PosePair& from, const PosePair& to) {
    const Pose error = motion_error(from, to);
    return Eigen::Vector2d(error.p.norm(), angle_deg(error.q));
  };
  return mean_over_segments(pairs, length_m, breaks, error_of);
}

RelativeError relative_position_error(const std::vector<PosePair>& aligned_pairs,
                                      double length_m,
                                      const Breaks& breaks) {
  const auto error_of = [](const PosePair& from, const PosePair& to) {
    const Eigen::Vector3d reference = to.reference.p - from.reference.p;
    const Eigen::Vector3d estimate = to.estimate.p - from.estimate.p;
    return Eigen::Vector2d((estimate - reference).norm(), kNaN);
  };
  return mean_over_segments(aligned_pairs, length_m, breaks, error_of);
}

EndToEnd end_to_end(const std::vector<PosePair>& pairs, const Breaks& breaks) {
  if (pairs.size() < 2) {
    return {};
  }
  const Pose error = motion_error(pairs.front(), pairs.back());
  EndToEnd result;
  result.error_m = error.p.norm();
  result.error_deg = angle_deg(error.q);
  result.distance_m = distances_along(pairs, breaks).back();
  if (result.distance_m > 0.0) {
    result.percent = 100.0 * result.error_m / result.distance_m;
  }
  return result;
}

double length_of(const Trajectory& trajectory, const Breaks& breaks) {
  double length_m = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    if (!is_between(breaks, trajectory[i - 1].stamp_ns, trajectory[i].stamp_ns)) {
      length_m += (trajectory[i].pose.p - trajectory[i - 1].pose.p).norm();
    }
  }
  return length_m;
}

}  // namespace trigpoint::evaluation
