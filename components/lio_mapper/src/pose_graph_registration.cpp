// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// References: [1] Y. Chen, G. Medioni, "Object modelling by registration of multiple range images",
// Image and Vision Computing 10(3), 1992. [2] Q.-Y. Zhou, J. Park, V. Koltun, "Fast global
// registration", ECCV 2016 (Geman-McClure weights that narrow).
#include "pose_graph_registration.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

using Eigen::Vector3d;

namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr int kMostSteps = 40;
constexpr double kFirstWidth_m = 0.8;
constexpr double kLastWidth_m = 0.05;
constexpr double kNarrowing = 0.7;
/// Steps this much smaller than the noise, in sigmas, are no longer taken: along a direction that
/// surfaces leave free, planes that come and go keep the cloud trembling.
constexpr double kConverged2 = 0.01;
constexpr double kNear_m = 0.1;
constexpr double kPointSigma_m = 0.03;
/// Neighbouring points share the map's errors (as within matching.patch_m).
constexpr double kIndependent = 100.0;
constexpr double kStartSigma_m = 1.0;
constexpr double kStartSigma_rad = 0.05;
/// However well the points agree: the map of the other visit bends within its length.
constexpr double kFloor_m = 0.015;
constexpr double kFloor_rad = 1e-3;
constexpr std::size_t kFewestMatches = 150;

struct Sums {
  Matrix6d information{Matrix6d::Zero()};
  Vector6d gradient{Vector6d::Zero()};
  std::size_t matched{0};
  std::size_t near{0};
};

Sums sums_at(const std::vector<Vector3d>& points_m,
             const LocalMap& map,
             const Pose& T,
             double width_m) {
  Sums sums;
  PlaneMatch plane;
  for (const Vector3d& point : points_m) {
    const Vector3d rotated = T.q * point;
    const Vector3d placed = rotated + T.p;
    if (!map.match(placed, plane)) {
      continue;
    }
    const double r = plane.normal.dot(placed) + plane.offset_m;
    ++sums.matched;
    sums.near += std::abs(r) < kNear_m ? 1 : 0;
    const double ratio = r / width_m;
    const double root = 1.0 / (1.0 + ratio * ratio);
    const double weight = root * root / (kPointSigma_m * kPointSigma_m + plane.thickness2_m2);
    Vector6d h;
    h << plane.normal, point.cross(T.q.conjugate() * plane.normal);
    sums.information.selfadjointView<Eigen::Lower>().rankUpdate(h, weight);
    sums.gradient += weight * r * h;
  }
  const double scale =
      std::min(1.0, kIndependent / static_cast<double>(std::max<std::size_t>(1, sums.matched)));
  sums.information = scale * Matrix6d(sums.information.selfadjointView<Eigen::Lower>());
  sums.gradient *= scale;
  return sums;
}

Vector6d error_of(const Pose& T, const Pose& start) {
  Vector6d e;
  e << T.p - start.p, so3_log(start.q.conjugate() * T.q);
  return e;
}

Matrix6d floor_covariance() {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << Vector3d::Constant(kFloor_m * kFloor_m),
      Vector3d::Constant(kFloor_rad * kFloor_rad);
  return covariance;
}

}  // namespace

std::optional<CloudFit> fit_cloud(const std::vector<Vector3d>& points_m,
                                  const LocalMap& map,
                                  const Pose& T_map_cloud) {
  Vector6d prior;
  prior << Vector3d::Constant(1.0 / (kStartSigma_m * kStartSigma_m)),
      Vector3d::Constant(1.0 / (kStartSigma_rad * kStartSigma_rad));
  Pose T = T_map_cloud;
  double width_m = kFirstWidth_m;
  for (int step = 0; step < kMostSteps; ++step) {
    const Sums sums = sums_at(points_m, map, T, width_m);
    if (sums.matched < kFewestMatches) {
      return std::nullopt;
    }
    const bool narrowest = width_m <= kLastWidth_m;
    Matrix6d information = sums.information;
    information.diagonal() += prior;
    const Vector6d gradient = sums.gradient + prior.cwiseProduct(error_of(T, T_map_cloud));
    const Vector6d e = -information.ldlt().solve(gradient);
    T.p += e.head<3>();
    T.q = (T.q * so3_exp(e.tail<3>())).normalized();
    if (narrowest && e.dot(information * e) < kConverged2) {
      const Sums last = sums_at(points_m, map, T, width_m);
      Matrix6d seen = last.information;
      seen.diagonal() += 1e-2 * prior;  // what no surface holds is known to ten metres
      const auto matched = static_cast<double>(std::max<std::size_t>(1, last.matched));
      return CloudFit{T,
                      seen.ldlt().solve(Matrix6d::Identity()) + floor_covariance(),
                      matched / static_cast<double>(points_m.size()),
                      static_cast<double>(last.near) / matched};
    }
    width_m = std::max(kLastWidth_m, kNarrowing * width_m);
  }
  return std::nullopt;
}

}  // namespace trigpoint::lio_mapper
