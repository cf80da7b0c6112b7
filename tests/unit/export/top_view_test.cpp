// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "top_view.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::exporter {
namespace {

TEST(Grid, covers_the_rectangle_and_has_its_lines_on_multiples_of_a_cell) {
  const Grid grid = grid_over({10.1, -3.0}, {12.0, 4.9}, {0.5, 0.5});
  EXPECT_EQ(grid.north_west, Eigen::Vector2d(10.0, 5.0));
  EXPECT_EQ(grid.columns, 5);  // 10.0 to 12.5: the point at 12.0 is in the last one
  EXPECT_EQ(grid.rows, 16);
}

TEST(Grid, gets_larger_cells_rather_than_too_many) {
  const Grid grid = grid_over({0.0, 0.0}, {1e5, 1e5}, {0.1, 0.1}, 1'000'000);
  EXPECT_LE(grid.cells(), 1'000'000U);
  EXPECT_GT(grid.cells(), 900'000U);
  EXPECT_GE(grid.columns * grid.cell.x(), 1e5);
}

TEST(Grid, of_a_single_point_is_one_cell) {
  EXPECT_EQ(grid_over({3.0, 4.0}, {3.0, 4.0}, {0.25, 0.25}).cells(), 1U);
}

TEST(TopView, keeps_the_highest_point_and_knows_where_there_is_none) {
  TopView view(grid_over({0.0, 0.0}, {1.9, 1.9}, {1.0, 1.0}));
  view.add({0.5, 1.5}, 2.0);
  view.add({0.6, 1.6}, 7.0);
  view.add({0.5, 1.5}, -1.0);
  view.add({50.0, 1.5}, 100.0);  // outside
  ASSERT_EQ(view.heights_m().size(), 4U);
  EXPECT_EQ(view.heights_m()[0], 7.0F);  // north-west
  EXPECT_TRUE(std::isnan(view.heights_m()[3]));
  const auto picture = view.picture();
  EXPECT_EQ(picture[3], 255);
  EXPECT_EQ(picture[7], 0);
}

}  // namespace
}  // namespace trigpoint::exporter
