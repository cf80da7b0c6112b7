// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "local_map.hpp"
#include "surfel_points.hpp"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <thread>
#include <tuple>

namespace trigpoint::lio_mapper {
namespace {

constexpr double kSurfelNoise_m = 0.02;  // a spinning LiDAR's range noise

/// A square patch of a plane through `origin`, spanned by `u` and `v` (unit vectors), with noise
/// across it.
PointCloud patch(const Eigen::Vector3d& origin,
                 const Eigen::Vector3d& u,
                 const Eigen::Vector3d& v,
                 double side_m,
                 int points,
                 double noise_m,
                 unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> along(0.0, side_m);
  std::normal_distribution<double> across(0.0, 1.0);
  const Eigen::Vector3d normal = u.cross(v);
  PointCloud cloud;
  for (int i = 0; i < points; ++i) {
    const double a = along(random);
    const double b = along(random);
    cloud.push_back(point_of(origin + a * u + b * v + noise_m * across(random) * normal));
  }
  return cloud;
}

PointCloud ground(double z_m, unsigned seed, double noise_m = kSurfelNoise_m) {
  return patch({-10.0, -10.0, z_m},
               Eigen::Vector3d::UnitX(),
               Eigen::Vector3d::UnitY(),
               20.0,
               40000,
               noise_m,
               seed);
}

double height_at(const PlaneMatch& plane, double x, double y) {
  return -(plane.offset_m + plane.normal.x() * x + plane.normal.y() * y) / plane.normal.z();
}

bool same_bits(const PlaneMatch& a, const PlaneMatch& b) {
  return a.normal == b.normal && a.offset_m == b.offset_m && a.thickness2_m2 == b.thickness2_m2;
}

struct HeightErrors {
  double mean{0.0};
  double rms{0.0};
  int matched{0};
};

/// Errors of the matched planes' heights over the middle of ground(z_m), asked from `above_m`.
HeightErrors height_errors(const LocalMap& map, double z_m, double above_m) {
  HeightErrors errors;
  for (const Eigen::Vector3d& p : random_points(2000, 8.0, 5)) {
    PlaneMatch plane;
    if (map.match({p.x(), p.y(), z_m + above_m}, plane)) {
      const double error = height_at(plane, p.x(), p.y()) - z_m;
      errors.mean += error;
      errors.rms += error * error;
      ++errors.matched;
    }
  }
  errors.mean /= errors.matched;
  errors.rms = std::sqrt(errors.rms / errors.matched);
  return errors;
}

TEST(SurfelMap, is_empty_before_the_first_point_and_matches_nothing) {
  const auto map = make_surfel_map({});
  PlaneMatch plane;
  EXPECT_TRUE(map->empty());
  EXPECT_FALSE(map->match({0.0, 0.0, 0.0}, plane));
}

// Leaf means of about 25 points with 20 mm noise scatter by 4 mm, planes of 25 leaves by 1 mm.
constexpr double kPlaneMean_m = 0.001;
constexpr double kPlaneRms_m = 0.003;

TEST(SurfelMap, recovers_level_ground_to_millimetres_at_any_height) {
  // 0.0 and 1.5 run along the faces of parents, 0.5 along those of leaves, the others between.
  for (const double z_m : {0.0, 0.02, 0.25, 0.5, 0.75, 1.48, 1.5, 1.52, -1.5}) {
    const auto map = make_surfel_map({});
    map->insert(ground(z_m, 3));
    const HeightErrors errors = height_errors(*map, z_m, 0.0);
    EXPECT_EQ(errors.matched, 2000) << z_m;
    EXPECT_NEAR(errors.mean, 0.0, kPlaneMean_m) << z_m;
    EXPECT_LT(errors.rms, kPlaneRms_m) << z_m;
  }
}

TEST(SurfelMap, finds_the_ground_also_from_behind_a_face) {
  // A pose that is off by decimetres puts points into a parent that holds nothing at all.
  for (const double above_m : {-0.3, -0.1, 0.1, 0.3}) {
    const auto map = make_surfel_map({});
    map->insert(ground(1.5, 4));
    const HeightErrors errors = height_errors(*map, 1.5, above_m);
    EXPECT_EQ(errors.matched, 2000) << above_m;
    EXPECT_NEAR(errors.mean, 0.0, kPlaneMean_m) << above_m;
    EXPECT_LT(errors.rms, kPlaneRms_m) << above_m;
  }
}

TEST(SurfelMap, recovers_an_inclined_plane) {
  const Eigen::Vector3d u = Eigen::Vector3d(1.0, 0.2, 0.3).normalized();
  const Eigen::Vector3d v = u.cross(Eigen::Vector3d(0.1, -0.4, 0.9)).normalized();
  const Eigen::Vector3d normal = u.cross(v);
  const Eigen::Vector3d origin(100.3, -250.7, 12.9);
  const auto map = make_surfel_map({});
  map->insert(patch(origin, u, v, 16.0, 30000, kSurfelNoise_m, 6));
  constexpr double kNormal_rad = 0.01;
  double squares = 0.0;
  int matched = 0;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d p = origin + (2.0 + 0.012 * i) * u + (2.0 + 0.37 * (i % 33)) * v;
    PlaneMatch plane;
    if (map->match(p, plane)) {
      ++matched;
      squares += std::pow(plane.normal.dot(p) + plane.offset_m, 2);
      EXPECT_GT(std::abs(plane.normal.dot(normal)), std::cos(kNormal_rad));
      EXPECT_NEAR(plane.normal.norm(), 1.0, 1e-7);  // kept as float
    }
  }
  EXPECT_GT(matched, 990);
  EXPECT_LT(std::sqrt(squares / matched), kPlaneRms_m);
}

TEST(SurfelMap, thickness_is_the_variance_of_the_leaf_means) {
  // One point per leaf, so that means are points: then the variance is that of the noise.
  constexpr double kThick_m = 0.03;
  std::mt19937 random(8);
  std::normal_distribution<double> across(0.0, kThick_m);
  PointCloud cloud;
  for (double x = -19.75; x < 20.0; x += kLeaf_m) {
    for (double y = -19.75; y < 20.0; y += kLeaf_m) {
      cloud.push_back(point_of({x, y, 0.75 + across(random)}));
    }
  }
  const auto map = make_surfel_map({});
  map->insert(cloud);
  double sum = 0.0;
  int matched = 0;
  for (double x = -16.0; x < 16.0; x += kParent_m) {
    for (double y = -16.0; y < 16.0; y += kParent_m) {
      PlaneMatch plane;
      ASSERT_TRUE(map->match({x, y, 0.75}, plane));
      sum += plane.thickness2_m2;
      ++matched;
    }
  }
  // 25 leaves less 3 parameters: 22/25 of the variance; 500 planes know it to a few per cent.
  constexpr double kRelative = 0.1;
  const double expected = kThick_m * kThick_m * 22.0 / 25.0;
  EXPECT_NEAR(sum / matched, expected, kRelative * expected);
}

TEST(SurfelMap, a_perfect_plane_still_has_some_thickness) {
  const auto map = make_surfel_map({});
  map->insert(ground(0.75, 9, 0.0));
  PlaneMatch plane;
  ASSERT_TRUE(map->match({0.1, 0.1, 0.75}, plane));
  EXPECT_GT(plane.thickness2_m2, 1e-6);
}

/// Two walls that meet at x = y = 0.2, and the ground below: a street corner seen from outside.
PointCloud corner(unsigned seed) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  PointCloud cloud =
      patch({0.2, 0.2, 0.0}, Eigen::Vector3d::UnitY(), z, 9.0, 12000, kSurfelNoise_m, seed);
  const PointCloud second =
      patch({0.2, 0.2, 0.0}, Eigen::Vector3d::UnitX(), z, 9.0, 12000, kSurfelNoise_m, seed + 1);
  cloud.insert(cloud.end(), second.begin(), second.end());
  return cloud;
}

TEST(SurfelMap, gives_points_beside_a_corner_the_wall_they_lie_on) {
  const auto map = make_surfel_map({});
  map->insert(corner(10));
  constexpr double kRight_m = 0.05;
  int matched = 0;
  int right = 0;
  for (double along = 0.1; along < 6.0; along += 0.05) {
    for (double z = 0.6; z < 8.0; z += 0.31) {
      for (const Eigen::Vector3d& p :
           {Eigen::Vector3d(0.2, 0.2 + along, z), Eigen::Vector3d(0.2 + along, 0.2, z)}) {
        PlaneMatch plane;
        if (map->match(p, plane)) {
          ++matched;
          right += std::abs(plane.normal.dot(p) + plane.offset_m) < kRight_m ? 1 : 0;
        }
      }
    }
  }
  const int asked = 2 * 118 * 24;
  // The parent that holds the edge itself has no plane: what its neighbours do not reach is left
  // out.
  EXPECT_GT(matched, 0.85 * asked);
  EXPECT_GT(right, 0.99 * matched);
}

TEST(SurfelMap, sees_no_plane_in_a_pole) {
  PointCloud pole;
  for (int i = 0; i < 2000; ++i) {
    pole.push_back(point_of({0.7 + 0.05 * std::cos(i), 0.7 + 0.05 * std::sin(i), 0.004 * i}));
  }
  const auto map = make_surfel_map({});
  map->insert(pole);
  PlaneMatch plane;
  for (double z = 0.0; z < 8.0; z += 0.1) {
    EXPECT_FALSE(map->match({0.7, 0.7, z}, plane)) << z;
  }
}

TEST(SurfelMap, sees_hardly_a_plane_in_a_filled_volume) {
  PointCloud blob;
  for (const Eigen::Vector3d& p : random_points(40000, 3.0, 11)) {
    blob.push_back(point_of(p));
  }
  for (const bool nearest_points : {false, true}) {
    SurfelMapConfig config;
    config.nearest_points = nearest_points;
    const auto map = make_surfel_map(config);
    map->insert(blob);
    int matched = 0;
    for (const Eigen::Vector3d& p : random_points(1000, 2.0, 12)) {
      PlaneMatch plane;
      matched += map->match(p, plane) ? 1 : 0;
    }
    // Five points at random lie within 0.1 m of a plane now and then; surfels never.
    EXPECT_LE(matched, nearest_points ? 100 : 0);
  }
}

/// A trunk, 1.2 m thick: no parent holds a plane, five neighbouring points do.
TEST(SurfelMap, matches_what_is_bent_by_its_nearest_points) {
  PointCloud trunk;
  for (int i = 0; i < 6000; ++i) {
    const double a = 0.37 * i;
    trunk.push_back(point_of({5.1 + 0.6 * std::cos(a), 5.2 + 0.6 * std::sin(a), 0.001 * i}));
  }
  std::array<int, 2> matched{};
  for (const bool nearest_points : {false, true}) {
    SurfelMapConfig config;
    config.nearest_points = nearest_points;
    const auto map = make_surfel_map(config);
    map->insert(trunk);
    for (double a = 0.0; a < 6.28; a += 0.1) {
      PlaneMatch plane;
      const Eigen::Vector3d p(5.1 + 0.6 * std::cos(a), 5.2 + 0.6 * std::sin(a), 3.0);
      const bool near =
          map->match(p, plane) && std::abs(plane.normal.dot(p) + plane.offset_m) < 0.1;
      matched[nearest_points ? 1 : 0] += near ? 1 : 0;
    }
  }
  EXPECT_GT(matched[1], matched[0] + 15) << matched[0] << " of 63 without them";
}

/// Where the surfaces are, whatever the leaves: heights of the ground under a grid of places.
TEST(SurfelMap, is_moved_as_a_whole_and_keeps_its_surfaces) {
  const auto map = make_surfel_map({});
  map->insert(ground(0.75, 15));
  const std::size_t leaves = map->size();
  const Pose T_new_old(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ())),
                       {103.3, -20.2, 4.0});
  map->transform(T_new_old);
  EXPECT_NEAR(static_cast<double>(map->size()),
              static_cast<double>(leaves),
              0.25 * static_cast<double>(leaves));
  constexpr double kSame_m = 0.01;
  for (double x = -8.0; x < 8.0; x += 1.3) {
    PlaneMatch plane;
    const Eigen::Vector3d p = T_new_old * Eigen::Vector3d(x, 0.5 * x, 0.75);
    ASSERT_TRUE(map->match(p, plane));
    EXPECT_NEAR(plane.normal.dot(p) + plane.offset_m, 0.0, kSame_m);
  }
}

TEST(SurfelMap, begins_anew_from_other_points) {
  const auto map = make_surfel_map({});
  map->insert(ground(0.75, 17));
  map->rebuild(ground(5.2, 18));
  PlaneMatch plane;
  EXPECT_FALSE(map->match({0.3, 0.3, 0.75}, plane));
  EXPECT_TRUE(map->match({0.3, 0.3, 5.2}, plane));
  EXPECT_GT(map->memory_bytes(), 0U);
}

TEST(SurfelMap, gives_no_plane_that_is_farther_than_the_limit) {
  const auto map = make_surfel_map({});
  map->insert(ground(0.75, 13));
  PlaneMatch plane;
  EXPECT_TRUE(map->match({0.3, 0.3, 0.75 + 0.45}, plane));
  EXPECT_FALSE(map->match({0.3, 0.3, 0.75 + 0.55}, plane));
}

TEST(SurfelMap, ignores_what_is_not_finite_or_absurdly_far) {
  const auto map = make_surfel_map({});
  const float nan = std::numeric_limits<float>::quiet_NaN();
  map->insert({{nan, 0, 0, 0}, {0, INFINITY, 0, 0}, {0, 0, 1e12F, 0}, {1, 1, 1, nan}});
  EXPECT_EQ(map->size(), 1U);
  EXPECT_EQ(map->points()[0].intensity, 0.0F);
  PlaneMatch plane;
  EXPECT_FALSE(map->match({kNaN, 0.0, 0.0}, plane));
  EXPECT_FALSE(map->match({0.0, 1e300, 0.0}, plane));
}

TEST(SurfelMap, freezes_a_leaf_at_its_capacity) {
  SurfelMapConfig config;
  config.leaf_capacity = 4;
  const auto map = make_surfel_map(config);
  const PointXyzi low{0.25F, 0.25F, 0.10F, 2.0F};
  const PointXyzi high{0.25F, 0.25F, 0.40F, 4.0F};
  map->insert({low, low, high, high, high, high, high});
  ASSERT_EQ(map->size(), 1U);
  EXPECT_NEAR(map->points()[0].z, 0.25, 1e-6);
  EXPECT_EQ(map->points()[0].intensity, 2.0F);  // of the point nearest the leaf's centre
}

TEST(SurfelMap, notices_points_that_come_after_a_match) {
  const auto map = make_surfel_map({});
  PlaneMatch plane;
  map->insert(ground(0.70, 14, 0.0));
  ASSERT_TRUE(map->match({0.1, 0.1, 0.75}, plane));
  EXPECT_NEAR(height_at(plane, 0.1, 0.1), 0.70, 1e-5);
  SurfelMapConfig uncapped;
  uncapped.leaf_capacity = 100000;
  const auto both = make_surfel_map(uncapped);
  both->insert(ground(0.70, 14, 0.0));
  ASSERT_TRUE(both->match({0.1, 0.1, 0.75}, plane));
  both->insert(ground(0.80, 14, 0.0));
  ASSERT_TRUE(both->match({0.1, 0.1, 0.75}, plane));
  EXPECT_NEAR(height_at(plane, 0.1, 0.1), 0.75, 1e-5);
}

TEST(SurfelMap, prune_forgets_exactly_what_is_outside) {
  PointCloud blob;
  for (const Eigen::Vector3d& p : random_points(20000, 12.0, 15)) {
    blob.push_back(point_of(away_from_faces(p)));
  }
  const auto map = make_surfel_map({});
  map->insert(blob);
  const Eigen::Vector3d center(2.3, -1.1, 0.4);
  constexpr double kHalf_m = 6.2;
  std::map<LeafKey, PointXyzi> expected;
  for (const PointXyzi& p : map->points()) {
    if ((p.position().cast<double>() - center).cwiseAbs().maxCoeff() <= kHalf_m) {
      expected[leaf_of(p, kLeaf_m)] = p;
    }
  }
  map->prune(center, kHalf_m);
  ASSERT_GT(expected.size(), 1000U);
  EXPECT_EQ(map->size(), expected.size());
  const PointCloud left = map->points();
  ASSERT_EQ(left.size(), expected.size());
  for (const PointXyzi& p : left) {
    ASSERT_EQ(expected.count(leaf_of(p, kLeaf_m)), 1U);
    EXPECT_EQ(expected[leaf_of(p, kLeaf_m)].position(), p.position());
  }
}

TEST(SurfelMap, after_prune_matches_as_if_the_rest_had_never_been) {
  // A capacity of one makes the leaf means the points themselves, so a fresh map can be made of
  // them.
  SurfelMapConfig config;
  config.leaf_capacity = 1;
  const auto pruned = make_surfel_map(config);
  for (PointCloud cloud : {ground(0.7, 16), corner(17)}) {
    for (PointXyzi& p : cloud) {
      p = point_of(away_from_faces(p.position().cast<double>()));
    }
    pruned->insert(cloud);
  }
  PlaneMatch warm;
  for (const Eigen::Vector3d& p : random_points(3000, 9.0, 18)) {
    pruned->match(p, warm);
  }
  pruned->prune({1.0, 1.0, 0.0}, 4.3);
  const auto fresh = make_surfel_map(config);
  fresh->insert(pruned->points());
  int matched = 0;
  for (const Eigen::Vector3d& p : random_points(3000, 6.0, 19)) {
    PlaneMatch a;
    PlaneMatch b;
    const bool found = pruned->match(p, a);
    ASSERT_EQ(found, fresh->match(p, b));
    if (found) {
      ++matched;
      EXPECT_NEAR(a.normal.dot(p) + a.offset_m, b.normal.dot(p) + b.offset_m, 1e-6);
    }
  }
  EXPECT_GT(matched, 100);
}

TEST(SurfelMap, can_be_filled_again_after_everything_is_pruned) {
  const auto map = make_surfel_map({});
  map->insert(ground(0.7, 20));
  map->prune({1000.0, 0.0, 0.0}, 5.0);
  EXPECT_TRUE(map->empty());
  PlaneMatch plane;
  EXPECT_FALSE(map->match({0.0, 0.0, 0.7}, plane));
  map->insert(ground(0.7, 20));
  EXPECT_TRUE(map->match({0.0, 0.0, 0.7}, plane));
}

/// Within the limit there is no plane, whatever lies just beyond it.
TEST(SurfelMap, a_narrow_limit_holds_also_for_the_parent_of_the_point) {
  SurfelMapConfig config;
  config.max_residual_m = 0.05;
  config.nearest_points = false;
  const auto map = make_surfel_map(config);
  map->insert(ground(0.4, 31));
  int matched = 0;
  for (const Eigen::Vector3d& p : random_points(200, 5.0, 32)) {
    PlaneMatch plane;
    EXPECT_FALSE(map->match({p.x(), p.y(), 0.4 + 0.075}, plane));
    matched += map->match({p.x(), p.y(), 0.4 + 0.01}, plane) ? 1 : 0;
  }
  EXPECT_GT(matched, 150);
}

/// Few changes leave a plane as it is; more of them than an eighth of its leaves do not.
TEST(SurfelMap, fits_a_plane_again_only_when_enough_of_its_leaves_have_changed) {
  SurfelMapConfig config;
  config.nearest_points = false;
  const auto map = make_surfel_map(config);
  const auto raise = [&](int x, int y) {  // a second point for one leaf, 6 cm higher
    map->insert({point_of({0.5 * x + 0.25, 0.5 * y + 0.25, 0.31})});
  };
  PointCloud floor;
  for (int x = -1; x < 4; ++x) {
    for (int y = -1; y < 4; ++y) {
      floor.push_back(point_of({0.5 * x + 0.25, 0.5 * y + 0.25, 0.25}));
    }
  }
  map->insert(floor);  // 25 leaves: three changes are borne
  PlaneMatch first;
  const Eigen::Vector3d asked(0.75, 0.75, 0.25);
  ASSERT_TRUE(map->match(asked, first));
  PlaneMatch plane;
  for (int i = 0; i < 3; ++i) {
    raise(0, i);
    ASSERT_TRUE(map->match(asked, plane));
    EXPECT_TRUE(same_bits(plane, first)) << i;
  }
  raise(1, 0);
  ASSERT_TRUE(map->match(asked, plane));
  EXPECT_FALSE(same_bits(plane, first));
  EXPECT_NEAR(plane.normal.dot(asked) + plane.offset_m, 0.0, 0.03);
}

TEST(SurfelMap, same_input_gives_the_same_bits_whoever_asked_before) {
  const auto first = make_surfel_map({});
  const auto second = make_surfel_map({});
  const PointCloud a = ground(0.0, 21);
  const PointCloud b = corner(22);
  PlaneMatch plane;
  for (const auto& map : {first.get(), second.get()}) {
    map->insert(a);
    if (map == second.get()) {
      for (const Eigen::Vector3d& p : random_points(500, 8.0, 23)) {
        map->match(p, plane);
      }
    }
    map->insert(b);
    map->prune({0.0, 0.0, 0.0}, 8.0);
  }
  for (const Eigen::Vector3d& p : random_points(2000, 9.0, 24)) {
    PlaneMatch one;
    PlaneMatch two;
    ASSERT_EQ(first->match(p, one), second->match(p, two));
    EXPECT_TRUE(same_bits(one, two));
  }
}

TEST(SurfelMap, threads_that_match_at_once_get_the_bits_of_one_thread) {
  const auto map = make_surfel_map({});
  const auto reference = make_surfel_map({});
  for (const auto& m : {map.get(), reference.get()}) {
    m->insert(ground(0.0, 25));
    m->insert(corner(26));
  }
  const auto asked = random_points(20000, 9.0, 27);
  std::vector<std::vector<PlaneMatch>> answers(4, std::vector<PlaneMatch>(asked.size()));
  std::vector<std::thread> threads;
  for (auto& answer : answers) {
    threads.emplace_back([&asked, &answer, &map] {
      for (std::size_t i = 0; i < asked.size(); ++i) {
        map->match(asked[i], answer[i]);
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  for (std::size_t i = 0; i < asked.size(); ++i) {
    PlaneMatch expected;
    reference->match(asked[i], expected);
    for (const auto& answer : answers) {
      ASSERT_TRUE(same_bits(answer[i], expected)) << i;
    }
  }
}

}  // namespace
}  // namespace trigpoint::lio_mapper
