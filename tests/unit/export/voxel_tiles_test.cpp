// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "voxel_tiles.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace trigpoint::exporter {
namespace {

constexpr std::size_t kNoLimit = 1'000'000;
constexpr float kRounding_m = 1e-6F;

struct Emitted {
  PointCloud all;
  std::size_t calls{0};

  std::function<void(const PointCloud&)> collect() {
    return [this](const PointCloud& points) {
      all.insert(all.end(), points.begin(), points.end());
      ++calls;
    };
  }
};

TEST(VoxelTiles, average_the_points_of_one_cube_also_below_zero) {
  Emitted emitted;
  VoxelTiles tiles(0.1, kNoLimit, emitted.collect());
  tiles.add({{-0.02F, -0.02F, -0.02F, 1.0F}, {-0.08F, -0.04F, -0.06F, 3.0F}});
  tiles.finish();
  ASSERT_EQ(emitted.all.size(), 1U);
  EXPECT_NEAR(emitted.all[0].x, -0.05F, kRounding_m);
  EXPECT_NEAR(emitted.all[0].y, -0.03F, kRounding_m);
  EXPECT_NEAR(emitted.all[0].z, -0.04F, kRounding_m);
  EXPECT_NEAR(emitted.all[0].intensity, 2.0F, kRounding_m);
}

TEST(VoxelTiles, keep_neighbouring_cubes_apart) {
  Emitted emitted;
  VoxelTiles tiles(0.1, kNoLimit, emitted.collect());
  tiles.add({{-0.01F, 0.05F, 0.05F, 0.0F}, {0.01F, 0.05F, 0.05F, 0.0F}});
  tiles.finish();
  EXPECT_EQ(emitted.all.size(), 2U);
}

TEST(VoxelTiles, keep_the_tiles_on_both_sides_of_zero_apart) {
  Emitted emitted;
  VoxelTiles tiles(0.1, kNoLimit, emitted.collect());
  // 512 cubes apart: the same cube of two tiles.
  tiles.add({{-0.05F, 0.05F, 0.05F, 0.0F}, {51.15F, 0.05F, 0.05F, 0.0F}});
  tiles.finish();
  EXPECT_EQ(emitted.all.size(), 2U);
}

TEST(VoxelTiles, leave_out_points_that_are_not_places) {
  Emitted emitted;
  VoxelTiles tiles(0.1, kNoLimit, emitted.collect());
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  tiles.add({{kNan, 0.0F, 0.0F, 0.0F}, {0.0F, 1e20F, 0.0F, 0.0F}});
  tiles.finish();
  EXPECT_TRUE(emitted.all.empty());
}

TEST(VoxelTiles, hold_no_more_cubes_than_allowed_and_lose_none) {
  Emitted emitted;
  constexpr std::size_t kMost = 100;
  VoxelTiles tiles(0.1, kMost, emitted.collect());
  constexpr int kSteps = 400;
  for (int i = 0; i < kSteps; ++i) {  // 4 km in a straight line, one point every 10 m
    tiles.add({{static_cast<float>(i) * 10.0F + 0.05F, 0.05F, 0.05F, 0.0F}});
    EXPECT_LE(static_cast<std::size_t>(i) + 1 - emitted.all.size(), kMost);
  }
  EXPECT_GT(emitted.calls, 0U);
  tiles.finish();
  EXPECT_EQ(emitted.all.size(), static_cast<std::size_t>(kSteps));
}

}  // namespace
}  // namespace trigpoint::exporter
