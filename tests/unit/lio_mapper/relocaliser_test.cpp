// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Worlds of points drawn anew for map and scan: no two of them are the same leaf.
#include "relocaliser.hpp"

#include "trigpoint/base/so3.hpp"

#include "likelihood_field.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <limits>
#include <random>

namespace trigpoint::lio_mapper {
namespace {

using Eigen::Vector3d;

constexpr double kBaseHeight_m = 1.0;

class Draw {
 public:
  explicit Draw(unsigned seed) : random_(seed) {}

  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  double normal(double sigma) { return std::normal_distribution<double>(0.0, sigma)(random_); }

  Vector3d blob(const Vector3d& centre_m, double sigma_m) {
    return centre_m + Vector3d(normal(sigma_m), normal(sigma_m), normal(sigma_m));
  }

 private:
  std::mt19937 random_;
};

void add(PointCloud& cloud, const Vector3d& p) {
  cloud.push_back(
      {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()), 1.0F});
}

/// Flat ground at z = 0 within 40 m.
void add_ground(PointCloud& cloud, Draw& draw) {
  for (int i = 0; i < 6000; ++i) {
    add(cloud, {draw.between(-40.0, 40.0), draw.between(-40.0, 40.0), draw.normal(0.02)});
  }
}

/// Thin trunks and loose crowns, a hundred of them.
PointCloud forest(unsigned points_seed) {
  Draw places(5);
  Draw draw(points_seed);
  PointCloud cloud;
  add_ground(cloud, draw);
  for (int tree = 0; tree < 100; ++tree) {
    const Vector3d foot(places.between(-40.0, 40.0), places.between(-40.0, 40.0), 0.0);
    const Vector3d crown = foot + Vector3d(0.0, 0.0, places.between(3.0, 5.0));
    for (int i = 0; i < 30; ++i) {
      const double angle_rad = draw.between(-3.14, 3.14);
      add(cloud,
          foot + Vector3d(0.15 * std::cos(angle_rad),
                          0.15 * std::sin(angle_rad),
                          draw.between(0.0, 3.0)));
    }
    for (int i = 0; i < 500; ++i) {
      add(cloud, draw.blob(crown, 0.8));
    }
  }
  return cloud;
}

/// Two walls along x, 6 m apart, without an end in sight.
PointCloud corridor(unsigned points_seed) {
  Draw draw(points_seed);
  PointCloud cloud;
  add_ground(cloud, draw);
  for (int i = 0; i < 12000; ++i) {
    const double side_m = i % 2 == 0 ? -3.0 : 3.0;
    add(cloud, {draw.between(-70.0, 70.0), side_m + draw.normal(0.02), draw.between(0.0, 3.0)});
  }
  return cloud;
}

/// What a robot at a pose sees of a world within 30 m, axes of base.
PointCloud seen_from(const PointCloud& world, const Pose& T_odom_base) {
  PointCloud seen;
  const Pose T_base_odom = T_odom_base.inverse();
  for (const PointXyzi& point : world) {
    const Vector3d p = T_base_odom * point.position().cast<double>();
    if (p.norm() < 30.0) {
      add(seen, p);
    }
  }
  return seen;
}

Pose standing_at(double x_m, double y_m, double yaw_rad) {
  return {from_yaw(yaw_rad), {x_m, y_m, kBaseHeight_m}};
}

RegistrationResult look(const PointCloud& map_points,
                        const PointCloud& scan_base,
                        const SearchArea& area,
                        std::size_t threads = 2) {
  const auto map = make_surfel_map({});
  map->insert(map_points);
  Workers workers(threads);
  const LevelScan scan{scan_base, Eigen::Quaterniond::Identity(), Vector3d::Zero()};
  return register_scan(scan, *map, area, {}, {}, workers);
}

double away_m(const RegistrationResult& result, const Pose& truth) {
  return (result.best->T_odom_base.p - truth.p).norm();
}

double turned_rad(const RegistrationResult& result, const Pose& truth) {
  return result.best->T_odom_base.q.angularDistance(truth.q);
}

/// The same points, moved in height by a function of the place.
template <typename Height>
PointCloud lifted(PointCloud cloud, Height height_m) {
  for (PointXyzi& point : cloud) {
    point.z += static_cast<float>(height_m(point.x));
  }
  return cloud;
}

void expect_found_at(const RegistrationResult& result, const Pose& truth) {
  ASSERT_TRUE(result.accepted) << result.obstacle;
  EXPECT_LT(away_m(result, truth), 0.2);
  EXPECT_LT(turned_rad(result, truth), 0.015);
}

TEST(LikelihoodField, is_the_gaussian_of_the_distance_to_the_nearest_point_up_to_its_cells) {
  Draw draw(1);
  PointCloud points;
  for (int i = 0; i < 40; ++i) {
    add(points, {draw.between(-4.0, 4.0), draw.between(-4.0, 4.0), draw.between(-4.0, 4.0)});
  }
  const LikelihoodField field(points, Vector3d::Zero(), 6.0);
  // Both points stand for the middles of their cells, half a diagonal from each at most.
  const double rounding_m = std::sqrt(3.0) * LikelihoodField::kCell_m;
  const auto gaussian = [](double d_m) {
    const double ratio = std::max(0.0, d_m) / LikelihoodField::kSigma_m;
    return std::exp(-0.5 * ratio * ratio);
  };
  constexpr double kTail = 0.012;  // beyond three sigmas, and of the 256 levels
  int inside = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vector3d p(draw.between(-5.0, 5.0), draw.between(-5.0, 5.0), draw.between(-5.0, 5.0));
    double nearest_m = std::numeric_limits<double>::infinity();
    for (const PointXyzi& point : points) {
      nearest_m = std::min(nearest_m, (point.position().cast<double>() - p).norm());
    }
    const double value = field.at(p);
    EXPECT_LE(value, gaussian(nearest_m - rounding_m) + kTail);
    EXPECT_GE(value, gaussian(nearest_m + rounding_m) - kTail);
    inside += value > 0.2 ? 1 : 0;
  }
  EXPECT_GT(inside, 20);
  EXPECT_EQ(field.at(points.front().position().cast<double>()), 1.0);
}

TEST(LikelihoodField, is_nothing_beyond_its_reach_and_for_no_number) {
  PointCloud points;
  add(points, {0.0, 0.0, 0.0});
  add(points, {50.0, 0.0, 0.0});
  points.push_back({std::numeric_limits<float>::quiet_NaN(), 0.0F, 0.0F, 1.0F});
  const LikelihoodField field(points, Vector3d::Zero(), 5.0);
  EXPECT_EQ(field.at(Vector3d::Zero()), 1.0);
  EXPECT_EQ(field.at({50.0, 0.0, 0.0}), 0.0);
  EXPECT_EQ(field.at({0.0, 0.0, -1e9}), 0.0);
  EXPECT_EQ(field.at({std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0}), 0.0);
}

TEST(Relocaliser, finds_its_place_among_trees_within_10_m_and_30_degrees) {
  const PointCloud map = forest(11);
  Draw draw(3);
  for (unsigned i = 0; i < 10; ++i) {
    const Pose truth =
        standing_at(draw.between(-8.0, 8.0), draw.between(-8.0, 8.0), draw.between(-3.0, 3.0));
    const double aside_rad = draw.between(-3.14, 3.14);
    const double aside_m = draw.between(0.0, 9.5);
    const Pose expected = standing_at(truth.p.x() + aside_m * std::cos(aside_rad),
                                      truth.p.y() + aside_m * std::sin(aside_rad),
                                      yaw_of(truth.q) + draw.between(-0.5, 0.5));
    const RegistrationResult result =
        look(map, seen_from(forest(20 + i), truth), {{expected}, 10.0, 0.5236});
    expect_found_at(result, truth);
    EXPECT_EQ(result.best->centre.p, expected.p);
    EXPECT_LT(std::sqrt(result.best->spread_m2.diagonal().maxCoeff()), 0.35);
  }
}

TEST(Relocaliser, finds_its_place_on_a_slope) {
  const auto slope = [](double x_m) { return 0.08 * x_m; };
  Pose truth = standing_at(4.0, -3.0, 0.4);
  truth.p.z() += slope(truth.p.x());
  const RegistrationResult result = look(lifted(forest(11), slope),
                                         seen_from(lifted(forest(50), slope), truth),
                                         {{standing_at(-1.0, 2.0, 0.0)}, 10.0, 0.5236});
  expect_found_at(result, truth);
}

/// Plain walls, 8 m high, on a hill of 15 %: at any height they look the same.
PointCloud courtyards(unsigned points_seed) {
  Draw draw(points_seed);
  PointCloud cloud;
  add_ground(cloud, draw);
  for (int i = 0; i < 8000; ++i) {
    const double along_m = draw.between(-15.0, 25.0);
    const double z_m = draw.between(0.0, 8.0);
    add(cloud, {along_m, 8.0 + draw.normal(0.02), z_m});
    add(cloud, {25.0 + draw.normal(0.02), draw.between(-20.0, 8.0), z_m});
    add(cloud, {-12.0 + draw.normal(0.02), draw.between(-20.0, -4.0), z_m});
  }
  return lifted(cloud, [](double x_m) { return 0.15 * x_m; });
}

TEST(Relocaliser, does_not_float_between_walls_on_a_slope) {
  for (const double beside_m : {-9.0, -5.0, 5.0, 9.0}) {
    Pose truth = standing_at(6.0, -3.0, 0.0);
    truth.p.z() += 0.15 * truth.p.x();
    Pose expected = standing_at(truth.p.x() + beside_m, -2.0, 0.1);
    expected.p.z() += 0.15 * expected.p.x();
    const RegistrationResult result =
        look(courtyards(1), seen_from(courtyards(2), truth), {{expected}, 10.0, 0.5236});
    expect_found_at(result, truth);
    EXPECT_NEAR(result.best->T_odom_base.p.z(), truth.p.z(), 0.05);
  }
}

TEST(Relocaliser, takes_neither_of_two_places_in_a_small_area_that_holds_the_robot) {
  // Rows of thick trees, 3 m apart both ways.
  const auto orchard = [](unsigned points_seed) {
    Draw draw(points_seed);
    PointCloud cloud;
    add_ground(cloud, draw);
    for (int x = -12; x <= 12; ++x) {
      for (int y = -12; y <= 12; ++y) {
        for (int i = 0; i < 40; ++i) {
          add(cloud, draw.blob({3.0 * x, 3.0 * y, 2.0}, 0.3));
        }
      }
    }
    return cloud;
  };
  SearchArea area{{standing_at(0.0, 0.0, 0.0)}, 1.9, 0.2};
  area.holds_robot = true;
  const RegistrationResult result =
      look(orchard(1), seen_from(orchard(2), standing_at(1.5, 0.2, 0.0)), area);
  EXPECT_FALSE(result.accepted);
  EXPECT_GT(result.best->runner_up_share, 0.3);
}

TEST(Relocaliser, finds_its_place_above_another_floor) {
  Draw draw(6);
  PointCloud map = forest(11);
  PointCloud below;
  add_ground(below, draw);
  for (PointXyzi& point : below) {
    point.z -= 5.0F;
    map.push_back(point);
  }
  const Pose truth = standing_at(4.0, -3.0, 0.4);
  expect_found_at(
      look(map, seen_from(forest(50), truth), {{standing_at(-1.0, 2.0, 0.0)}, 10.0, 0.5236}),
      truth);
}

TEST(Relocaliser, believes_no_floor_of_several_that_are_alike) {
  PointCloud map = forest(11);
  for (const PointXyzi& point : lifted(forest(12), [](double) { return -8.0; })) {
    map.push_back(point);
  }
  const RegistrationResult result = look(map,
                                         seen_from(forest(50), standing_at(4.0, -3.0, 0.4)),
                                         {{standing_at(-1.0, 2.0, 0.0)}, 10.0, 0.5236});
  EXPECT_FALSE(result.accepted);
}

TEST(Relocaliser, refuses_an_area_without_a_centre) {
  EXPECT_THROW(look(forest(11), seen_from(forest(50), standing_at(0, 0, 0)), {}),
               std::invalid_argument);
}

TEST(Relocaliser, finds_its_place_from_a_wrong_height) {
  const Pose truth = standing_at(4.0, -3.0, 0.4);
  Pose expected = standing_at(-1.0, 2.0, 0.0);
  expected.p.z() += 3.0;
  expect_found_at(look(forest(11), seen_from(forest(50), truth), {{expected}, 10.0, 0.5236}),
                  truth);
}

TEST(Relocaliser, looks_about_every_centre_however_far_apart) {
  const Pose truth = standing_at(4.0, -3.0, 0.4);
  const SearchArea area{{standing_at(-25.0, 25.0, 0.0), standing_at(6.0, -6.0, 0.3)}, 5.0, 0.3};
  const RegistrationResult result = look(forest(11), seen_from(forest(50), truth), area);
  expect_found_at(result, truth);
  EXPECT_EQ(result.best->centre.p, area.centres_odom[1].p);
}

TEST(Relocaliser, believes_no_place_when_the_true_one_is_out_of_reach) {
  const PointCloud map = forest(11);
  for (unsigned i = 0; i < 5; ++i) {
    const double angle_rad = 1.2566 * i;
    const Pose elsewhere = standing_at(16.0 * std::cos(angle_rad), 16.0 * std::sin(angle_rad), 0.0);
    const RegistrationResult result = look(
        map, seen_from(forest(30 + i), standing_at(0.0, 0.0, 0.0)), {{elsewhere}, 10.0, 0.5236});
    EXPECT_FALSE(result.accepted);
    EXPECT_NE(result.obstacle.find("best place"), std::string::npos) << result.obstacle;
  }
}

TEST(Relocaliser, believes_no_place_along_a_corridor_that_has_no_end) {
  const Pose truth = standing_at(2.0, 0.5, 0.1);
  const RegistrationResult result =
      look(corridor(1), seen_from(corridor(2), truth), {{standing_at(0, 0, 0)}, 10.0, 0.5236});
  EXPECT_FALSE(result.accepted);
  ASSERT_TRUE(result.best);
  EXPECT_GT(result.best->share, 0.5);
  EXPECT_GT(result.best->runner_up_share, 0.5);
}

TEST(Relocaliser, goes_by_the_prediction_along_a_corridor_where_the_area_holds_the_robot) {
  SearchArea area{{standing_at(1.8, 0.0, 0.0)}, 1.0, 0.2};
  area.holds_robot = true;
  area.sigma_m = 0.25;
  const PointCloud map = corridor(1);
  double sum_m2 = 0.0;
  constexpr int kDraws = 20;
  for (unsigned i = 0; i < kDraws; ++i) {
    const Pose truth = standing_at(1.8, 0.3, 0.1);
    const RegistrationResult result = look(map, seen_from(corridor(100 + i), truth), area);
    ASSERT_TRUE(result.accepted) << result.obstacle;
    const Vector3d error_m = result.best->T_odom_base.p - truth.p;
    EXPECT_LT(std::abs(error_m.y()), 0.05);  // walls tell
    EXPECT_LT(turned_rad(result, truth), 0.01);
    EXPECT_LT(std::sqrt(result.best->spread_m2(1, 1)), 0.15);
    EXPECT_GT(std::sqrt(result.best->spread_m2(0, 0)), 0.15);
    EXPECT_LE(std::sqrt(result.best->spread_m2(0, 0)), 0.25);
    sum_m2 += error_m.x() * error_m.x();
  }
  const double rms_m = std::sqrt(sum_m2 / kDraws);
  std::cout << "along the corridor " << rms_m << " m rms from the prediction\n";
  EXPECT_LT(rms_m, 0.05);
}

/// What stands across the walls in two places only tells it to a tenth of the field's cells. (So
/// clear a scene needs no look around; the drives of lio_robustness_test do.)
TEST(Relocaliser, finds_its_place_along_a_street_by_what_little_stands_across_it) {
  const auto street = [](unsigned points_seed) {
    Draw draw(points_seed);
    PointCloud cloud = corridor(points_seed);
    for (int i = 0; i < 1200; ++i) {
      const bool far = i % 2 == 0;
      add(cloud,
          {(far ? 11.0 : -7.0) + draw.normal(0.01),
           far ? draw.between(1.5, 3.0) : draw.between(-3.0, -1.5),
           draw.between(0.0, 3.0)});
    }
    return cloud;
  };
  SearchArea area{{standing_at(1.8, 0.0, 0.0)}, 1.0, 0.2};
  area.holds_robot = true;
  area.sigma_m = 0.25;
  const PointCloud map = street(1);
  for (unsigned i = 0; i < 10; ++i) {
    const Pose truth = standing_at(1.6 + 0.08 * i, 0.3, 0.1);
    const RegistrationResult result = look(map, seen_from(street(100 + i), truth), area);
    ASSERT_TRUE(result.accepted) << result.obstacle;
    EXPECT_LT(std::abs(result.best->T_odom_base.p.x() - truth.p.x()), 0.03) << i;
  }
}

TEST(Relocaliser, says_that_a_wide_area_along_a_corridor_is_as_uncertain_as_wide) {
  SearchArea area{{standing_at(1.8, 0.0, 0.0)}, 5.0, 0.2};
  area.holds_robot = true;
  area.sigma_m = 2.25;
  const RegistrationResult result =
      look(corridor(1), seen_from(corridor(2), standing_at(2.0, 0.5, 0.1)), area);
  ASSERT_TRUE(result.accepted) << result.obstacle;
  EXPECT_GT(std::sqrt(result.best->spread_m2(0, 0)), 0.2 * area.radius_m);
}

TEST(Relocaliser, does_not_depend_on_the_number_of_threads) {
  const PointCloud map = forest(11);
  const PointCloud scan = seen_from(forest(40), standing_at(1.0, -2.0, 0.3));
  const SearchArea area{{standing_at(-2.0, 1.0, 0.0)}, 10.0, 0.5236};
  const RegistrationResult one = look(map, scan, area, 1);
  const RegistrationResult four = look(map, scan, area, 4);
  EXPECT_EQ(one.best->T_odom_base.p, four.best->T_odom_base.p);
  EXPECT_EQ(one.best->share, four.best->share);
  EXPECT_EQ(one.best->runner_up_share, four.best->runner_up_share);
}

TEST(Relocaliser, says_what_is_missing) {
  Draw draw(1);
  PointCloud plain;
  add_ground(plain, draw);
  const SearchArea area{{standing_at(0, 0, 0)}, 10.0, 0.5236};
  const PointCloud seen = seen_from(plain, standing_at(0, 0, 0));
  EXPECT_EQ(look({}, seen_from(forest(1), standing_at(0, 0, 0)), area).obstacle,
            "the map is empty there");
  EXPECT_NE(look(plain, seen, area).obstacle.find("0 points stand out"), std::string::npos);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
