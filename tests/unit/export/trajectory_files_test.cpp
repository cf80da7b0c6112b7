// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trajectory_files.hpp"

#include "trigpoint/export/trajectory_formats.hpp"

#include "scratch_folder.hpp"
#include <gtest/gtest.h>

#include <array>
#include <numbers>
#include <sstream>

namespace trigpoint::exporter {
namespace {

constexpr double kQuarterTurn_rad = std::numbers::pi / 2.0;
constexpr double kRounding = 1e-9;

TEST(KittiFile, has_in_its_columns_the_directions_of_base_link_s_axes_and_its_place) {
  const test::ScratchFolder folder;
  const std::string poses = folder.file("a.txt");
  const std::string times = folder.file("a_times.txt");
  // x forward looks north (y), y left looks up (z), so z up looks east (x).
  const Eigen::Quaterniond q(Eigen::AngleAxisd(kQuarterTurn_rad, Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(kQuarterTurn_rad, Eigen::Vector3d::UnitX()));
  write_kitti(poses, times, {{1'700'000'000'500'000'000, Pose(q, {1.0, 2.0, 3.0})}});
  std::istringstream words(test::read_all(poses));
  for (const double expected : std::array<double, 12>{0, 0, 1, 1, 1, 0, 0, 2, 0, 1, 0, 3}) {
    double written = kNaN;
    words >> written;
    EXPECT_NEAR(written, expected, kRounding);
  }
  const Trajectory read = read_kitti(poses, times);
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read.front().stamp_ns, 1'700'000'000'500'000'000);
  EXPECT_LT(read.front().pose.q.angularDistance(q), kRounding);
}

}  // namespace
}  // namespace trigpoint::exporter
