// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The worlds of the shipped scenarios.
#include "places.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace trigpoint::simulator {

namespace {

constexpr double kBoreNorth_m = 50.0;  ///< its axis in the shipped scenarios
constexpr double kBoreFrom_m = 70.0;   ///< east
constexpr double kBoreTo_m = 450.0;
constexpr double kExact_m = 1e-6;

Ray level_ray(const Eigen::Vector3d& from, double azimuth) {
  return {from, {std::cos(azimuth), std::sin(azimuth), 0.0}, 1};
}

bool is_on_ground(const Place& place, const Eigen::Vector3d& p) {
  return std::abs(p.z() - place.relief.height_m(p.x(), p.y())) < 0.02;
}

}  // namespace

TEST(Places, have_a_tunnel_whose_walls_and_roof_are_where_plane_geometry_puts_them) {
  const Place tunnel("tunnel");
  const Eigen::Vector3d from(260.0, kBoreNorth_m + 0.5, 1.75);
  for (const double azimuth : {0.1, 0.4, 1.2, 2.9}) {
    const double north = std::sin(azimuth);
    EXPECT_NEAR(tunnel.world.cast(level_ray(from, azimuth), 100.0).range_m, 3.0 / north, kExact_m);
    EXPECT_NEAR(tunnel.world.cast(level_ray(from, -azimuth), 100.0).range_m, 4.0 / north, kExact_m);
  }
  EXPECT_NEAR(
      tunnel.world.cast({from, Eigen::Vector3d::UnitZ(), 1}, 100.0).range_m, 5.0 - 1.75, kExact_m);
  EXPECT_FALSE(tunnel.world.cast(level_ray(from, 0.0), 100.0).is_hit());
}

TEST(Places, have_no_roof_over_the_bores_with_gps) {
  for (const char* name : {"tunnel_gps", "corridor_gps"}) {
    const Place cutting(name);
    const Eigen::Vector3d from(260.0, kBoreNorth_m, 1.75);
    EXPECT_FALSE(cutting.world.cast({from, Eigen::Vector3d::UnitZ(), 1}, 100.0).is_hit()) << name;
    EXPECT_TRUE(cutting.world.cast(level_ray(from, 1.5), 100.0).is_hit()) << name;
  }
}

TEST(Places, have_bores_that_tell_nothing_along_their_axis_for_170_m) {
  for (const char* name : {"tunnel", "corridor", "tunnel_gps", "corridor_gps"}) {
    const Place place(name);
    const TunnelConfig& bore = place.scenario.world.tunnels.front();
    double blind_m = 0.0;
    double last_east_m = 0.0;
    for (double t = 0.0; t < place.scenario.duration_s; t += 1.0) {
      const Eigen::Vector3d at = place.scanner_m(t);
      const bool inside = std::abs(at.y() - kBoreNorth_m) < 1.0 && at.x() > kBoreFrom_m + 95.0 &&
                          at.x() < kBoreTo_m - 95.0;
      if (!inside) {
        continue;
      }
      int along = 0;  // returns from anything that is neither wall, floor nor roof
      look_around(place, at, [&](const Ray& ray, const Hit& hit) {
        const Eigen::Vector3d p = ray.origin_m + hit.range_m * ray.direction;
        const bool wall = std::abs(std::abs(p.y() - kBoreNorth_m) - 0.5 * bore.width_m) < 1e-3;
        const bool roof = std::abs(p.z() - bore.height_m) < 1e-3;
        along += !wall && !roof && std::abs(p.z()) > 1e-3 ? 1 : 0;
      });
      EXPECT_LE(along, 5) << name << " at east " << at.x();
      blind_m += along <= 5 && last_east_m > 0.0 ? at.x() - last_east_m : 0.0;
      last_east_m = at.x();
    }
    EXPECT_GE(blind_m, 170.0) << name;
  }
}

TEST(Places, have_a_park_of_leaves_and_hardly_a_plane_but_the_ground) {
  const Place park("park");
  int hits = 0;
  int leaves = 0;
  int planes = 0;
  for (double t = 10.0; t < 180.0; t += 40.0) {
    look_around(park, park.scanner_m(t), [&](const Ray& ray, const Hit& hit) {
      const Eigen::Vector3d p = ray.origin_m + hit.range_m * ray.direction;
      ++hits;
      for (const Shape& shape : park.world.shapes()) {
        const Eigen::Vector3d own = (p - shape.centre_m).cwiseQuotient(shape.half_m);
        if (shape.kind == Shape::Kind::kFoliage && own.norm() < 1.0 + 1e-9) {
          ++leaves;
          return;
        }
        planes += shape.kind == Shape::Kind::kBox && own.cwiseAbs().maxCoeff() < 1.01 ? 1 : 0;
      }
    });
  }
  ASSERT_GT(hits, 5000);
  EXPECT_GT(static_cast<double>(leaves) / hits, 0.3);
  EXPECT_LT(static_cast<double>(leaves) / hits, 0.9);
  EXPECT_EQ(planes, 0);
}

TEST(Places, have_clumps_of_leaves_that_are_not_a_surface) {
  const Place park("park");
  const auto clump =
      std::find_if(park.world.shapes().begin(), park.world.shapes().end(), [](const Shape& shape) {
        return shape.kind == Shape::Kind::kFoliage && shape.half_m.x() > 0.8;
      });
  ASSERT_NE(clump, park.world.shapes().end());
  // Straight through the middle from 1 m off: the depth is exponential (Beer and Lambert).
  const double across_m = 2.0 * clump->half_m.x();
  const Eigen::Vector3d from = clump->centre_m - Eigen::Vector3d(clump->half_m.x() + 1.0, 0, 0);
  constexpr int kRays = 20000;
  int inside_half = 0;
  for (std::uint64_t key = 1; key <= kRays; ++key) {
    Hit hit;
    intersect(*clump, 0, {from, Eigen::Vector3d::UnitX(), key}, hit);
    inside_half += hit.range_m < 1.0 + 0.5 * across_m ? 1 : 0;
  }
  const double expected = 1.0 - std::exp(-0.5 * across_m / clump->free_path_m);
  EXPECT_NEAR(static_cast<double>(inside_half) / kRays,
              expected,
              5.0 * std::sqrt(expected * (1.0 - expected) / kRays));
}

TEST(Places, have_grass_that_light_gets_through_as_its_height_says) {
  WorldConfig flat;
  flat.relief_amplitude_m = 0.0;
  constexpr double kGrass_m = 0.12;
  constexpr double kFreePath_m = 0.3;
  const World world(Relief(flat, 1), {}, {{0.0, 0.0}}, 120.0, kGrass_m);
  for (const double elevation : {-1.2, -0.5, -0.2}) {
    constexpr int kRays = 20000;
    int through = 0;
    for (std::uint64_t key = 1; key <= kRays; ++key) {
      const Ray ray{{0, 0, 2}, {std::cos(elevation), 0, std::sin(elevation)}, key};
      const double up_m = 2.0 + world.cast(ray, 100.0).range_m * ray.direction.z();
      through += up_m < 1e-4 ? 1 : 0;
      ASSERT_LE(up_m, kGrass_m + 1e-4);
    }
    const double share = std::exp(-kGrass_m / std::sin(-elevation) / kFreePath_m);
    EXPECT_NEAR(
        static_cast<double>(through) / kRays, share, 5.0 * std::sqrt(share * (1.0 - share) / kRays))
        << elevation;
  }
}

TEST(Places, have_an_open_field_with_nothing_but_the_ground_to_see) {
  const Place field("open_field");
  double bare_m = 0.0;
  Eigen::Vector3d last = field.scanner_m(0.0);
  for (double t = 1.0; t < field.scenario.duration_s; t += 1.0) {
    const Eigen::Vector3d at = field.scanner_m(t);
    bool bare = true;
    look_around(field, at, [&](const Ray& ray, const Hit& hit) {
      bare = bare && is_on_ground(field, ray.origin_m + hit.range_m * ray.direction);
    });
    bare_m += bare ? (at - last).norm() : 0.0;
    last = at;
  }
  EXPECT_GT(bare_m, 300.0);
}

TEST(Places, leave_the_way_free) {
  for (const char* name : {"park",
                           "tunnel",
                           "corridor",
                           "open_field",
                           "indoor_60",
                           "indoor_120",
                           "campus_twice",
                           "long_drive",
                           "street_traffic"}) {
    for (const std::uint64_t seed : {1U, 2U}) {
      const Place place(name, seed);
      for (double t = 0.0; t < place.scenario.duration_s; t += 0.5) {
        const Eigen::Vector3d at = place.scanner_m(t);
        for (double azimuth = 0.0; azimuth < 6.28; azimuth += 0.2) {
          EXPECT_FALSE(place.world.cast(level_ray(at, azimuth), 0.8).is_hit())
              << name << " seed " << seed << " at " << t;
        }
      }
    }
  }
}

TEST(Places, cover_the_robot_while_it_is_indoors_without_gps) {
  for (const auto& [name, indoors_s] : {std::pair{"indoor_60", 60.0}, {"indoor_120", 120.0}}) {
    const Place place(name);
    double covered_s = 0.0;
    for (double t = 0.0; t < place.scenario.duration_s; t += 0.1) {
      const Hit up = place.world.cast({place.scanner_m(t), Eigen::Vector3d::UnitZ(), 1}, 20.0);
      const TrueState state = place.drive.at_time(t);
      const bool in_hall = std::abs(state.T_map_base.p.y() - 45.0) < 1.0;
      if (up.is_hit() && in_hall) {
        covered_s += 0.1;
        EXPECT_NEAR(state.v_map_mps.norm(), 1.2, 0.2) << name << " at " << t;
      }
    }
    EXPECT_NEAR(covered_s, indoors_s, 4.0) << name;
  }
}

}  // namespace trigpoint::simulator
