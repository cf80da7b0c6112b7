// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "iterated_update.hpp"

#include "trigpoint/base/so3.hpp"

#include "random_state.hpp"
#include "scan_matcher.hpp"
#include "unchanging_map.hpp"
#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace trigpoint::lio_mapper {

namespace {

using testing_support::random_covariance;
using testing_support::random_error;
using testing_support::random_state;

struct PlaneResidual {
  Eigen::Vector3d point_base_m;
  Eigen::Vector3d normal;
  double offset_m;

  double at(const Pose& T) const { return normal.dot(T * point_base_m) + offset_m; }
};

constexpr double kSigma_m = 0.02;

/// Points on planes of all directions, seen from `truth`, with noise.
std::vector<PlaneResidual> problem(const Pose& truth, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<PlaneResidual> residuals;
  for (int i = 0; i < 60; ++i) {
    PlaneResidual r;
    r.point_base_m = 5.0 * Eigen::Vector3d(normal(generator), normal(generator), normal(generator));
    r.normal =
        Eigen::Vector3d(normal(generator), normal(generator), normal(generator)).normalized();
    r.offset_m = -r.normal.dot(truth * r.point_base_m) + kSigma_m * normal(generator);
    residuals.push_back(r);
  }
  return residuals;
}

PoseInformation linearise(const std::vector<PlaneResidual>& residuals, const Pose& T) {
  PoseInformation sum;
  for (const PlaneResidual& r : residuals) {
    Vector6d h;
    h << r.normal, r.point_base_m.cross(T.q.conjugate() * r.normal);
    sum.information += h * h.transpose() / (kSigma_m * kSigma_m);
    sum.gradient += h * r.at(T) / (kSigma_m * kSigma_m);
    ++sum.count;
  }
  return sum;
}

/// Cost of prior and residuals, whitened; the brute force does not know any formula of the filter.
Eigen::VectorXd whitened(const State& state,
                         const State& prior,
                         const Eigen::Matrix<double, error::kSize, error::kSize>& root_information,
                         const std::vector<PlaneResidual>& residuals) {
  Eigen::VectorXd cost(error::kSize + static_cast<int>(residuals.size()));
  cost.head<error::kSize>() = root_information * boxminus(state, prior);
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    cost[error::kSize + static_cast<int>(i)] = residuals[i].at(state.T_odom_base) / kSigma_m;
  }
  return cost;
}

Eigen::MatrixXd numerical_jacobian(const std::function<Eigen::VectorXd(const ErrorVector&)>& f,
                                   Eigen::Index rows) {
  constexpr double kDelta = 1e-6;
  Eigen::MatrixXd J(rows, error::kSize);
  for (int i = 0; i < error::kSize; ++i) {
    ErrorVector e = ErrorVector::Zero();
    e[i] = kDelta;
    J.col(i) = (f(e) - f(-e)) / (2.0 * kDelta);
  }
  return J;
}

TEST(IteratedUpdate, finds_the_minimum_that_brute_force_gauss_newton_finds) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const State prior = random_state(seed);
    ErrorMatrix P = random_covariance(seed + 50, 0.2);
    // Gravity's prior Jacobian is first order only; keep it as small as it is in a drive.
    P.middleRows<2>(error::kGravity) *= 1e-2;
    P.middleCols<2>(error::kGravity) *= 1e-2;
    const State truth = boxplus(prior, 0.5 * random_error(seed + 90, 0.2));
    const auto residuals = problem(truth.T_odom_base, seed);

    const UpdateResult result = iterated_update(
        prior, P, [&](const Pose& T) { return linearise(residuals, T); }, {30, 1e-10, 1e-10, 6});
    ASSERT_TRUE(result.used);
    ASSERT_TRUE(result.converged);

    const ErrorMatrix root = P.llt().matrixL().solve(ErrorMatrix::Identity());
    State best = prior;
    Eigen::MatrixXd J;
    for (int i = 0; i < 30; ++i) {
      const auto cost = [&](const ErrorVector& e) {
        return whitened(boxplus(best, e), prior, root, residuals);
      };
      J = numerical_jacobian(cost, error::kSize + 60);
      const ErrorVector step =
          -(J.transpose() * J).ldlt().solve(J.transpose() * cost(ErrorVector::Zero()));
      best = boxplus(best, step);
    }
    EXPECT_LT(boxminus(result.state, best).norm(), 1e-4) << "seed " << seed;
    const ErrorMatrix covariance = (J.transpose() * J).inverse();
    EXPECT_LT((result.covariance - covariance).norm(), 1e-3 * covariance.norm()) << "seed " << seed;
  }
}

TEST(IteratedUpdate, transition_tells_what_is_left_of_an_error_of_the_prior) {
  const State prior = random_state(3);
  const ErrorMatrix P = random_covariance(4, 0.05);
  const auto residuals = problem(prior.T_odom_base, 5);
  const auto run = [&](const State& from) {
    return iterated_update(
        from, P, [&](const Pose& T) { return linearise(residuals, T); }, {30, 1e-12, 1e-12, 6});
  };
  const UpdateResult nominal = run(prior);
  constexpr double kDelta = 1e-5;
  for (int i = 0; i < error::kSize; ++i) {
    ErrorVector e = ErrorVector::Zero();
    e[i] = kDelta;
    const ErrorVector left = boxminus(run(boxplus(prior, e)).state, nominal.state) / kDelta;
    EXPECT_LT((left - nominal.transition.col(i)).norm(), 5e-3 * (1.0 + left.norm()))
        << "column " << i;
  }
}

TEST(IteratedUpdate, covariance_of_who_is_told_more_is_that_of_the_summed_information) {
  const ErrorMatrix P = random_covariance(7, 0.1);
  Matrix6d known = random_covariance(8, 30.0).topLeftCorner<6, 6>();
  known.col(2).setZero();  // nothing of the height
  known.row(2).setZero();
  ErrorMatrix information = P.inverse();
  information.topLeftCorner<6, 6>() += known;
  const ErrorMatrix expected = information.inverse();
  EXPECT_LT((conditioned(P, known) - expected).norm(), 1e-9 * P.norm());
  EXPECT_LT((conditioned(P, Matrix6d::Zero()) - P).norm(), 1e-12 * P.norm());
}

TEST(IteratedUpdate, leaves_the_prior_alone_when_residuals_are_too_few) {
  const State prior = random_state(1);
  const ErrorMatrix P = random_covariance(2, 0.1);
  const auto residuals = problem(prior.T_odom_base, 3);
  const UpdateResult result = iterated_update(
      prior, P, [&](const Pose& T) { return linearise(residuals, T); }, {5, 1e-3, 1e-4, 61});
  EXPECT_FALSE(result.used);
  EXPECT_EQ(boxminus(result.state, prior).norm(), 0.0);
  EXPECT_EQ((result.covariance - P).norm(), 0.0);
}

TEST(IteratedUpdate, reports_directions_that_nobody_saw) {
  State prior;
  const ErrorMatrix P = 0.01 * ErrorMatrix::Identity();
  std::vector<PlaneResidual> corridor;
  for (int i = 0; i < 100; ++i) {
    const double x = 0.2 * i - 10.0;
    corridor.push_back({{x, 2.0, 0.01 * i}, {0.0, 1.0, 0.0}, -2.0});
    corridor.push_back({{x, (37 * i % 100) * 0.1 - 5.0, -1.0}, {0.0, 0.0, 1.0}, 1.0});
  }
  const UpdateResult result = iterated_update(
      prior, P, [&](const Pose& T) { return linearise(corridor, T); }, {5, 1e-3, 1e-4, 6});
  EXPECT_LT(result.observability[0], 1e-6);  // along the corridor
  EXPECT_GT(result.observability[1], 0.99);
  EXPECT_GT(result.observability[2], 0.99);
  EXPECT_NEAR(result.covariance(0, 0), 0.01, 1e-9);
}

/// Three walls of a room.
class RoomMap final : public UnchangingMap {
 public:
  bool match_surface(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    int axis = 0;
    (p - Eigen::Vector3d(10.0, 8.0, -2.0)).cwiseAbs().minCoeff(&axis);
    plane.normal = Eigen::Vector3d::Unit(axis);
    plane.offset_m = -Eigen::Vector3d(10.0, 8.0, -2.0)[axis];
    plane.thickness2_m2 = 1e-4;
    return true;
  }
};

/// One thread; that more change nothing has a test of its own.
Workers one_worker(1);

/// The cone of a ring in foliage: beams that run along the plane at 1 degree against beams that hit
/// a wall at 60 degrees.
TEST(ScanMatcher, believes_little_of_a_plane_that_its_beams_run_along) {
  const RoomMap map;
  const auto information_along_z = [&](float x, double grazing_cos) {
    PointCloud points;
    for (int i = 0; i < 60; ++i) {
      points.push_back({x, 0.001F * static_cast<float>(i), -1.98F, 0.0F});
    }
    MatchingConfig config;
    config.grazing_cos = grazing_cos;
    const Pose T_base_lidar{Eigen::Quaterniond::Identity(), {0.0, 0.0, -1.9}};
    ScanMatcher matcher(points, map, T_base_lidar, config, one_worker);
    return matcher.linearise(Pose{}).information(2, 2);
  };
  const double by_default = MatchingConfig{}.grazing_cos;
  EXPECT_LT(information_along_z(5.0F, by_default), 0.03 * information_along_z(5.0F, 0.0));
  EXPECT_GT(information_along_z(0.05F, by_default), 0.9 * information_along_z(0.05F, 0.0));
}

TEST(ScanMatcher, gradient_and_information_are_the_derivatives_of_the_cost) {
  PointCloud points;
  for (int i = 0; i < 30; ++i) {
    const auto f = static_cast<float>(i) * 0.2F;
    points.push_back({10.05F, f, 0.1F * f, 0.0F});
    points.push_back({f, 8.02F, 0.2F * f, 0.0F});
    points.push_back({f, 0.5F * f, -2.03F, 0.0F});
  }
  const RoomMap map;
  MatchingConfig config;
  config.patch_m = 0.01;
  config.max_patches = 1'000'000;
  config.robust_width = 1e9;
  config.range_sigma_m = 0.02;
  config.angle_sigma_rad = 0.0;
  const Pose T{so3_exp({0.01, -0.02, 0.015}), {0.02, -0.03, 0.01}};
  ScanMatcher matcher(points, map, Pose{}, config, one_worker);
  const PoseInformation info = matcher.linearise(T);
  EXPECT_EQ(info.count, points.size());

  // Weights do depend on the pose through incidence; over 1e-6 rad that is nothing.
  const auto cost = [&](const Vector6d& e) {
    const Pose moved{T.q * so3_exp(e.tail<3>()), T.p + e.head<3>()};
    double sum = 0.0;
    for (const PointXyzi& point : points) {
      const Eigen::Vector3d p = point.position().cast<double>();
      PlaneMatch plane;
      map.match(T * p, plane);
      const double r = plane.normal.dot(moved * p) + plane.offset_m;
      const double cos = (T.q * p.normalized()).dot(plane.normal);
      const double cos2 = cos * cos;
      sum += 0.5 * r * r * cos2 / (cos2 + config.grazing_cos * config.grazing_cos) /
             (1e-4 + 0.0004 * cos2 + plane.thickness2_m2);
    }
    return sum;
  };
  constexpr double kDelta = 1e-5;
  for (int i = 0; i < 6; ++i) {
    Vector6d e = Vector6d::Zero();
    e[i] = kDelta;
    const double slope = (cost(e) - cost(-e)) / (2.0 * kDelta);
    EXPECT_NEAR(info.gradient[i], slope, 1e-4 * (1.0 + std::abs(slope))) << "row " << i;
    const double curvature =
        (cost(e) - 2.0 * cost(Vector6d::Zero()) + cost(-e)) / (kDelta * kDelta);
    // Gauss-Newton leaves r times the second derivative out.
    EXPECT_NEAR(info.information(i, i), curvature, 0.02 * info.information(i, i)) << "row " << i;
  }
}

TEST(ScanMatcher, residuals_of_one_patch_weigh_as_one) {
  const MatchingConfig config;
  const RoomMap map;
  const auto information_of = [&](std::size_t here, std::size_t elsewhere) {
    PointCloud points(here, PointXyzi{10.0F, 1.0F, 0.0F, 0.0F});
    const auto side = static_cast<float>(config.patch_m);
    points.resize(here + elsewhere, PointXyzi{10.0F, 1.0F - side, 0.0F, 0.0F});
    ScanMatcher matcher(points, map, Pose{}, config, one_worker);
    return matcher.linearise({}).information(0, 0);
  };
  EXPECT_NEAR(information_of(900, 0) / information_of(1, 0), 1.0, 1e-5);
  EXPECT_NEAR(information_of(900, 900) / information_of(900, 0), 2.0, 0.05);
}

TEST(ScanMatcher, more_patches_than_the_most_weigh_as_the_most) {
  const RoomMap map;
  const auto information_of = [&](std::int64_t max_patches) {
    MatchingConfig config;
    config.max_patches = max_patches;
    const auto side = static_cast<float>(config.patch_m);
    const PointCloud points{{10.0F, 1.0F, 0.0F, 0.0F}, {10.0F, 1.0F - side, 0.0F, 0.0F}};
    ScanMatcher matcher(points, map, Pose{}, config, one_worker);
    return matcher.linearise({}).information(0, 0);
  };
  EXPECT_NEAR(information_of(2) / information_of(1), 2.0, 1e-9);
  EXPECT_DOUBLE_EQ(information_of(200), information_of(2));
}

TEST(ScanMatcher, sums_to_the_same_bits_on_any_number_of_threads) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> place(-9.0F, 12.0F);
  PointCloud points;
  for (int i = 0; i < 30000; ++i) {
    points.push_back({place(random), place(random), 0.2F * place(random), 0.0F});
  }
  const RoomMap map;
  const MatchingConfig config;
  const Pose T{so3_exp({0.01, -0.02, 0.015}), {0.02, -0.03, 0.01}};
  ScanMatcher alone(points, map, Pose{}, config, one_worker);
  const PoseInformation expected = alone.linearise(T);
  ASSERT_GT(expected.count, 1000U);
  for (const std::size_t threads : {2U, 3U, 7U}) {
    Workers several(threads);
    for (int run = 0; run < 20; ++run) {
      ScanMatcher matcher(points, map, Pose{}, config, several);
      const PoseInformation info = matcher.linearise(T);
      ASSERT_EQ(info.count, expected.count);
      ASSERT_EQ(info.information, expected.information);
      ASSERT_EQ(info.gradient, expected.gradient);
    }
  }
}

}  // namespace

}  // namespace trigpoint::lio_mapper
