// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "downsample.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <random>

namespace trigpoint::lio_mapper {
namespace {

constexpr double kVoxel_m = 0.4;

std::vector<TimedPoint> random_cloud(int count, float half_side_m, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(-half_side_m, half_side_m);
  std::vector<TimedPoint> points;
  for (int i = 0; i < count; ++i) {
    const float x = coordinate(random);
    const float y = coordinate(random);
    const float z = coordinate(random);
    points.push_back({x, y, z, static_cast<float>(i), 1e-6F * static_cast<float>(i)});
  }
  return points;
}

PointCloud without_times(const std::vector<TimedPoint>& points) {
  PointCloud cloud;
  for (const TimedPoint& p : points) {
    cloud.push_back({p.x, p.y, p.z, p.intensity});
  }
  return cloud;
}

bool same(const TimedPoint& a, const TimedPoint& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z && a.intensity == b.intensity &&
         a.time_s == b.time_s;
}

using Voxel = std::array<long, 3>;

Voxel voxel_of(const TimedPoint& p) {
  return {std::lround(std::floor(p.x / kVoxel_m)),
          std::lround(std::floor(p.y / kVoxel_m)),
          std::lround(std::floor(p.z / kVoxel_m))};
}

double from_centre(const TimedPoint& p) {
  const Voxel v = voxel_of(p);
  const auto off = [](double value, long i) {
    return value - kVoxel_m * (static_cast<double>(i) + 0.5);
  };
  return std::hypot(off(p.x, v[0]), off(p.y, v[1]), off(p.z, v[2]));
}

TEST(Downsample, keeps_of_scattered_points_the_one_nearest_the_centre_of_each_voxel) {
  const auto points = random_cloud(20000, 4.0F, 1);
  std::map<Voxel, TimedPoint> expected;
  std::map<Voxel, int> counts;
  std::vector<Voxel> order;
  for (const TimedPoint& p : points) {
    ++counts[voxel_of(p)];
    const auto [entry, is_new] = expected.try_emplace(voxel_of(p), p);
    if (is_new) {
      order.push_back(voxel_of(p));
    } else if (from_centre(p) < from_centre(entry->second)) {
      entry->second = p;
    }
  }
  const auto kept = downsample(points, kVoxel_m);
  ASSERT_EQ(kept.size(), expected.size());
  ASSERT_LT(kept.size(), points.size() / 2);
  for (std::size_t i = 0; i < kept.size(); ++i) {
    // More may lie on a plane by chance.
    EXPECT_TRUE(counts.at(order[i]) > 5 || same(kept[i], expected.at(order[i]))) << i;
  }
}

/// By how much, in the mean, kept points lie above the floor z = height_m that is seen in rings
/// from (0, 0, kSensorHeight_m) with noise along the beams.
constexpr double kSensorHeight_m = 1.5;
constexpr double kBeamNoise_m = 0.02;

double off_floor_m(double height_m, unsigned seed) {
  constexpr int kRings = 12;
  constexpr int kSteps = 3600;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, kBeamNoise_m);
  PointCloud points;
  for (int ring = 0; ring < kRings; ++ring) {
    const double radius_m = 6.0 + 0.15 * ring;
    for (int step = 0; step < kSteps; ++step) {
      const double azimuth = 2.0 * M_PI * step / kSteps;
      const Eigen::Vector3d beam(
          radius_m * std::cos(azimuth), radius_m * std::sin(azimuth), height_m - kSensorHeight_m);
      const Eigen::Vector3d seen = (1.0 + noise(random) / beam.norm()) * beam;
      points.push_back({static_cast<float>(seen.x()),
                        static_cast<float>(seen.y()),
                        static_cast<float>(seen.z() + kSensorHeight_m),
                        1.0F});
    }
  }
  double sum_m = 0.0;
  const PointCloud kept = downsample(points, kVoxel_m);
  for (const PointXyzi& p : kept) {
    sum_m += p.z - height_m;
  }
  return sum_m / static_cast<double>(kept.size());
}

/// The point nearest the centre of a voxel would lie on that side of the floor on which the centre
/// is, scan after scan: by a third to two thirds of the noise across it.
TEST(Downsample, noise_across_a_surface_does_not_choose_the_point) {
  constexpr unsigned kSeeds = 20;
  for (const double height_m : {0.06, 0.13, 0.27, 0.34}) {
    const double across_m = kBeamNoise_m * (kSensorHeight_m - height_m) / 7.0;
    double off_m = 0.0;
    for (unsigned seed = 0; seed < kSeeds; ++seed) {
      off_m += off_floor_m(height_m, seed) / kSeeds;
    }
    EXPECT_LT(std::abs(off_m), 0.1 * across_m) << "floor at " << height_m;
  }
}

TEST(Downsample, treats_clouds_with_and_without_times_alike) {
  const auto points = random_cloud(5000, 3.0F, 2);
  const auto timed = downsample(points, kVoxel_m);
  const PointCloud plain = downsample(without_times(points), kVoxel_m);
  ASSERT_EQ(plain.size(), timed.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    EXPECT_EQ(plain[i].intensity, timed[i].intensity);
    EXPECT_EQ(plain[i].position(), Eigen::Vector3f(timed[i].x, timed[i].y, timed[i].z));
  }
}

TEST(Downsample, changes_nothing_the_second_time) {
  const auto once = downsample(random_cloud(5000, 3.0F, 3), kVoxel_m);
  const auto twice = downsample(once, kVoxel_m);
  ASSERT_EQ(twice.size(), once.size());
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_TRUE(same(once[i], twice[i]));
  }
}

TEST(Downsample, does_not_thin_across_the_origin) {
  const auto kept = downsample(
      PointCloud{{0.1F, 0.1F, 0.1F, 0}, {-0.1F, 0.1F, 0.1F, 0}, {0.1F, -0.1F, -0.1F, 0}}, kVoxel_m);
  EXPECT_EQ(kept.size(), 3U);
}

TEST(Downsample, of_equally_near_points_keeps_the_first) {
  const auto kept = downsample(PointCloud{{0.1F, 0.2F, 0.2F, 1}, {0.1F, 0.2F, 0.2F, 2}}, kVoxel_m);
  ASSERT_EQ(kept.size(), 1U);
  EXPECT_EQ(kept[0].intensity, 1.0F);
}

TEST(Downsample, leaves_out_what_has_no_voxel) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(downsample(PointCloud{{kNan, 0, 0, 0}, {0, kInf, 0, 0}, {0, 0, -1e12F, 0}}, kVoxel_m)
                  .empty());
  EXPECT_TRUE(downsample(PointCloud{}, kVoxel_m).empty());
}

TEST(Downsample, without_a_positive_voxel_thins_nothing) {
  const auto points = random_cloud(100, 0.1F, 4);
  EXPECT_EQ(downsample(points, 0.0).size(), 100U);
  EXPECT_EQ(downsample(points, kNaN).size(), 100U);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
