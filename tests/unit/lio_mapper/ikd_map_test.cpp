// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "local_map.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trigpoint::lio_mapper {
namespace {

constexpr double kNoise_m = 0.02;

/// z = 0.3 x - 0.2 y + 1, with noise across.
PointCloud slope(int points, unsigned seed, double x0_m = 0.0) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-10.0, 10.0);
  std::normal_distribution<double> noise(0.0, kNoise_m);
  PointCloud cloud;
  for (int i = 0; i < points; ++i) {
    const double x = x0_m + place(random);
    const double y = place(random);
    cloud.push_back({static_cast<float>(x),
                     static_cast<float>(y),
                     static_cast<float>(0.3 * x - 0.2 * y + 1.0 + noise(random)),
                     1.0F});
  }
  return cloud;
}

double slope_at(double x, double y) {
  return 0.3 * x - 0.2 * y + 1.0;
}

TEST(IkdMap, gives_the_plane_that_its_points_lie_on) {
  const auto map = make_ikd_map({});
  map->insert(slope(20000, 1));
  const Eigen::Vector3d normal = Eigen::Vector3d(-0.3, 0.2, 1.0).normalized();
  int matched = 0;
  double cosines = 0.0;
  double squares = 0.0;
  for (double x = -8.0; x < 8.0; x += 0.37) {
    for (double y = -8.0; y < 8.0; y += 0.41) {
      PlaneMatch plane;
      const Eigen::Vector3d p(x, y, slope_at(x, y));
      ASSERT_TRUE(map->match(p, plane));
      EXPECT_NEAR(plane.normal.norm(), 1.0, 1e-9);
      cosines += std::abs(plane.normal.dot(normal));
      squares += std::pow(plane.normal.dot(p) + plane.offset_m, 2);
      ++matched;
    }
  }
  // Five points of 2 cm noise over half a metre: some degrees; at the points' centre 2 cm /
  // sqrt(5).
  EXPECT_GT(cosines / matched, std::cos(0.07));
  EXPECT_LT(std::sqrt(squares / matched), kNoise_m);
}

TEST(IkdMap, sees_no_plane_where_five_points_do_not_agree) {
  const auto map = make_ikd_map({});
  std::mt19937 random(2);
  std::uniform_real_distribution<float> place(-4.0F, 4.0F);
  PointCloud blob;
  for (int i = 0; i < 3000; ++i) {
    blob.push_back({place(random), place(random), place(random), 0.0F});
  }
  map->insert(blob);
  int matched = 0;
  for (int i = 0; i < 500; ++i) {
    PlaneMatch plane;
    matched +=
        map->match({0.5 * place(random), 0.5 * place(random), 0.5 * place(random)}, plane) ? 1 : 0;
  }
  EXPECT_LT(matched, 150);
}

TEST(IkdMap, needs_five_points_within_reach_that_are_no_line) {
  const auto map = make_ikd_map({});
  map->insert({{0, 0, 0, 0}, {1, 0, 0, 0}, {0, 1, 0, 0}, {1, 1, 0, 0}});
  PlaneMatch plane;
  EXPECT_FALSE(map->match({0.5, 0.5, 0.0}, plane));
  map->insert({{2.7F, 0.5F, 0.0F, 0}});
  EXPECT_TRUE(map->match({0.5, 0.5, 0.0}, plane));
  EXPECT_FALSE(map->match({0.45, 0.5, 0.0}, plane));  // the fifth is 2.25 m away
  map->rebuild({{0, 0, 0, 0}, {0.6F, 0, 0, 0}, {1.2F, 0, 0, 0}, {1.8F, 0, 0, 0}, {2.4F, 0, 0, 0}});
  EXPECT_FALSE(map->match({1.2, 0.0, 0.0}, plane));
  EXPECT_FALSE(map->match({kNaN, 0.0, 0.0}, plane));
}

TEST(IkdMap, forgets_what_is_outside_the_cube_and_moves_as_a_whole) {
  const auto map = make_ikd_map({});
  map->insert(slope(20000, 3));
  map->prune({5.0, 0.0, 2.0}, 4.0);
  for (const PointXyzi& p : map->points()) {
    EXPECT_LE(std::abs(p.x - 5.0F), 4.0F);
    EXPECT_LE(std::abs(p.y), 4.0F);
  }
  const std::size_t kept = map->size();
  EXPECT_GT(kept, 200U);
  const Pose T_new_old(Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Eigen::Vector3d::UnitZ())),
                       {-40.0, 30.0, 2.0});
  map->transform(T_new_old);
  EXPECT_EQ(map->size(), kept);
  PlaneMatch plane;
  const Eigen::Vector3d p = T_new_old * Eigen::Vector3d(5.0, 1.0, slope_at(5.0, 1.0));
  ASSERT_TRUE(map->match(p, plane));
  EXPECT_NEAR(plane.normal.dot(p) + plane.offset_m, 0.0, 3 * kNoise_m);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
