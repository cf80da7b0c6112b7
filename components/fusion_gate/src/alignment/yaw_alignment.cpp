// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// References: [1] B. K. P. Horn, "Closed-form solution of absolute orientation using unit
// quaternions", JOSA A 4 (1987), restricted to rotations about z. [2] P. W. Holland, R. E. Welsch,
// "Robust regression using iteratively reweighted least-squares", 1977 (Cauchy weight). [3] E. B.
// Wilson, M. M. Hilferty, "The distribution of chi-square", PNAS 17 (1931).
#include "alignment/yaw_alignment.hpp"

#include "trigpoint/base/sentence.hpp"
#include "trigpoint/base/so3.hpp"

#include "alignment/median.hpp"
#include <Eigen/Cholesky>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace trigpoint::fusion_gate {

namespace {

using Weights = Eigen::VectorXd;  // one a pair, 1 = fully trusted

// Full trust below (a residual's squared sigmas: 5 % of the good horizontal ones lie above), a
// Cauchy weight [2] of this scale beyond.
constexpr double kTrustedSquaredSigmas = 6.0;
constexpr double kCauchyScale = 3.0;
constexpr double kOutlierWeight = 0.3;  // a residual above 5.2 sigma
constexpr double kMaxOutlierShare = 0.35;
constexpr double kStandardNormal999 = 3.0902;
constexpr int kClosedFormIterations = 15;
constexpr int kMaxIterations = 15;
constexpr double kConverged = 1e-8;  // rad and m
// Yaw lies within half a turn: the only prior, so that one pair alone leaves a regular system.
constexpr double kYawPriorInformation = 1.0 / (std::numbers::pi * std::numbers::pi);

double robust_weight(double squared_sigmas) {
  const double excess = std::max(0.0, squared_sigmas - kTrustedSquaredSigmas);
  return 1.0 / (1.0 + excess / (kCauchyScale * kCauchyScale));
}

/// [1]: minimises sum w |p_map - (R p_odom + t)|^2 over yaw and translation.
/// With a given yaw only the position is asked for.
YawPose closed_form(const std::vector<AlignmentPair>& pairs,
                    const Weights& weights,
                    const std::optional<YawPrior>& heading) {
  Eigen::Vector3d mean_map = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_odom = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const double w = weights[static_cast<Eigen::Index>(k)];
    mean_map += w * pairs[k].p_map_m;
    mean_odom += w * pairs[k].p_odom_m;
  }
  mean_map /= weights.sum();
  mean_odom /= weights.sum();
  double dot = 0.0;
  double cross = 0.0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const double w = weights[static_cast<Eigen::Index>(k)];
    const Eigen::Vector3d a = pairs[k].p_odom_m - mean_odom;
    const Eigen::Vector3d b = pairs[k].p_map_m - mean_map;
    dot += w * (a.x() * b.x() + a.y() * b.y());
    cross += w * (a.x() * b.y() - a.y() * b.x());
  }
  const double yaw_rad = heading ? heading->yaw_rad : std::atan2(cross, dot);
  return {yaw_rad, mean_map - from_yaw(yaw_rad) * mean_odom};
}

using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

/// What is solved for: a grid's scale concerns east and north only.
struct ScaledPose {
  YawPose T;
  double scale{1.0};

  Eigen::Vector3d scaled(const Eigen::Vector3d& p_odom_m) const {
    return {scale * p_odom_m.x(), scale * p_odom_m.y(), p_odom_m.z()};
  }
};

Eigen::Vector3d residual_of(const AlignmentPair& pair, const Pose& T_map_odom) {
  return pair.p_map_m - T_map_odom * pair.p_odom_m;
}

Eigen::Vector3d residual_of(const AlignmentPair& pair, const ScaledPose& estimate) {
  return pair.p_map_m - estimate.T.pose() * estimate.scaled(pair.p_odom_m);
}

/// A start that a few wild fixes cannot turn: weights from the residuals' own median.
YawPose robust_closed_form(const std::vector<AlignmentPair>& pairs,
                           const std::optional<YawPrior>& heading) {
  Weights base(static_cast<Eigen::Index>(pairs.size()));
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    base[static_cast<Eigen::Index>(k)] = 1.0 / pairs[k].variance_map_m2.head<2>().sum();
  }
  Weights weights = base;
  YawPose estimate = closed_form(pairs, weights, heading);
  for (int iteration = 0; iteration < kClosedFormIterations; ++iteration) {
    const Pose T_map_odom = estimate.pose();
    std::vector<double> squared_sigmas;
    for (const AlignmentPair& pair : pairs) {
      squared_sigmas.push_back(residual_of(pair, T_map_odom).head<2>().squaredNorm() /
                               pair.variance_map_m2.head<2>().sum());
    }
    const double scale = std::max(1.0, median(squared_sigmas));
    for (Eigen::Index k = 0; k < weights.size(); ++k) {
      weights[k] = base[k] * robust_weight(squared_sigmas[static_cast<std::size_t>(k)] / scale);
    }
    estimate = closed_form(pairs, weights, heading);
  }
  return estimate;
}

double drift_variance(const AlignmentPair& pair, double now_m, const AlignmentConfig& config) {
  return config.lio_drift_m_per_sqrt_m * config.lio_drift_m_per_sqrt_m * (now_m - pair.distance_m);
}

using Covariances = std::array<Eigen::MatrixXd, 3>;  // of the residuals, one an axis of map

/// Covariance of the height errors that an unknown tilt of odom gives two pairs. It turns about the
/// newest pair, so that the solution is right where the robot is.
double tilt_covariance_m2(const AlignmentPair& a,
                          const AlignmentPair& b,
                          const AlignmentPair& newest,
                          const AlignmentConfig& config) {
  const Eigen::Vector2d from_newest_a = (a.p_odom_m - newest.p_odom_m).head<2>();
  const Eigen::Vector2d from_newest_b = (b.p_odom_m - newest.p_odom_m).head<2>();
  return config.lio_tilt_sigma_rad * config.lio_tilt_sigma_rad * from_newest_a.dot(from_newest_b);
}

/// Gauss-Markov GPS error, LIO's random walk and what it slid counted back from the newest pair (so
/// that the solution is T_map_odom as of now), tilt of odom, and white error. The slide of an axis
/// of odom is counted along east and north as if these were independent.
Covariances residual_covariances(const std::vector<AlignmentPair>& pairs,
                                 const AlignmentConfig& config,
                                 double yaw_rad) {
  const auto n = static_cast<Eigen::Index>(pairs.size());
  const double now_m = pairs.back().distance_m;
  Covariances covariances;
  covariances.fill(Eigen::MatrixXd(n, n));
  const Eigen::Matrix3d map_from_odom2 = from_yaw(yaw_rad).toRotationMatrix().cwiseAbs2();
  for (Eigen::Index i = 0; i < n; ++i) {
    const AlignmentPair& a = pairs[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j <= i; ++j) {
      const AlignmentPair& b = pairs[static_cast<std::size_t>(j)];
      const double age_s = std::abs(to_seconds(a.stamp_ns - b.stamp_ns));
      const double share = config.correlated_share * std::exp(-age_s / config.correlation_time_s) +
                           (i == j ? config.white_share : 0.0);
      const double drift_m2 =
          std::min(drift_variance(a, now_m, config), drift_variance(b, now_m, config));
      const Eigen::Vector3d slid_m2 =
          map_from_odom2 * a.slide.variance_m2().cwiseMin(b.slide.variance_m2());
      for (int axis = 0; axis < 3; ++axis) {
        const double value = share * std::sqrt(a.variance_map_m2[axis] * b.variance_map_m2[axis]);
        const double tilt_m2 = axis == 2 ? tilt_covariance_m2(a, b, pairs.back(), config) : 0.0;
        const double sum_m2 = value + drift_m2 + slid_m2[axis] + tilt_m2;
        covariances[static_cast<std::size_t>(axis)](i, j) = sum_m2;
        covariances[static_cast<std::size_t>(axis)](j, i) = sum_m2;
      }
    }
  }
  return covariances;
}

/// Order yaw, x, y, z, scale.
struct Linearised {
  Matrix5d information{Matrix5d::Zero()};
  Vector5d gradient{Vector5d::Zero()};
  double chi_square{0.0};
};

struct RobustWeights {
  Weights horizontal;
  Weights vertical;
};

RobustWeights weigh(const std::vector<AlignmentPair>& pairs,
                    const ScaledPose& estimate,
                    const Covariances& covariances) {
  const auto n = static_cast<Eigen::Index>(pairs.size());
  RobustWeights weights{Weights(n), Weights(n)};
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Vector3d r = residual_of(pairs[static_cast<std::size_t>(k)], estimate);
    const Eigen::Vector3d variance_m2(
        covariances[0](k, k), covariances[1](k, k), covariances[2](k, k));
    const Eigen::Vector3d squared_sigmas = r.cwiseAbs2().cwiseQuotient(variance_m2);
    weights.horizontal[k] = robust_weight(squared_sigmas.head<2>().sum());
    weights.vertical[k] = robust_weight(squared_sigmas.z());
  }
  return weights;
}

using Factor = Eigen::LLT<Eigen::MatrixXd>;

Linearised linearise(const std::vector<AlignmentPair>& pairs,
                     const ScaledPose& estimate,
                     double scale_sigma,
                     const std::array<Factor, 3>& factors) {
  const auto n = static_cast<Eigen::Index>(pairs.size());
  const Eigen::Quaterniond q_map_odom = estimate.T.pose().q;
  Linearised result;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::VectorXd r(n);
    Eigen::Matrix<double, Eigen::Dynamic, 5> jacobian =  // of the prediction
        Eigen::Matrix<double, Eigen::Dynamic, 5>::Zero(n, 5);
    for (Eigen::Index k = 0; k < n; ++k) {
      const AlignmentPair& pair = pairs[static_cast<std::size_t>(k)];
      const Eigen::Vector3d turned = q_map_odom * estimate.scaled(pair.p_odom_m);
      r[k] = residual_of(pair, estimate)[axis];
      jacobian(k, 0) = Eigen::Vector3d::UnitZ().cross(turned)[axis];
      jacobian(k, 1 + axis) = 1.0;
      if (scale_sigma > 0.0 && axis < 2) {
        jacobian(k, 4) = turned[axis] / estimate.scale;
      }
    }
    const Factor& factor = factors[static_cast<std::size_t>(axis)];
    const Eigen::Matrix<double, Eigen::Dynamic, 5> whitened = factor.matrixL().solve(jacobian);
    const Eigen::VectorXd whitened_r = factor.matrixL().solve(r);
    result.information += whitened.transpose() * whitened;
    result.gradient += whitened.transpose() * whitened_r;
    result.chi_square += whitened_r.squaredNorm();
  }
  result.information(0, 0) += kYawPriorInformation;
  // The prior, or for a scale that is not asked for a unit row that leaves it at 1.
  const double scale_information = scale_sigma > 0.0 ? 1.0 / (scale_sigma * scale_sigma) : 1.0;
  result.information(4, 4) += scale_information;
  result.gradient[4] -= scale_information * (estimate.scale - 1.0);
  return result;
}

/// A distrusted pair gets as much more white error as it needs to weigh what its weight says.
std::array<Factor, 3> factorise(const Covariances& covariances, const RobustWeights& weights) {
  std::array<Factor, 3> factors;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Weights& w = axis < 2 ? weights.horizontal : weights.vertical;
    Eigen::MatrixXd covariance = covariances[axis];
    const Eigen::ArrayXd total_m2 = covariances[axis].diagonal().array();
    covariance.diagonal().array() += total_m2 * (1.0 / w.array() - 1.0);
    factors[axis].compute(covariance);
  }
  return factors;
}

double horizontal_extent(const std::vector<AlignmentPair>& pairs) {
  Eigen::Vector2d lowest = pairs.front().p_odom_m.head<2>();
  Eigen::Vector2d highest = lowest;
  for (const AlignmentPair& pair : pairs) {
    lowest = lowest.cwiseMin(pair.p_odom_m.head<2>());
    highest = highest.cwiseMax(pair.p_odom_m.head<2>());
  }
  return (highest - lowest).norm();
}

/// [3], of the probability below so many sigmas of the standard normal variable.
double chi_square_quantile(double degrees_of_freedom, double standard_normal) {
  const double v = 2.0 / (9.0 * degrees_of_freedom);
  return degrees_of_freedom * std::pow(1.0 - v + standard_normal * std::sqrt(v), 3.0);
}

/// By what the stated variances are wrong, as the residuals tell (the a-posteriori variance
/// factor). Above 1 as it is; below 1 only as far as 95 % of all samples would allow, and not below
/// `least`.
double variance_factor(double chi_square, double degrees_of_freedom, double least) {
  constexpr double kStandardNormal005 = -1.6449;
  const double factor = chi_square / degrees_of_freedom;
  const double at_most = chi_square / chi_square_quantile(degrees_of_freedom, kStandardNormal005);
  return factor > 1.0 ? factor : std::clamp(at_most, least, 1.0);
}

struct Received {
  double factor{1.0};       // by what the pairs' variances are too small for it
  double variance_m2{0.0};  // of one axis
  double said_m2{0.0};      // the same as it says
};

/// The same of the receiver's own fixes, by the median of their residuals: coarse ones, on a grid
/// of a metre say, are as coarse as they lie about the way, however small and smooth they are in
/// what the filter makes of them.
Received received_of(const std::vector<AlignmentPair>& pairs, const ScaledPose& estimate) {
  constexpr std::size_t kLeast = 2;
  if (pairs.size() < kLeast) {
    return {};
  }
  std::vector<double> squares_m2;
  std::vector<double> squared_sigmas;
  std::vector<double> claims_m2;
  for (const AlignmentPair& pair : pairs) {
    claims_m2.push_back(pair.said_m2);
    const Eigen::Vector2d off_m = residual_of(pair, estimate).head<2>() + pair.received_off_m;
    squares_m2.push_back(off_m.squaredNorm());
    squared_sigmas.push_back(off_m.cwiseAbs2().cwiseQuotient(pair.variance_map_m2.head<2>()).sum());
  }
  const bool are_pairs = std::all_of(pairs.begin(), pairs.end(), [](const AlignmentPair& pair) {
    return pair.received_off_m.isZero();
  });
  constexpr double kSolvedFor = 1.5;  // of pairs: yaw, x and y of two axes each
  return {are_pairs ? 1.0 : variance_of_squares(squared_sigmas, kSolvedFor),
          variance_of_squares(squares_m2, kSolvedFor),
          median(claims_m2)};
}

double least_share_of(const std::vector<AlignmentPair>& pairs) {
  double sum = 0.0;
  for (const AlignmentPair& pair : pairs) {
    sum += pair.least_share;
  }
  return std::min(1.0, sum / static_cast<double>(pairs.size()));
}

Matrix5d information_of(const std::optional<YawPrior>& heading) {
  Matrix5d information = Matrix5d::Zero();
  if (heading) {
    information(0, 0) = 1.0 / (heading->sigma_rad * heading->sigma_rad);
  }
  return information;
}

double outlier_share_of(const RobustWeights& weights) {
  const auto outliers =
      (weights.horizontal.array().min(weights.vertical.array()) < kOutlierWeight).count();
  return static_cast<double>(outliers) / static_cast<double>(weights.horizontal.size());
}

}  // namespace

double AlignmentSolution::yaw_sigma_rad() const {
  return std::sqrt(covariance(0, 0));
}

std::optional<AlignmentSolution> solve_alignment(const std::vector<AlignmentPair>& pairs,
                                                 const AlignmentConfig& config,
                                                 double scale_sigma,
                                                 const std::optional<YawPrior>& heading) {
  if (pairs.empty()) {
    return std::nullopt;
  }
  const Matrix5d by_heading = information_of(heading);
  ScaledPose estimate{robust_closed_form(pairs, heading)};
  const Covariances covariances = residual_covariances(pairs, config, estimate.T.yaw_rad);
  double off_heading_rad = 0.0;
  Linearised system;
  RobustWeights weights;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    weights = weigh(pairs, estimate, covariances);
    system = linearise(pairs, estimate, scale_sigma, factorise(covariances, weights));
    off_heading_rad = heading ? wrap_angle(heading->yaw_rad - estimate.T.yaw_rad) : 0.0;
    const Vector5d gradient = system.gradient + by_heading.col(0) * off_heading_rad;
    const Vector5d step = (system.information + by_heading).ldlt().solve(gradient);
    estimate = {{wrap_angle(estimate.T.yaw_rad + step[0]), estimate.T.p + step.segment<3>(1)},
                estimate.scale + step[4]};
    if (!step.allFinite() || step.norm() < kConverged) {
      break;
    }
  }
  AlignmentSolution solution;
  solution.T_map_odom = estimate.T;
  solution.scale = estimate.scale;
  solution.pairs = pairs.size();
  solution.baseline_m = horizontal_extent(pairs);
  const double dof =
      std::max(1.0, 3.0 * static_cast<double>(pairs.size()) - 4.0 + (heading ? 1.0 : 0.0));
  solution.chi_square = system.chi_square + by_heading(0, 0) * off_heading_rad * off_heading_rad;
  solution.chi_square_limit =
      config.residual_tolerance * chi_square_quantile(dof, kStandardNormal999);
  solution.outlier_share = outlier_share_of(weights);
  const Received received = received_of(pairs, estimate);
  double factor = variance_factor(solution.chi_square, dof, least_share_of(pairs));
  solution.received_m2 = received.variance_m2;
  solution.said_m2 = received.said_m2;
  if (received.factor > 1.0) {
    factor = std::max(factor, received.factor);
  }
  const Matrix5d information = system.information / factor + by_heading;  // not of its own
  const Matrix5d covariance = information.ldlt().solve(Matrix5d::Identity());
  solution.covariance = covariance.topLeftCorner<4, 4>();
  if (scale_sigma > 0.0) {
    solution.scale_covariance = covariance.col(4);
  }
  const bool finite = estimate.T.pose().is_finite() && covariance.allFinite();
  return finite ? std::optional(solution) : std::nullopt;
}

std::optional<std::string> find_obstacle(const AlignmentSolution& solution,
                                         const AlignmentConfig& config) {
  if (solution.pairs < static_cast<std::size_t>(config.min_pairs)) {
    return sentence("%.0f matched fixes of %.0f needed",
                    static_cast<double>(solution.pairs),
                    static_cast<double>(config.min_pairs));
  }
  if (solution.baseline_m < config.min_baseline_m) {
    return sentence("baseline %.1f m < %.1f m", solution.baseline_m, config.min_baseline_m);
  }
  if (solution.outlier_share > kMaxOutlierShare) {
    return sentence("share of outliers %.2f > %.2f", solution.outlier_share, kMaxOutlierShare);
  }
  if (solution.chi_square > solution.chi_square_limit) {
    return sentence("chi-square %.1f > %.1f", solution.chi_square, solution.chi_square_limit);
  }
  if (!(solution.yaw_sigma_rad() < config.max_yaw_sigma_rad)) {
    constexpr double kDegrees = 180.0 / std::numbers::pi;
    return sentence("yaw sigma %.2f deg, needs < %.2f deg",
                    solution.yaw_sigma_rad() * kDegrees,
                    config.max_yaw_sigma_rad * kDegrees);
  }
  return std::nullopt;
}

}  // namespace trigpoint::fusion_gate
