// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "traffic.hpp"

#include "clouds.hpp"
#include "entries.hpp"
#include "lidar_model.hpp"
#include "places.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

namespace trigpoint::simulator {

namespace {

constexpr std::uint64_t kDriversSeed = 3;

struct Street {
  explicit Street(const std::string& changes = "")
      : place("street_traffic+lidar.range_sigma_m=0+lidar.dropout=0" + changes, kDriversSeed),
        traffic(place.scenario, place.relief, place.drive, kDriversSeed),
        lidar(place.scenario.lidar, place.scenario.robot.T_base_lidar(), kDriversSeed) {}

  Nanoseconds stamp_ns(double t_s) const { return place.scenario.start_ns() + from_seconds(t_s); }

  Place place;
  Traffic traffic;
  SpinningLidar lidar;
};

/// How far a point is from the surface of a box turned about z, from outside or inside.
double off_box_m(const Eigen::Vector3d& p,
                 const Footprint& foot,
                 const Eigen::Vector2d& half_m,
                 double bottom_m,
                 double top_m) {
  const Eigen::Vector2d d = p.head<2>() - foot.centre_m;
  const Eigen::Vector3d own(std::abs(d.dot(foot.axis(0))) - half_m.x(),
                            std::abs(d.dot(foot.axis(1))) - half_m.y(),
                            std::abs(p.z() - 0.5 * (bottom_m + top_m)) - 0.5 * (top_m - bottom_m));
  return std::abs(own.maxCoeff());
}

/// The same for a whole object, from its measures alone.
double off_object_m(const Traffic& traffic, std::size_t i, double t_s, const Eigen::Vector3d& p) {
  const Footprint foot = traffic.footprint(i, t_s);
  const double ground = traffic.ground_m(i, t_s);
  if (!traffic.is_car(i)) {
    const double up_m = p.z() - ground;
    return up_m < -1e-6 || up_m > 1.7 + 1e-6
               ? 1.0
               : std::abs((p.head<2>() - foot.centre_m).norm() - 0.25);
  }
  const Eigen::Vector2d cabin(0.5 * foot.half_m.x(), foot.half_m.y() - 0.1);
  return std::min(off_box_m(p, foot, foot.half_m, ground + 0.2, ground + 0.95),
                  off_box_m(p, foot, cabin, ground + 0.95, ground + 1.5));
}

}  // namespace

TEST(Traffic, gives_points_that_lie_on_the_object_at_their_own_time) {
  const Street street;
  constexpr double kFloat_m = 1e-3;  // float32 coordinates 400 m from the origin, and 8 m/s
  int people = 0;
  int cars = 0;
  for (double t_s = 5.0; t_s < 120.0; t_s += 20.0) {
    SweepEpoch sweep;
    sweep.stamp_ns = street.stamp_ns(t_s);
    MovingSweep moving;
    const auto cloud =
        street.lidar.scan(sweep, street.place.drive, street.place.world, &street.traffic, &moving);
    const std::vector<TestPoint> points = points_of(cloud);
    for (const MovingPoint& truth : moving.points) {
      const TestPoint& point = points.at(truth.point);
      const double at_s = t_s + static_cast<double>(point.time_s);
      const Eigen::Vector3d p = street.place.drive.at_time(at_s).T_map_base *
                                (street.place.scenario.robot.T_base_lidar() * point.p_m);
      ASSERT_LT((p - truth.p_map_m).norm(), kFloat_m);
      ASSERT_LT(off_object_m(street.traffic, truth.object, at_s, p), kFloat_m) << truth.object;
      (street.traffic.is_car(truth.object) ? cars : people) += 1;
    }
  }
  EXPECT_GT(people, 300);
  EXPECT_GT(cars, 300);
}

TEST(Traffic, leaves_no_point_on_an_object_unsaid) {
  const Street street;
  SweepEpoch sweep;
  sweep.stamp_ns = street.stamp_ns(30.0);
  MovingSweep moving;
  const auto with =
      street.lidar.scan(sweep, street.place.drive, street.place.world, &street.traffic, &moving);
  std::map<std::uint32_t, bool> said;
  for (const MovingPoint& point : moving.points) {
    said[point.point] = true;
  }
  const std::vector<TestPoint> points = points_of(with);
  int checked = 0;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const double at_s = 30.0 + static_cast<double>(points[i].time_s);
    const Eigen::Vector3d p = street.place.drive.at_time(at_s).T_map_base *
                              (street.place.scenario.robot.T_base_lidar() * points[i].p_m);
    for (std::size_t k = 0; k < street.traffic.size(); ++k) {
      const double up_m = p.z() - street.traffic.ground_m(k, at_s);
      if (off_object_m(street.traffic, k, at_s, p) < 1e-4 && up_m > 0.3) {
        ++checked;
        EXPECT_TRUE(said[i]) << i;
      }
    }
  }
  EXPECT_GT(checked, 50);
}

TEST(Traffic, moves_at_walking_and_driving_pace_and_keeps_clear_of_the_robot) {
  const Street street;
  ASSERT_GE(street.traffic.size(), 40U);
  constexpr double kStep_s = 0.2;
  for (std::size_t i = 0; i < street.traffic.size(); ++i) {
    double farthest_m = 0.0;
    for (double t_s = 0.0; t_s < 180.0; t_s += kStep_s) {
      const Footprint now = street.traffic.footprint(i, t_s);
      const Footprint next = street.traffic.footprint(i, t_s + kStep_s);
      // Outside a bend the same pace along the route's middle is faster by (r + 3) / r.
      const double limit_mps = street.traffic.is_car(i) ? 16.0 : 3.5;
      ASSERT_LT((next.centre_m - now.centre_m).norm(), limit_mps * kStep_s) << i << " at " << t_s;
      ASSERT_GT(now.distance_m(street.place.drive.at_time(t_s).T_map_base.p.head<2>()), 0.9)
          << i << " at " << t_s;
      farthest_m =
          std::max(farthest_m, (now.centre_m - street.traffic.footprint(i, 0.0).centre_m).norm());
    }
    EXPECT_GT(farthest_m, 3.0) << i;
  }
}

TEST(Traffic, is_said_beside_the_truth_and_never_in_the_log) {
  const auto folder = std::filesystem::temp_directory_path() / "trigpoint_traffic_truth";
  std::filesystem::create_directories(folder);
  const Scenario scenario = load_scenario("street_traffic");
  std::size_t told = 0;
  StreamOptions options;
  options.on_moving = [&](const MovingSweep& sweep) { told += sweep.points.size(); };
  const auto reader = open_scenario(scenario, kDriversSeed, 1.0, options);
  reader->write_truth((folder / "truth.tum").string());
  const auto entries = all_of(*reader);
  EXPECT_EQ(reader->summary().topics.size(), 3U);
  std::ifstream file(folder / "moving_points.txt");
  std::size_t lines = 0;
  for (std::string line; std::getline(file, line);) {
    lines += line.starts_with('#') ? 0 : 1;
  }
  EXPECT_EQ(lines, told);
  EXPECT_GT(told, 0U);
  EXPECT_TRUE(std::filesystem::exists(folder / "moving_objects.txt"));
  EXPECT_EQ(bytes_of(entries), bytes_of(entries_of(scenario, kDriversSeed, 1.0)));
  std::filesystem::remove_all(folder);
}

}  // namespace trigpoint::simulator
