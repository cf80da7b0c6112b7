// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Is what a scan's patches say of its pose what its error is?
#include "scan_matcher.hpp"
#include "unchanging_map.hpp"
#include "voxel_key.hpp"
#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

namespace trigpoint::lio_mapper {
namespace {

constexpr double kPatchSide_m = 5.0;
constexpr double kYardWall_m = 22.5;  // in the middle of a patch
constexpr double kYardFloor_m = -2.5;
constexpr double kPointNoise_m = 0.02;

/// A yard between four walls. Its map is wrong, patch by patch.
class Yard final : public UnchangingMap {
 public:
  Yard(double patch_error_m, unsigned seed) : error_m_(0.0, patch_error_m), random_(seed) {}

  bool match_surface(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    const VoxelIndex patch = voxel_index(p.x(), p.y(), p.z(), 1.0 / kPatchSide_m);
    const auto error = errors_m_.find(voxel_key(patch));
    const Eigen::Index axis = p.z() < kYardFloor_m + 1.0          ? 2
                              : std::abs(p.x()) > std::abs(p.y()) ? 0
                                                                  : 1;
    plane.normal = Eigen::Vector3d::Unit(axis);
    const double at_m = axis == 2 ? kYardFloor_m : std::copysign(kYardWall_m, p[axis]);
    plane.offset_m = -at_m - (error == errors_m_.end() ? 0.0 : error->second);
    plane.thickness2_m2 = 0.0;
    plane.tilt2_rad2 = 0.0;
    return true;
  }

  void spoil_patch_of(const Eigen::Vector3d& p) {
    const VoxelKey key = voxel_key(voxel_index(p.x(), p.y(), p.z(), 1.0 / kPatchSide_m));
    if (errors_m_.find(key) == errors_m_.end()) {
      errors_m_[key] = error_m_(random_);
    }
  }

 private:
  std::normal_distribution<double> error_m_;
  std::mt19937 random_;
  std::map<VoxelKey, double> errors_m_;
};

enum class Ends { kNone, kOnePatchEach, kWhole };

/// Points of the yard's surfaces, each measured with noise across its surface; `ends`: how much of
/// the walls of x.
PointCloud measured_yard(Yard& yard, Ends ends, unsigned seed) {
  std::mt19937 random(seed + 1'000'000);
  std::normal_distribution<double> noise_m(0.0, kPointNoise_m);
  PointCloud points;
  const auto add = [&](Eigen::Vector3d p, Eigen::Index axis) {
    yard.spoil_patch_of(p);
    p[axis] += noise_m(random);
    const Eigen::Vector3f f = p.cast<float>();
    points.push_back({f.x(), f.y(), f.z(), 0.0F});
  };
  for (double along_m = -19.5; along_m < 20.0; along_m += 1.0) {
    for (double up_m = 0.5; up_m < 10.0; up_m += 1.0) {
      for (const double side_m : {-kYardWall_m, kYardWall_m}) {
        const bool in_one = along_m > 0.0 && along_m < kPatchSide_m && up_m < kPatchSide_m;
        if (ends == Ends::kWhole || (ends == Ends::kOnePatchEach && in_one)) {
          add({side_m, along_m, up_m}, 0);
        }
        add({along_m, side_m, up_m}, 1);
      }
    }
    for (double across_m = -19.5; across_m < 20.0; across_m += 1.0) {
      add({along_m, across_m, kYardFloor_m}, 2);
    }
  }
  return points;
}

struct Honesty {
  double by_patches{0.0};  ///< NEES / 6
  double as_weighed{0.0};  ///< the same, of what the filter weighs the scan with
};

/// Of the yard, what lies nearest: eight patches of each wall and 16 of the ground.
PointCloud measured_box(Yard& yard, unsigned seed) {
  constexpr float kNear_m = 10.0F;
  PointCloud near;
  for (const PointXyzi& p : measured_yard(yard, Ends::kWhole, seed)) {
    const bool along_wall = p.z > 0.0F && std::min(std::abs(p.x), std::abs(p.y)) < kNear_m;
    const bool ground = p.z < 0.0F && std::max(std::abs(p.x), std::abs(p.y)) < kNear_m;
    if (along_wall || ground) {
      near.push_back(p);
    }
  }
  return near;
}

Honesty honesty_over(int seeds, double patch_error_m, bool few = false) {
  Honesty mean;
  for (int i = 0; i < seeds; ++i) {
    const auto seed = static_cast<unsigned>(i);
    Yard yard(patch_error_m, seed);
    const PointCloud points =
        few ? measured_box(yard, seed) : measured_yard(yard, Ends::kWhole, seed);
    const MatchingConfig config;
    Workers workers(1);
    ScanMatcher matcher(points, yard, Pose{}, config, workers);
    const PoseInformation told = matcher.linearise(Pose{});
    const Vector6d error = -told.information.ldlt().solve(told.gradient);
    mean.by_patches += error.dot(matcher.information_by_patches() * error) / (6.0 * seeds);
    mean.as_weighed += error.dot(told.information * error) / (6.0 * seeds);
  }
  return mean;
}

constexpr int kSeeds = 200;  // sum of as many chi-squares of 6: 4 %
constexpr double kLeast = 0.8;
constexpr double kMost = 1.25;

TEST(ScanMatcherPatches, tell_the_error_where_points_are_wrong_each_by_itself) {
  const Honesty mean = honesty_over(kSeeds, 0.0);
  EXPECT_GT(mean.by_patches, kLeast);
  EXPECT_LT(mean.by_patches, kMost);
  EXPECT_LT(mean.as_weighed, 0.2);  // as if all points of a patch were wrong together
}

TEST(ScanMatcherPatches, tell_the_error_where_the_map_is_wrong_patch_by_patch) {
  for (const double patch_error_m : {0.005, 0.015}) {
    const Honesty mean = honesty_over(kSeeds, patch_error_m);
    EXPECT_GT(mean.by_patches, kLeast) << patch_error_m;
    EXPECT_LT(mean.by_patches, kMost) << patch_error_m;
  }
}

/// 48 patches, to which six parameters were fitted.
TEST(ScanMatcherPatches, tell_the_error_also_where_they_are_few) {
  const Honesty mean = honesty_over(kSeeds, 0.015, true);
  EXPECT_GT(mean.by_patches, kLeast);
  EXPECT_LT(mean.by_patches, kMost);
}

/// Residuals of one patch are no witness of how wrong it is.
TEST(ScanMatcherPatches, tell_nothing_along_an_axis_that_few_of_them_hold) {
  const auto known_of_x = [](Ends ends) {
    Yard yard(0.01, 1);
    const PointCloud points = measured_yard(yard, ends, 1);
    const MatchingConfig config;
    Workers workers(1);
    ScanMatcher matcher(points, yard, Pose{}, config, workers);
    matcher.linearise(Pose{});
    const Matrix6d known = matcher.information_by_patches();
    // What is left of x when all else is open.
    return 1.0 / (known + 1e-9 * Matrix6d::Identity()).inverse()(0, 0);
  };
  constexpr double kMillimetre = 1e6;  // 1/m^2
  EXPECT_GT(known_of_x(Ends::kWhole), kMillimetre / 9.0);
  EXPECT_LT(known_of_x(Ends::kOnePatchEach), 1.0);
  EXPECT_LT(known_of_x(Ends::kNone), 1.0);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
