// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/displacement.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::fusion_gate {

namespace {

constexpr double kMostSigmas = 1e3;

/// s with erfc(s / sqrt 2) = exp(-q / 2), the tail of chi-square with 2 degrees of freedom, by
/// bisection; far out, where erfc underflows, only the order matters.
double sigmas_of_chi_square_2(double q) {
  const double log_tail = -0.5 * q;
  if (log_tail < -30.0) {
    return std::min(kMostSigmas, std::sqrt(q));
  }
  double low = 0.0;
  double high = 8.0;
  for (int step = 0; step < 50; ++step) {
    const double middle = 0.5 * (low + high);
    const bool too_likely = std::log(std::erfc(middle / std::numbers::sqrt2)) > log_tail;
    (too_likely ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// sqrt(d^T C^-1 d) of the part.
double mahalanobis(const Difference& difference, Part part) {
  if (part == Part::kHeight) {
    return std::abs(difference.d_map_m.z()) / std::sqrt(difference.covariance_m2(2, 2));
  }
  const Eigen::Vector2d d = difference.d_map_m.head<2>();
  const Eigen::Matrix2d C = difference.covariance_m2.topLeftCorner<2, 2>();
  return std::sqrt(std::max(0.0, d.dot(C.llt().solve(d))));
}

}  // namespace

double sigmas_of(const Difference& difference, Part part) {
  const double distance = mahalanobis(difference, part);
  return part == Part::kHeight ? distance : sigmas_of_chi_square_2(distance * distance);
}

double size_of(const Difference& difference, Part part) {
  return part == Part::kHeight ? std::abs(difference.d_map_m.z())
                               : difference.d_map_m.head<2>().norm();
}

double permitted_m(const Difference& difference, Part part, double sigmas) {
  const double worth = sigmas_of(difference, part);
  return worth > 0.0 ? size_of(difference, part) * sigmas / worth : 0.0;
}

Eigen::Vector3d lio_drift_variance_m2(const Eigen::Vector3d& blind_m,
                                      double distance_m,
                                      const Config& config) {
  const double walk = config.smooth.lio_drift_m_per_sqrt_m;
  const double share_m = config.smooth.lio_drift_share * distance_m;
  const double held_m2 = std::max(walk * walk * distance_m, share_m * share_m);
  return Eigen::Vector3d(blind_m.cwiseAbs2().array() + held_m2);
}

Difference compare_displacement(const Sighting& from,
                                const Sighting& to,
                                const LioStatus& lio,
                                const Config& config) {
  const Eigen::Matrix3d R_map_odom = lio.T_map_odom.pose().q.toRotationMatrix();
  const Eigen::Vector3d moved_map_m = R_map_odom * (to.lio_odom_m - from.lio_odom_m);
  const double distance_m = std::abs(to.distance_m - from.distance_m);
  const Eigen::Vector3d drift_m2 =
      lio_drift_variance_m2((to.blind_m - from.blind_m).cwiseAbs(), distance_m, config);
  // A random walk of yaw over d moves its end by sqrt(q d^3 / 3).
  const double yaw_walk = config.smooth.lio_yaw_drift_rad_per_sqrt_m;
  const double yaw_m2 = lio.T_map_odom_covariance(0, 0) + yaw_walk * yaw_walk * distance_m / 3.0;
  const double tilt_m2 = lio.T_map_odom_covariance.diagonal().tail<2>().maxCoeff() *
                         moved_map_m.head<2>().squaredNorm();
  const Eigen::Vector3d by_yaw = Eigen::Vector3d::UnitZ().cross(moved_map_m);

  Difference result;
  result.d_map_m = to.gps_map_m - from.gps_map_m - moved_map_m;
  result.covariance_m2 = R_map_odom * drift_m2.asDiagonal() * R_map_odom.transpose() +
                         yaw_m2 * by_yaw * by_yaw.transpose();
  result.covariance_m2.diagonal() += from.gps_variance_m2 + to.gps_variance_m2;
  result.covariance_m2(2, 2) += tilt_m2;
  return result;
}

}  // namespace trigpoint::fusion_gate
