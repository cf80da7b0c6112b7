// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "world.hpp"

#include "random.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace trigpoint::simulator {

namespace {

constexpr double kRange_m = 100.0;
const std::vector<Eigen::Vector2d> kTrack{{-20.0, -20.0}, {20.0, 20.0}};

WorldConfig flat() {
  WorldConfig config;
  config.relief_amplitude_m = 0.0;
  return config;
}

World world_of(std::vector<Shape> shapes, const WorldConfig& config = flat()) {
  return World(Relief(config, 5), std::move(shapes), kTrack, 120.0);
}

Ray ray(const Eigen::Vector3d& from, const Eigen::Vector3d& towards, std::uint64_t key = 1) {
  return {from, towards.normalized(), key};
}

Shape box(const Eigen::Vector3d& centre, const Eigen::Vector3d& half, double yaw = 0.0) {
  Shape shape;
  shape.centre_m = centre;
  shape.half_m = half;
  shape.cos_yaw = std::cos(yaw);
  shape.sin_yaw = std::sin(yaw);
  return shape;
}

}  // namespace

TEST(World, returns_the_distance_to_flat_ground) {
  const World world = world_of({});
  for (const double elevation : {-0.3, -0.1, -0.05, -0.025}) {
    const Hit hit =
        world.cast(ray({0, 0, 2}, {std::cos(elevation), 0, std::sin(elevation)}), kRange_m);
    EXPECT_NEAR(hit.range_m, 2.0 / std::sin(-elevation), 1e-4) << elevation;
    EXPECT_NEAR(hit.cos_incidence, std::sin(-elevation), 1e-6) << elevation;
  }
}

TEST(World, returns_nothing_from_the_sky_or_from_beyond_the_range) {
  const World world = world_of({box({60, 0, 5}, {1, 10, 5})});
  EXPECT_FALSE(world.cast(ray({0, 0, 2}, {1, 0, 0.5}), kRange_m).is_hit());
  EXPECT_FALSE(world.cast(ray({0, 0, 2}, {-1, 0, 0.01}), kRange_m).is_hit());
  EXPECT_FALSE(world.cast(ray({0, 0, 2}, {1, 0, 0}), 58.0).is_hit());
  EXPECT_TRUE(world.cast(ray({0, 0, 2}, {1, 0, 0}), 60.0).is_hit());
}

TEST(World, returns_the_distance_to_a_box_turned_by_any_angle) {
  for (const double yaw : {0.0, 0.4, -1.1}) {
    const World world = world_of({box({20, 3, 5}, {4, 2, 5}, yaw)});
    // Straight at a face, along its normal, from 15 m off its middle.
    const Eigen::Vector3d normal(std::cos(yaw), std::sin(yaw), 0.0);
    const Eigen::Vector3d from = Eigen::Vector3d(20, 3, 2) - (4.0 + 15.0) * normal;
    const Hit hit = world.cast(ray(from, normal), kRange_m);
    EXPECT_NEAR(hit.range_m, 15.0, 1e-9);
    EXPECT_NEAR(hit.cos_incidence, 1.0, 1e-9);
    // 60 degrees off the normal: twice as far.
    const Eigen::Vector3d slanted =
        Eigen::AngleAxisd(std::numbers::pi / 3.0, Eigen::Vector3d::UnitZ()) * normal;
    const Eigen::Vector3d start = Eigen::Vector3d(20, 3, 2) - 4.0 * normal - 30.0 * slanted;
    EXPECT_NEAR(world.cast(ray(start, slanted), kRange_m).range_m, 30.0, 1e-9);
    EXPECT_NEAR(world.cast(ray(start, slanted), kRange_m).cos_incidence, 0.5, 1e-9);
  }
}

TEST(World, returns_the_distance_to_a_cylinder) {
  Shape pole;
  pole.kind = Shape::Kind::kCylinder;
  pole.centre_m = {10, 0, 3};
  pole.half_m = {0.2, 0.2, 3};
  const World world = world_of({pole});
  EXPECT_NEAR(world.cast(ray({0, 0, 2}, {1, 0, 0}), kRange_m).range_m, 9.8, 1e-9);
  // 0.12 m off the axis: 10 - sqrt(0.2^2 - 0.12^2).
  const Hit hit = world.cast(ray({0, 0.12, 2}, {1, 0, 0}), kRange_m);
  EXPECT_NEAR(hit.range_m, 10.0 - 0.16, 1e-9);
  EXPECT_NEAR(hit.cos_incidence, 0.8, 1e-9);
  EXPECT_FALSE(world.cast(ray({0, 0.21, 2}, {1, 0, 0}), kRange_m).is_hit());
  EXPECT_FALSE(world.cast(ray({0, 0, 6.1}, {1, 0, 0}), kRange_m).is_hit());
}

TEST(World, sees_the_nearest_of_many_things_as_a_search_without_cells_does) {
  Random random(9);
  std::vector<Shape> shapes;
  for (int i = 0; i < 150; ++i) {
    shapes.push_back(box({random.uniform(-60, 60), random.uniform(-60, 60), random.uniform(0, 4)},
                         {random.uniform(0.1, 5), random.uniform(0.1, 5), random.uniform(0.1, 3)},
                         random.uniform(0, 6)));
  }
  const World world = world_of(shapes);
  int hits = 0;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    const Ray r = ray({random.uniform(-70, 70), random.uniform(-70, 70), random.uniform(0.5, 4)},
                      {random.normal(), random.normal(), 0.1 * random.normal()},
                      i);
    Hit expected;
    expected.range_m = kRange_m;
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      intersect(shapes[k], k, r, expected);
    }
    if (r.direction.z() < 0.0) {
      expected.range_m = std::min(expected.range_m, -r.origin_m.z() / r.direction.z());
    }
    const Hit hit = world.cast(r, kRange_m);
    ASSERT_EQ(hit.is_hit(), expected.range_m < kRange_m) << i;
    if (hit.is_hit()) {
      ++hits;
      ASSERT_NEAR(hit.range_m, expected.range_m, 1e-4) << i;
    }
  }
  EXPECT_GT(hits, 10000);
}

TEST(World, meets_rolling_ground_where_a_fine_march_along_the_ray_does) {
  WorldConfig config;
  config.relief_amplitude_m = 1.5;
  config.relief_wavelength_m = 80.0;
  const Relief relief(config, 5);
  const World world = world_of({}, config);
  constexpr double kGrid_m =
      0.01;  // what sampling the ground every metre costs along a grazing ray
  Random random(4);
  int hits = 0;
  for (int i = 0; i < 400; ++i) {
    const double azimuth = random.uniform(0.0, 2.0 * std::numbers::pi);
    const double elevation = random.uniform(-0.25, 0.02);
    const Eigen::Vector3d from(0, 0, relief.height_m(0, 0) + 1.8);
    const Ray r = ray(from,
                      {std::cos(elevation) * std::cos(azimuth),
                       std::cos(elevation) * std::sin(azimuth),
                       std::sin(elevation)});
    double expected = std::numeric_limits<double>::infinity();
    for (double t = 0.0; t < kRange_m; t += 0.005) {
      const Eigen::Vector3d p = from + t * r.direction;
      if (p.z() < relief.height_m(p.x(), p.y())) {
        expected = t;
        break;
      }
    }
    const Hit hit = world.cast(r, kRange_m);
    if (std::isinf(expected) || expected > 99.0) {
      continue;
    }
    ++hits;
    ASSERT_TRUE(hit.is_hit()) << i;
    EXPECT_NEAR(hit.range_m, expected, 0.005 + kGrid_m / hit.cos_incidence) << i;
  }
  EXPECT_GT(hits, 200);
}

TEST(World, lets_light_through_leaves_as_the_mean_free_path_says) {
  Shape crown;
  crown.kind = Shape::Kind::kFoliage;
  crown.centre_m = {10, 0, 4};
  crown.half_m = {2, 2, 1.5};
  crown.free_path_m = 2.0;
  const World world = world_of({crown});
  constexpr int kRays = 20000;
  int through = 0;
  double nearest = kRange_m;
  double farthest = 0.0;
  for (std::uint64_t key = 0; key < kRays; ++key) {
    const Hit hit = world.cast(ray({0, 0, 4}, {1, 0, 0}, key), kRange_m);
    through += hit.is_hit() ? 0 : 1;
    if (hit.is_hit()) {
      nearest = std::min(nearest, hit.range_m);
      farthest = std::max(farthest, hit.range_m);
    }
  }
  // Beer and Lambert: exp(-4 m / 2 m); five standard deviations of a share of 20000.
  const double share = std::exp(-2.0);
  EXPECT_NEAR(
      static_cast<double>(through) / kRays, share, 5.0 * std::sqrt(share * (1.0 - share) / kRays));
  EXPECT_GE(nearest, 8.0);
  EXPECT_LE(farthest, 12.0);
}

}  // namespace trigpoint::simulator
