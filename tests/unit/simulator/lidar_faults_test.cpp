// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "clouds.hpp"
#include "entries.hpp"
#include "faults.hpp"
#include "lidar_model.hpp"
#include "places.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>
#include <set>

namespace trigpoint::simulator {

namespace {

PointCloudMessage scan(const Scenario& scenario, double t_s) {
  static const Place place("short");
  SweepEpoch sweep;
  sweep.stamp_ns = scenario.start_ns() + from_seconds(t_s);
  FaultSchedule(scenario.faults, scenario.start_ns(), 1).apply(sweep);
  const SpinningLidar lidar(scenario.lidar, scenario.robot.T_base_lidar(), 1);
  return lidar.scan(sweep, place.drive, place.world);
}

template <typename Value>
Value value_at(const PointCloudMessage& cloud, std::size_t point, const std::string& field) {
  for (const PointField& f : cloud.fields) {
    if (f.name == field) {
      Value value;
      std::memcpy(&value, cloud.data.data() + point * cloud.point_step + f.offset, sizeof value);
      return value;
    }
  }
  ADD_FAILURE() << "no field " << field;
  return {};
}

}  // namespace

TEST(LidarFaults, end_every_ray_on_a_cover) {
  const Scenario scenario = load_scenario("short+lidar_blocked");
  EXPECT_LT(scan(scenario, 39.9).width, 28000U);
  const auto points = points_of(scan(scenario, 40.1));
  EXPECT_EQ(points.size(), 28800U);
  for (const TestPoint& point : points) {
    ASSERT_NEAR(point.p_m.norm(), 0.3, 6.0 * scenario.lidar.range_sigma_m);
    ASSERT_LT(point.p_m.norm(), 0.5);
  }
  EXPECT_LT(scan(scenario, 50.0).width, 28000U);
}

TEST(LidarFaults, lose_a_fifth_of_the_scans) {
  const Scenario scenario = load_scenario("short+lidar_lost_scans");
  const FaultSchedule faults(scenario.faults, scenario.start_ns(), 1);
  constexpr int kSweeps = 10000;
  int lost = 0;
  for (int i = 0; i < kSweeps; ++i) {
    SweepEpoch sweep;
    sweep.stamp_ns = scenario.start_ns() + from_seconds(0.1 * i);
    faults.apply(sweep);
    lost += sweep.lost ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(lost) / kSweeps, 0.2, share_tolerance(0.2, kSweeps));
}

TEST(LidarFaults, shift_and_drift_the_stamps_but_not_the_points_or_the_arrivals) {
  const Scenario plain = load_scenario("short");
  const Scenario off = load_scenario("short+lidar_offset");
  const auto a = entries_of(plain, 1, 2.0);
  const auto b = entries_of(off, 1, 2.0);
  ASSERT_EQ(a.size(), b.size());
  int clouds = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].receive_ns, b[i].receive_ns);
    if (const auto* cloud = std::get_if<PointCloudMessage>(&a[i].measurement)) {
      const auto& shifted = std::get<PointCloudMessage>(b[i].measurement);
      EXPECT_EQ(shifted.stamp_ns - cloud->stamp_ns, 20'000'000);
      EXPECT_EQ(shifted.data, cloud->data);
      ++clouds;
    }
  }
  EXPECT_EQ(clouds, 19);
  const Scenario drifting = load_scenario("short+lidar_drift");
  EXPECT_EQ(scan(drifting, 120.0).stamp_ns, plain.start_ns() + from_seconds(120.02));
}

TEST(LidarFaults, write_a_share_of_the_points_as_not_a_number) {
  const Scenario scenario = load_scenario("short+lidar_nan");
  const PointCloudMessage cloud = scan(scenario, 10.0);
  EXPECT_FALSE(cloud.is_dense);
  EXPECT_EQ(cloud.width, scan(load_scenario("short"), 10.0).width);
  int bad = 0;
  for (const TestPoint& point : points_of(cloud)) {
    bad += point.p_m.hasNaN() ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(bad) / cloud.width, 0.1, share_tolerance(0.1, cloud.width));
  for (const TestPoint& point : points_of(scan(scenario, 40.5))) {
    ASSERT_TRUE(point.p_m.hasNaN());
  }
}

TEST(LidarFaults, leave_one_ring) {
  const Scenario scenario = load_scenario("short+lidar_one_ring");
  std::set<std::uint16_t> rings;
  for (const TestPoint& point : points_of(scan(scenario, 41.0))) {
    rings.insert(point.ring);
  }
  EXPECT_EQ(rings.size(), 1U);
}

TEST(LidarOptions, turn_the_other_way_round) {
  for (const TestPoint& point : points_of(scan(load_scenario("short+counter_clockwise"), 1.0))) {
    const double azimuth = std::atan2(point.p_m.y(), point.p_m.x());
    const double expected = std::numbers::pi * (20.0 * static_cast<double>(point.time_s) - 1.0);
    ASSERT_NEAR(std::remainder(azimuth - expected, 2.0 * std::numbers::pi), 0.0, 1e-4);
  }
}

TEST(LidarOptions, have_as_many_beams_as_asked_for) {
  for (const auto& [name, beams] : {std::pair{"short+beams_16", 16},
                                    {"short+beams_32", 32},
                                    {"short+beams_64", 64},
                                    {"campus_32", 32}}) {
    EXPECT_EQ(lidar_model(load_scenario(name).lidar.model).elevations_rad.size(),
              static_cast<std::size_t>(beams))
        << name;
  }
}

TEST(LidarOptions, write_the_same_points_in_every_layout) {
  const PointCloudMessage reference = scan(load_scenario("short"), 1.0);
  const auto points = points_of(reference);
  for (const char* name : {"ouster", "hesai", "livox"}) {
    const PointCloudMessage cloud =
        scan(load_scenario("short+" + std::string(name) + "_layout"), 1.0);
    ASSERT_EQ(cloud.width, reference.width) << name;
    for (std::size_t i = 0; i < points.size(); i += 97) {
      ASSERT_EQ(static_cast<double>(value_at<float>(cloud, i, "z")), points[i].p_m.z()) << name;
      ASSERT_EQ(value_at<float>(cloud, i, "intensity"), points[i].intensity) << name;
    }
  }
  constexpr double kFloatTime_s = 1e-8;    // of the reference's float32
  constexpr double kDoubleStamp_s = 5e-7;  // of float64 at 1.7e9 s
  const double stamp_s = to_seconds(reference.stamp_ns);
  const std::size_t last = points.size() - 1;
  const auto time_s = static_cast<double>(points[last].time_s);
  EXPECT_NEAR(
      1e-9 * value_at<std::uint32_t>(scan(load_scenario("short+ouster_layout"), 1.0), last, "t"),
      time_s,
      kFloatTime_s);
  EXPECT_NEAR(value_at<double>(scan(load_scenario("short+hesai_layout"), 1.0), last, "timestamp"),
              stamp_s + time_s,
              kDoubleStamp_s);
  EXPECT_NEAR(
      1e-9 * value_at<double>(scan(load_scenario("short+livox_layout"), 1.0), last, "timestamp"),
      stamp_s + time_s,
      kDoubleStamp_s);
}

TEST(LidarOptions, leave_the_time_out) {
  const PointCloudMessage cloud = scan(load_scenario("short+no_point_time"), 1.0);
  EXPECT_EQ(cloud.fields.size(), 5U);
  for (const PointField& field : cloud.fields) {
    EXPECT_TRUE(field.name != "time" && field.name != "t" && field.name != "timestamp");
  }
}

}  // namespace trigpoint::simulator
