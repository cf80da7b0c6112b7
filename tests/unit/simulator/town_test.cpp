// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "town.hpp"

#include "drive.hpp"
#include "route.hpp"
#include "world.hpp"
#include <gtest/gtest.h>

namespace trigpoint::simulator {

namespace {

struct Town {
  explicit Town(std::uint64_t seed)
      : relief(scenario.world, seed),
        drive(scenario, relief, seed, scenario.duration_s),
        world(relief,
              build_town(scenario.world, Path(scenario.route->points()), relief, seed),
              drive.track(1.0),
              120.0) {}

  Scenario scenario = load_scenario("campus");
  Relief relief;
  Drive drive;
  World world;
};

}  // namespace

TEST(Town, never_stands_in_the_way_whatever_the_seed) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const Town town(seed);
    for (double t = 0.0; t < 121.0; t += 0.25) {
      const TrueState s = town.drive.at_time(t);
      const Eigen::Vector3d top = s.T_map_base * Eigen::Vector3d(0.0, 0.0, 0.85);
      for (double azimuth = 0.0; azimuth < 6.28; azimuth += 0.2) {
        const Eigen::Vector3d side(std::cos(azimuth), std::sin(azimuth), 0.0);
        EXPECT_FALSE(town.world.cast({top, side, 1}, 1.2).is_hit())
            << "seed " << seed << " at " << t;
      }
    }
  }
}

TEST(Town, has_facades_to_see_and_a_roof_over_the_hall) {
  const Town town(1);
  int covered = 0;
  int outside = 0;
  for (double t = 0.0; t < 121.0; t += 0.25) {
    const TrueState s = town.drive.at_time(t);
    const bool roof = town.world.cast({s.T_map_base.p, Eigen::Vector3d::UnitZ(), 1}, 30.0).is_hit();
    const bool inside =
        std::abs(s.T_map_base.p.x() - 30.0) < 14.0 && std::abs(s.T_map_base.p.y() - 42.0) < 5.0;
    covered += roof && inside ? 1 : 0;
    outside += !inside && roof ? 1 : 0;
    EXPECT_TRUE(!inside || roof) << "at " << t;
  }
  EXPECT_GT(covered, 40);
  EXPECT_LT(outside, 20);  // a crown may reach over the road
}

TEST(Town, is_the_same_for_the_same_seed_and_another_for_another) {
  const Town a(1);
  const Town b(1);
  const Town c(2);
  ASSERT_EQ(a.world.shapes().size(), b.world.shapes().size());
  EXPECT_EQ(a.world.shapes().back().centre_m, b.world.shapes().back().centre_m);
  EXPECT_NE(a.world.shapes().back().centre_m, c.world.shapes().back().centre_m);
}

}  // namespace trigpoint::simulator
