// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/surfaces.hpp"

#include "trigpoint/simulator/simulator.hpp"

#include "random.hpp"
#include "shape_distance.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>

namespace trigpoint::simulator {
namespace {

constexpr double kSurfaceRounding_m = 1e-9;

TEST(ShapeDistance, to_a_turned_box_is_the_closed_form) {
  Shape box;
  box.centre_m = {10.0, 20.0, 1.0};
  box.half_m = {2.0, 1.0, 1.0};
  box.cos_yaw = std::cos(std::numbers::pi / 6.0);
  box.sin_yaw = std::sin(std::numbers::pi / 6.0);
  const auto at = [&](const Eigen::Vector3d& in_box) {
    const Eigen::Vector3d turned(box.cos_yaw * in_box.x() - box.sin_yaw * in_box.y(),
                                 box.sin_yaw * in_box.x() + box.cos_yaw * in_box.y(),
                                 in_box.z());
    return surface_distance_m(box, box.centre_m + turned);
  };
  EXPECT_NEAR(at({2.5, 0.0, 0.0}), 0.5, kSurfaceRounding_m);    // before a face
  EXPECT_NEAR(at({2.3, 1.4, 0.0}), 0.5, kSurfaceRounding_m);    // off an edge: 3, 4, 5
  EXPECT_NEAR(at({4.0, 2.0, 3.0}), 3.0, kSurfaceRounding_m);    // off a corner: 2, 1, 2
  EXPECT_NEAR(at({1.0, 0.0, 0.25}), 0.75, kSurfaceRounding_m);  // inside
}

TEST(ShapeDistance, to_a_post_is_the_closed_form) {
  Shape post;
  post.kind = Shape::Kind::kCylinder;
  post.half_m = {0.1, 0.1, 3.0};
  EXPECT_NEAR(surface_distance_m(post, {0.3, 0.4, 0.0}), 0.4, kSurfaceRounding_m);
  EXPECT_NEAR(surface_distance_m(post, {0.0, 0.0, 1.0}), 0.1, kSurfaceRounding_m);
  EXPECT_NEAR(surface_distance_m(post, {0.4, 0.0, 3.4}), 0.5, kSurfaceRounding_m);
}

TEST(Surfaces, are_where_the_lidar_without_noise_meets_them_or_in_leaves) {
  Scenario scenario = load_scenario("short");
  scenario.lidar.range_sigma_m = 0.0;
  const Surfaces surfaces(scenario, 1);
  const auto reader = open_scenario(scenario, 1, 2.0);
  const Pose T_base_lidar = scenario.robot.T_base_lidar();
  std::size_t near = 0;
  std::size_t far = 0;
  std::size_t leaves = 0;
  while (const auto entry = reader->next()) {
    const auto* cloud = std::get_if<PointCloudMessage>(&entry->measurement);
    if (cloud == nullptr) {
      continue;
    }
    // It stands still in its first seconds, so a point's time does not matter.
    const Pose T = reader->truth()->at(cloud->stamp_ns).T_map_base * T_base_lidar;
    for (std::size_t i = 0; i < cloud->width * cloud->height; i += 7) {
      float xyz[3];
      std::memcpy(xyz, cloud->data.data() + i * cloud->point_step, sizeof(xyz));
      const Eigen::Vector3d p = T * Eigen::Vector3d(xyz[0], xyz[1], xyz[2]);
      if (!p.allFinite()) {
        continue;
      }
      const auto distance_m = surfaces.distance_m(p);
      leaves += distance_m ? 0 : 1;
      near += distance_m && *distance_m < 0.02 ? 1 : 0;
      far += distance_m && *distance_m >= 0.02 ? 1 : 0;
    }
  }
  EXPECT_GT(near, 10'000U);
  EXPECT_LT(far, near / 200) << leaves << " in leaves";
}

TEST(Surfaces, tell_how_far_a_point_that_was_moved_is_off) {
  const Scenario scenario = load_scenario("short");
  const Surfaces surfaces(scenario, 1);
  const Eigen::Vector3d p(1.0, 0.0, 0.0);  // on the road, which is near height 0 of map here
  const auto raised = surfaces.distance_m(p + Eigen::Vector3d(0.0, 0.0, 0.3));
  const auto higher = surfaces.distance_m(p + Eigen::Vector3d(0.0, 0.0, 0.7));
  ASSERT_TRUE(raised && higher);
  EXPECT_NEAR(*raised, 0.3, 0.05);
  EXPECT_NEAR(*higher - *raised, 0.4, 0.001);
  EXPECT_EQ(surfaces.distance_m(p + Eigen::Vector3d(0.0, 0.0, 50.0)), Surfaces::kFarthest_m);
}

}  // namespace
}  // namespace trigpoint::simulator
