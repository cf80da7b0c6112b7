// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/map_quality.hpp"

#include "made_session.hpp"
#include "run_command.hpp"
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace trigpoint::evaluation {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using tests::TemporaryFolder;

PointXyzi point(double x, double y, double z) {
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z), 0.0F};
}

/// Points of a normal distribution about a place.
PointCloud blob(const Eigen::Vector3d& centre,
                const Eigen::Vector3d& sigma,
                int points,
                unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise;
  PointCloud cloud;
  for (int i = 0; i < points; ++i) {
    cloud.push_back(point(centre.x() + sigma.x() * noise(random),
                          centre.y() + sigma.y() * noise(random),
                          centre.z() + sigma.z() * noise(random)));
  }
  return cloud;
}

/// h of the whole cloud, from its covariance.
double entropy_of(const PointCloud& cloud) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const PointXyzi& p : cloud) {
    mean += p.position().cast<double>() / static_cast<double>(cloud.size());
  }
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const PointXyzi& p : cloud) {
    const Eigen::Vector3d d = p.position().cast<double>() - mean;
    covariance += d * d.transpose() / static_cast<double>(cloud.size());
  }
  return 0.5 * std::log((2.0 * std::numbers::pi * std::numbers::e * covariance).determinant());
}

/// A wall of 12 x 4 m at north `y_m`, `sigma_m` thick.
PointCloud wall(double y_m, double sigma_m, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> along(-6.0, 6.0);
  std::uniform_real_distribution<double> up(0.0, 4.0);
  std::normal_distribution<double> noise;
  PointCloud cloud;
  for (int i = 0; i < 12'000; ++i) {
    const double x = along(random);
    const double z = up(random);
    cloud.push_back(point(x, y_m + sigma_m * noise(random), z));
  }
  return cloud;
}

TEST(MapEntropy, of_separate_blobs_is_the_mean_of_the_closed_forms) {
  // Each lies within the radius of each of its points, across the borders of cells and blocks.
  const PointCloud first = blob({0.0, 0.0, 0.0}, {0.02, 0.03, 0.01}, 300, 1);
  const PointCloud second = blob({40.0, -8.0, 3.9}, {0.04, 0.01, 0.05}, 100, 2);
  PointCloud both = first;
  both.insert(both.end(), second.begin(), second.end());
  const MapEntropy entropy = mean_map_entropy(both);
  EXPECT_EQ(entropy.points, 400U);
  EXPECT_NEAR(entropy.mean, 0.75 * entropy_of(first) + 0.25 * entropy_of(second), 1e-6);
}

TEST(MapEntropy, falls_by_the_logarithm_of_the_thickness_where_a_wall_is_sharper) {
  const MapEntropy sharp = mean_map_entropy(wall(2.0, 0.01));
  const MapEntropy blurred = mean_map_entropy(wall(2.0, 0.05));
  EXPECT_NEAR(blurred.mean - sharp.mean, std::log(5.0), 0.03);  // the radius cuts the thick one
}

TEST(MapEntropy, leaves_out_points_that_are_lonely_or_on_a_plane) {
  PointCloud cloud = blob({0.0, 0.0, 0.0}, {0.05, 0.05, 0.0}, 100, 1);
  cloud.push_back(point(100.0, 0.0, 0.0));
  cloud.push_back(point(std::nan(""), 0.0, 0.0));
  const MapEntropy entropy = mean_map_entropy(cloud);
  EXPECT_EQ(entropy.points, 0U);
  EXPECT_EQ(entropy.lonely, 101U);
  EXPECT_TRUE(std::isnan(entropy.mean));
}

TEST(MapEntropy, of_a_share_of_a_large_map_is_near_that_of_all) {
  PointCloud cloud;
  for (unsigned i = 0; i < 400; ++i) {
    const PointCloud part = blob({10.0 * i, 0.0, 0.0}, {0.1, 0.1, 0.02}, 100, i);
    cloud.insert(cloud.end(), part.begin(), part.end());
  }
  const MapEntropy all = mean_map_entropy(cloud);
  const MapEntropy some = mean_map_entropy(cloud, 0.5, 10'000);
  EXPECT_LT(some.points, 20'000U);
  EXPECT_GT(some.points, 5'000U);
  EXPECT_NEAR(some.mean, all.mean, 0.05);
}

TEST(PassWalls, tell_how_far_apart_passes_put_the_same_wall) {
  PassWalls walls;
  walls.add_pass(wall(2.30, 0.02, 1));
  walls.add_pass(wall(2.35, 0.02, 2));
  walls.add_pass(wall(2.42, 0.02, 3));
  const PassOffset all = walls.offset(1);
  EXPECT_EQ(all.passes, 3U);
  EXPECT_GE(all.walls, 6U);
  EXPECT_NEAR(all.median_m, 0.12, 0.01);  // the first and the last
  PassWalls followers;
  followers.add_pass(wall(2.30, 0.02, 1));
  followers.add_pass(wall(2.42, 0.02, 3));
  EXPECT_EQ(followers.offset(2).walls, 0U);
}

TEST(PassWalls, of_the_same_wall_is_below_its_noise) {
  PassWalls walls;
  walls.add_pass(wall(2.0, 0.02, 1));
  walls.add_pass(wall(2.0, 0.02, 2));
  EXPECT_LT(walls.offset(1).p90_m, 0.01);
}

TEST(SurfaceError, is_that_of_the_distances) {
  PointCloud cloud;
  for (int i = 0; i <= 100; ++i) {
    cloud.push_back(point(0.0, 0.0, 0.001 + 0.002 * i));
  }
  cloud.push_back(point(5.0, 0.0, 0.0));
  const SurfaceError error = surface_error(cloud, [](const Eigen::Vector3d& p) {
    return p.x() > 1.0 ? std::nullopt : std::optional(std::abs(p.z()));
  });
  EXPECT_EQ(error.points, 101U);
  EXPECT_EQ(error.without_surface, 1U);
  constexpr double kFloat_m = 1e-6;
  EXPECT_NEAR(error.median_m, 0.101, kFloat_m);
  EXPECT_NEAR(error.p90_m, 0.181, kFloat_m);
  // The sum of the first n odd squares is n (4 n^2 - 1) / 3.
  EXPECT_NEAR(error.rmse_m, 0.001 * std::sqrt((4.0 * 101.0 * 101.0 - 1.0) / 3.0), kFloat_m);
  EXPECT_EQ(error.share_within_10cm, 50.0 / 101.0);
}

TEST(MapQuality, of_a_session_is_told_in_words_and_json) {
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  const MapQuality quality =
      map_quality(folder.path("s"), [](const Eigen::Vector3d&) { return std::optional(0.05); });
  EXPECT_GT(quality.points, 0U);
  EXPECT_FALSE(quality.passes) << "the made session holds no keyframes";
  EXPECT_THAT(print(quality),
              AllOf(HasSubstr("rmse 0.050 m"), HasSubstr("no corrected keyframes")));
  EXPECT_THAT(to_json(quality), HasSubstr("\"median_m\": 0.05"));
  EXPECT_THROW(map_quality(folder.path("nothing")), std::runtime_error);
}

}  // namespace
}  // namespace trigpoint::evaluation
