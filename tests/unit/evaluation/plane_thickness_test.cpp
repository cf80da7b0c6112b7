// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/plane_thickness.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trigpoint::evaluation {
namespace {

constexpr double kDensity_perm2 = 200.0;
/// Percentiles of some hundred points, median over some tens of cells, edges of the columns.
constexpr double kSampling = 0.05;
/// Coordinates are float32: 4e-6 m at 50 m.
constexpr double kPlaneRounding_m = 2e-5;

/// A wall that begins at `corner_m` and runs `length_m` in the direction of `yaw_rad`.
struct Wall {
  Eigen::Vector3d corner_m{3.3, -7.1, 0.2};
  double yaw_rad{0.4};
  double length_m{24.0};
  double height_m{6.0};
  double lean_rad{0.0};
};

class Scene {
 public:
  explicit Scene(unsigned seed) : random_(seed) {}

  Scene& add(const Wall& wall, double sigma_m, double beside_m = 0.0) {
    const Eigen::Vector3d along(std::cos(wall.yaw_rad), std::sin(wall.yaw_rad), 0.0);
    const Eigen::Vector3d flat(-along.y(), along.x(), 0.0);
    const Eigen::Vector3d up =
        std::cos(wall.lean_rad) * Eigen::Vector3d::UnitZ() + std::sin(wall.lean_rad) * flat;
    const Eigen::Vector3d normal = along.cross(up);
    const auto points = static_cast<int>(kDensity_perm2 * wall.length_m * wall.height_m);
    for (int i = 0; i < points; ++i) {
      add(wall.corner_m + uniform(wall.length_m) * along + uniform(wall.height_m) * up +
          (beside_m + sigma_m * normal_(random_)) * normal);
    }
    return *this;
  }

  Scene& add_ground(double height_m) {
    for (int i = 0; i < static_cast<int>(kDensity_perm2 * 900.0); ++i) {
      add({uniform(30.0), uniform(30.0) - 15.0, height_m + 0.02 * normal_(random_)});
    }
    return *this;
  }

  /// Leaves: points everywhere in a box.
  Scene& add_bush() {
    for (int i = 0; i < 20'000; ++i) {
      add({uniform(10.0), uniform(10.0), uniform(4.0)});
    }
    return *this;
  }

  const PointCloud& cloud() const { return cloud_; }

 private:
  double uniform(double most) { return std::uniform_real_distribution<double>(0.0, most)(random_); }

  void add(const Eigen::Vector3d& p) {
    const Eigen::Vector3f f = p.cast<float>();
    cloud_.push_back({f.x(), f.y(), f.z(), 0.0F});
  }

  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  PointCloud cloud_;
};

TEST(FacadeThickness, is_sigma_of_a_wall_with_normal_noise) {
  for (const double sigma_m : {0.01, 0.03, 0.06}) {
    const auto found = facade_thickness(Scene(1).add(Wall{}, sigma_m).cloud());
    EXPECT_GT(found.planes, 15U);
    EXPECT_NEAR(found.median_m, sigma_m, kSampling * sigma_m) << sigma_m;
    EXPECT_GE(found.p90_m, found.median_m);
  }
}

TEST(FacadeThickness, is_nothing_without_noise) {
  const auto found = facade_thickness(Scene(2).add(Wall{}, 0.0).cloud());
  EXPECT_GT(found.planes, 15U);
  EXPECT_LT(found.p90_m, kPlaneRounding_m);
}

TEST(FacadeThickness, does_not_depend_on_where_the_cells_borders_lie) {
  // Along the face of these walls runs a border, or is 0.3 m beside it, or the middle of the cells.
  for (const double y_m : {0.0, 0.3, 1.0}) {
    Wall wall;
    wall.corner_m = {0.0, y_m, 0.0};
    wall.yaw_rad = 0.0;
    const auto found = facade_thickness(Scene(3).add(wall, 0.04).cloud());
    EXPECT_GE(found.planes, 30U) << y_m;
    EXPECT_LE(found.planes, 40U) << y_m << ": a wall must not be counted twice";
    EXPECT_NEAR(found.median_m, 0.04, kSampling * 0.04) << y_m;
  }
}

TEST(FacadeThickness, of_a_double_wall_is_half_the_distance_of_its_copies) {
  for (const double apart_m : {0.15, 0.25, 0.35}) {
    const auto found =
        facade_thickness(Scene(4).add(Wall{}, 0.0).add(Wall{}, 0.0, apart_m).cloud());
    EXPECT_GT(found.planes, 10U);
    EXPECT_NEAR(found.median_m, 0.5 * apart_m, kSampling * apart_m);
  }
}

TEST(FacadeThickness, sees_a_second_copy_that_has_fewer_points) {
  Scene scene(5);
  for (int i = 0; i < 3; ++i) {
    scene.add(Wall{}, 0.01);
  }
  const auto found = facade_thickness(scene.add(Wall{}, 0.01, 0.3).cloud());
  EXPECT_NEAR(found.median_m, 0.15, 0.015);
}

TEST(FacadeThickness, is_across_the_wall_also_when_the_map_is_tilted) {
  Wall leaning;
  leaning.lean_rad = 0.1;
  const auto found = facade_thickness(Scene(6).add(leaning, 0.02).cloud());
  EXPECT_GT(found.planes, 15U);
  EXPECT_NEAR(found.median_m, 0.02, kSampling * 0.02);
}

TEST(FacadeThickness, is_not_made_thicker_by_the_ground_at_the_walls_foot) {
  Wall wall;
  wall.corner_m.z() = 0.0;
  const auto found = facade_thickness(Scene(7).add(wall, 0.03).add_ground(0.0).cloud());
  EXPECT_GT(found.planes, 15U);
  EXPECT_NEAR(found.median_m, 0.03, kSampling * 0.03);
}

TEST(FacadeThickness, takes_neither_ground_nor_bushes_nor_slopes_for_walls) {
  EXPECT_EQ(facade_thickness(Scene(8).add_ground(1.0).cloud()).planes, 0U);
  EXPECT_EQ(facade_thickness(Scene(8).add_bush().cloud()).planes, 0U);
  Wall slope;
  slope.lean_rad = 0.5;
  EXPECT_EQ(facade_thickness(Scene(8).add(slope, 0.01).cloud()).planes, 0U);
}

TEST(FacadeThickness, is_unknown_without_a_wall) {
  const auto found = facade_thickness({});
  EXPECT_EQ(found.planes, 0U);
  EXPECT_TRUE(std::isnan(found.median_m));
  EXPECT_TRUE(std::isnan(found.p90_m));
  EXPECT_EQ(facade_thickness({{NAN, 0.0F, 0.0F, 0.0F}, {1e30F, 0.0F, 0.0F, 0.0F}}).cells, 0U);
}

TEST(FacadeThickness, of_a_sample_of_a_large_map_is_that_of_the_whole) {
  const Scene scene = Scene(9).add(Wall{{0.0, 0.0, 0.0}, 0.3, 200.0, 10.0}, 0.03);
  const auto whole = facade_thickness(scene.cloud());
  const auto sample = facade_thickness(scene.cloud(), {scene.cloud().size() / 5});
  EXPECT_NEAR(sample.share_looked_at, 0.2, 1e-3);
  const double expected = 0.2 * static_cast<double>(whole.planes);
  EXPECT_NEAR(static_cast<double>(sample.planes), expected, 4.0 * std::sqrt(expected));
  EXPECT_NEAR(sample.median_m, whole.median_m, kSampling * whole.median_m);
}

TEST(FacadeOffset, is_how_far_the_same_wall_lies_apart_in_two_clouds) {
  const PointCloud first = Scene(1).add(Wall{}, 0.02).cloud();
  for (const double apart_m : {0.0, 0.03, 0.12}) {
    const FacadeOffset offset = facade_offset(first, Scene(2).add(Wall{}, 0.02, apart_m).cloud());
    EXPECT_GT(offset.planes, 15U);
    EXPECT_NEAR(offset.median_m, apart_m, 0.004) << apart_m;
    EXPECT_NEAR(offset.p90_m, apart_m, 0.008) << apart_m;
  }
}

TEST(FacadeOffset, is_unknown_where_the_clouds_share_no_wall) {
  Wall turned;
  turned.yaw_rad += 1.0;
  turned.corner_m.x() += 40.0;
  const FacadeOffset offset = facade_offset(Scene(1).add(Wall{}, 0.02).cloud(),
                                            Scene(2).add(turned, 0.02).add_ground(0.0).cloud());
  EXPECT_EQ(offset.planes, 0U);
  EXPECT_TRUE(std::isnan(offset.p90_m));
}

}  // namespace
}  // namespace trigpoint::evaluation
