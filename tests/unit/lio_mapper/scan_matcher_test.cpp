// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the matcher asks of a local map, and when.
#include "scan_matcher.hpp"

#include "trigpoint/base/so3.hpp"

#include "unchanging_map.hpp"
#include "voxel_key.hpp"
#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <random>
#include <utility>

namespace trigpoint::lio_mapper {
namespace {

/// A room 8 m wide; walls of x are there only when `ends` is set: else it is a tunnel.
class Room final : public UnchangingMap {
 public:
  explicit Room(bool ends) : ends_(ends) {}

  bool match_surface(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    ++surfaces_asked;
    Eigen::Index axis = 0;
    const double distance_m = p.cwiseAbs().maxCoeff(&axis);
    if (distance_m < 3.0 || (axis == 0 && !ends_)) {
      return false;
    }
    plane.normal = Eigen::Vector3d::Unit(axis);
    plane.offset_m = p[axis] < 0.0 ? 4.0 : -4.0;
    plane.thickness2_m2 = thickness2_m2;
    plane.tilt2_rad2 = 0.0;
    return true;
  }

  bool match_nearest(const Eigen::Vector3d& /*p*/, PlaneMatch& /*plane*/) const override {
    ++nearest_asked;
    return false;
  }

  bool has_nearest() const override { return keeps_points; }

  double thickness2_m2{1e-4};
  bool keeps_points{false};
  mutable std::atomic<int> surfaces_asked{0};
  mutable std::atomic<int> nearest_asked{0};

 private:
  bool ends_;
};

constexpr int kAWall = 100;
constexpr int kPoints = 6 * kAWall;

PointCloud room_points() {
  PointCloud points;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-4.0F, 4.0F}) {
      for (int i = 0; i < kAWall; ++i) {
        Eigen::Vector3f p(
            0.6F * static_cast<float>(i % 10 - 5), 0.6F * static_cast<float>(i / 10 - 5), side);
        std::swap(p[axis], p[2]);
        points.push_back({p.x(), p.y(), p.z(), 0.0F});
      }
    }
  }
  return points;
}

struct Matching {
  explicit Matching(bool ends) : room(ends) {}

  Room room;
  PointCloud points{room_points()};
  MatchingConfig config;
  Workers workers{2};
  ScanMatcher matcher{points, room, Pose{}, config, workers};
};

TEST(ScanMatcher, asks_no_nearest_points_where_surfaces_hold_the_pose) {
  Matching m(true);
  const PoseInformation sum = m.matcher.linearise(Pose{});
  EXPECT_EQ(m.room.surfaces_asked, kPoints);
  EXPECT_EQ(m.room.nearest_asked, 0);
  EXPECT_EQ(sum.count, static_cast<std::size_t>(kPoints));
}

TEST(ScanMatcher,
     asks_nearest_points_once_for_each_point_without_a_surface_where_the_pose_is_open) {
  Matching m(false);
  const PoseInformation sum = m.matcher.linearise(Pose{});
  EXPECT_EQ(m.room.surfaces_asked, kPoints);
  EXPECT_EQ(m.room.nearest_asked, 2 * kAWall);
  EXPECT_EQ(sum.count, static_cast<std::size_t>(4 * kAWall));
  m.matcher.linearise(Pose{});
  EXPECT_EQ(m.room.surfaces_asked, kPoints);
  EXPECT_EQ(m.room.nearest_asked, 2 * kAWall);
}

TEST(ScanMatcher, rough_surfaces_give_way_to_the_nearest_points_of_a_map_that_keeps_points) {
  for (const bool keeps_points : {false, true}) {
    Matching m(false);
    m.room.thickness2_m2 = 4e-4;
    m.room.keeps_points = keeps_points;
    const PoseInformation sum = m.matcher.linearise(Pose{});
    EXPECT_EQ(m.room.nearest_asked, keeps_points ? kPoints : 2 * kAWall);
    EXPECT_EQ(sum.count, static_cast<std::size_t>(keeps_points ? 0 : 4 * kAWall));
  }
}

TEST(ScanMatcher, looks_up_again_only_the_points_that_moved_by_five_centimetres) {
  Matching m(true);
  m.matcher.linearise(Pose{});
  m.matcher.linearise(Pose(Eigen::Quaterniond::Identity(), {0.04, 0.0, 0.0}));
  EXPECT_EQ(m.room.surfaces_asked, kPoints);
  // From where they were looked up, not from the pose before.
  m.matcher.linearise(Pose(Eigen::Quaterniond::Identity(), {0.06, 0.0, 0.0}));
  EXPECT_EQ(m.room.surfaces_asked, 2 * kPoints);
  // A turn moves the far points of the room and not those near its axis.
  Matching turned(true);
  turned.matcher.linearise(Pose{});
  constexpr double kTurn_rad = 0.0125;  // 5 cm at 4 m
  turned.matcher.linearise(Pose(from_yaw(kTurn_rad), Eigen::Vector3d::Zero()));
  int moved = 0;
  for (const PointXyzi& p : turned.points) {
    moved += 2.0 * std::sin(0.5 * kTurn_rad) * std::hypot(p.x, p.y) >= 0.05 ? 1 : 0;
  }
  EXPECT_EQ(turned.room.surfaces_asked, kPoints + moved);
  EXPECT_GT(moved, kPoints / 4);
  EXPECT_LT(moved, 3 * kPoints / 4);
}

TEST(ScanMatcher, a_residual_that_is_not_looked_up_again_is_of_the_present_pose) {
  Matching m(true);
  m.matcher.linearise(Pose{});
  const PoseInformation sum =
      m.matcher.linearise(Pose(Eigen::Quaterniond::Identity(), {0.03, 0.0, 0.0}));
  // All residuals along x are 3 cm: the information's own solution leads back.
  const Vector6d step = sum.information.ldlt().solve(sum.gradient);
  EXPECT_NEAR(step[0], 0.03, 1e-6);
  EXPECT_NEAR(step.tail<5>().norm(), 0.0, 1e-6);
}

/// So many patches that surfaces hold the pose.
constexpr double kFinePatch_m = 0.5;

/// The room's walls of x, whose points lie off them by `rough_m`, one to either side in turn.
PoseInformation information_of_rough_ends(float rough_m, const Pose& T) {
  Matching m(true);
  int i = 0;
  for (PointXyzi& p : m.points) {
    const bool end = std::abs(p.x) > 3.9F;
    p.x += end ? (++i % 2 == 0 ? rough_m : -rough_m) : 0.0F;
  }
  m.config.robust_width = 1e9;
  m.config.patch_m = kFinePatch_m;
  m.config.max_patches = kPoints;
  ScanMatcher matcher(m.points, m.room, Pose{}, m.config, m.workers);
  return matcher.linearise(T);
}

/// Of the points on the two walls of an axis, all at their true places.
struct WallSums {
  double weights{0.0};
  double weights2{0.0};
  double weighted_variance{0.0};
};

constexpr double kMapVariance_m2 = 2e-4;  // (1 cm)^2, and the thickness of the room's walls

WallSums sums_of_walls(Eigen::Index axis) {
  const MatchingConfig config;
  WallSums sums;
  for (const PointXyzi& point : room_points()) {
    const Eigen::Vector3d p = point.position().cast<double>();
    if (std::abs(p[axis]) > 3.9) {
      const double cos2 = p[axis] * p[axis] / p.squaredNorm();
      const double sideways_m = config.angle_sigma_rad * p.norm();
      const double variance_m2 = kMapVariance_m2 + std::pow(config.range_sigma_m, 2) * cos2 +
                                 sideways_m * sideways_m * (1.0 - cos2);
      const double weight = cos2 / (cos2 + std::pow(config.grazing_cos, 2)) / variance_m2;
      sums.weights += weight;
      sums.weights2 += weight * weight;
      sums.weighted_variance += weight * variance_m2;
    }
  }
  return sums;
}

/// What surfaces gain that do not scatter at all: only the map's part of the variance is left.
double most_gained() {
  WallSums all;
  for (const Eigen::Index axis : {0, 1, 2}) {
    const WallSums sums = sums_of_walls(axis);
    all.weights += sums.weights;
    all.weighted_variance += sums.weighted_variance;
  }
  return all.weighted_variance / (kMapVariance_m2 * all.weights);
}

/// Their estimate's variance is that of the mean of such points, whatever the sensor's.
TEST(ScanMatcher, surfaces_leave_the_pose_as_uncertain_as_residuals_scatter) {
  constexpr float kRough_m = 0.06F;  // more would leave the pose open
  const Pose T;
  const double stated = information_of_rough_ends(0.0F, T).information(0, 0) / most_gained();
  const double rough = information_of_rough_ends(kRough_m, T).information(0, 0);
  // Var(sum w r / sum w) over its stated value 1 / sum w.
  const WallSums ends = sums_of_walls(0);
  const double times_stated = kRough_m * kRough_m * ends.weights2 / ends.weights;
  ASSERT_GT(times_stated, 5.0);
  EXPECT_NEAR(stated / rough, times_stated, 0.05 * times_stated);
  constexpr float kFlat_m = 0.02F;
  const double flat = information_of_rough_ends(kFlat_m, T).information(0, 0);
  EXPECT_GT(flat, 1.2 * stated);
  EXPECT_NEAR(flat / rough, std::pow(kRough_m / kFlat_m, 2), 0.5);
  // The other axes keep what they had.
  EXPECT_NEAR(information_of_rough_ends(kRough_m, T).information(1, 1) /
                  information_of_rough_ends(0.0F, T).information(1, 1),
              1.0,
              0.02);
}

/// Planes of the nearest points go through them: that nothing scatters there tells nothing.
TEST(ScanMatcher, residuals_gain_nothing_where_nearest_points_are_matched) {
  const auto information = [](bool ends) {
    Matching m(ends);
    m.config.patch_m = kFinePatch_m;  // the most, with or without ends
    ScanMatcher matcher(m.points, m.room, Pose{}, m.config, m.workers);
    const PoseInformation sum = matcher.linearise(Pose{});
    return sum.information(1, 1) * static_cast<double>(sum.count);
  };
  EXPECT_NEAR(information(true) / information(false), most_gained(), 0.01 * most_gained());
}

/// A wrong prediction is no scatter, or it would hold itself up.
TEST(ScanMatcher, residuals_of_a_wrong_prediction_lose_nothing) {
  const Pose wrong(Eigen::Quaterniond::Identity(), {0.2, 0.0, 0.0});
  const PoseInformation sum = information_of_rough_ends(0.0F, wrong);
  EXPECT_NEAR(
      sum.information(0, 0) / information_of_rough_ends(0.0F, Pose{}).information(0, 0), 1.0, 1e-6);
  EXPECT_NEAR(sum.information.ldlt().solve(sum.gradient)[0], 0.2, 1e-6);
}

/// Floor and ceiling of the room; between them crowns, in which every point has a plane of chance
/// beside it wherever it is, or upright planes 8 m apart that stay where they are.
class Grove final : public UnchangingMap {
 public:
  explicit Grove(bool is_solid) : is_solid_(is_solid) {}

  bool match_surface(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    if (std::abs(p.z()) < 3.0) {
      return false;
    }
    plane = {Eigen::Vector3d::UnitZ(), p.z() < 0.0 ? 4.0 : -4.0, 1e-4, 0.0};
    return true;
  }

  bool match_nearest(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    if (is_solid_) {
      Eigen::Index axis = 0;
      p.head<2>().cwiseAbs().maxCoeff(&axis);
      plane = {Eigen::Vector3d::Unit(axis), p[axis] < 0.0 ? 4.0 : -4.0, kCrown2_m2, 0.0};
      return true;
    }
    const VoxelIndex voxel = voxel_index(p.x(), p.y(), p.z(), 5.0);
    std::mt19937 chance(
        static_cast<unsigned>(voxel.x * 73856093 ^ voxel.y * 19349663 ^ voxel.z * 83492791));
    std::uniform_real_distribution<double> angle(0.0, 6.283185307);
    std::uniform_real_distribution<double> beside_m(-0.1, 0.1);
    const double a = angle(chance);
    const Eigen::Vector3d normal(std::cos(a), std::sin(a), 0.0);
    const Eigen::Vector3d centre = (Eigen::Vector3d(voxel.x, voxel.y, voxel.z).array() + 0.5) / 5.0;
    plane = {normal, -normal.dot(centre) + beside_m(chance), kCrown2_m2, 0.0};
    return true;
  }

 private:
  static constexpr double kCrown2_m2 = 0.1 * 0.1;
  bool is_solid_;
};

PoseInformation information_of_grove(bool is_solid) {
  const Grove grove(is_solid);
  const PointCloud points = room_points();
  const MatchingConfig config;
  Workers workers{2};
  ScanMatcher matcher(points, grove, Pose{}, config, workers);
  return matcher.linearise(Pose{});
}

/// Linearised, both promise as much. Displaced by a quarter of a metre only the planes that stay
/// where they are pull back.
TEST(ScanMatcher, planes_that_follow_the_scan_hold_nothing) {
  const Matrix6d crowns = information_of_grove(false).information;
  const Matrix6d posts = information_of_grove(true).information;
  for (int axis = 0; axis < 2; ++axis) {
    EXPECT_GT(posts(axis, axis), 100.0);
    EXPECT_LT(posts(axis, axis), 1e4) << "so certain that nobody asks";
    EXPECT_LT(crowns(axis, axis), 0.02 * posts(axis, axis));
  }
  EXPECT_NEAR(crowns(2, 2), posts(2, 2), 0.02 * posts(2, 2));
}

/// The room with crowns before its walls, which are found only by points near them.
class OvergrownRoom final : public UnchangingMap {
 public:
  bool match_surface(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    return room_.match_surface(p, plane) &&
           std::abs(plane.normal.dot(p) + plane.offset_m) < kReach_m;
  }

  bool match_nearest(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    return crowns_.match_nearest(p, plane);
  }

 private:
  static constexpr double kReach_m = 0.2;
  Room room_{true};
  Grove crowns_{false};
};

/// From a guess that is far off the walls are out of reach, and what is matched instead holds
/// nothing. Once they are within reach they hold the pose as ever.
TEST(ScanMatcher, what_a_guess_looked_like_is_forgotten_where_its_step_leads) {
  const OvergrownRoom room;
  const PointCloud points = room_points();
  MatchingConfig config;
  config.patch_m = kFinePatch_m;
  Workers workers{2};
  ScanMatcher guessing(points, room, Pose{}, config, workers);
  const Pose guess(Eigen::Quaterniond::Identity(), {0.3, 0.0, 0.0});
  const Matrix6d at_guess = guessing.linearise(guess).information;
  const Matrix6d after = guessing.linearise(Pose{}).information;
  ScanMatcher knowing(points, room, Pose{}, config, workers);
  const Matrix6d known = knowing.linearise(Pose{}).information;
  EXPECT_LT(at_guess(0, 0), 0.01 * known(0, 0));
  EXPECT_NEAR(after(0, 0) / known(0, 0), 1.0, 1e-9);
  EXPECT_NEAR(after(1, 1) / known(1, 1), 1.0, 1e-9);
}

/// A tunnel in which nearest points hold the length, each of them where it is: at every point that
/// stands out from the axis by less than `within_m`.
class TunnelWithPosts final : public UnchangingMap {
 public:
  explicit TunnelWithPosts(double within_m) : within_m_(within_m) {}

  bool match_surface(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    return tunnel_.match_surface(p, plane);
  }

  bool match_nearest(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    plane = {Eigen::Vector3d::UnitX(), p.x() < 0.0 ? 4.0 : -4.0, 0.1 * 0.1, 0.0};
    return p.tail<2>().cwiseAbs().maxCoeff() < within_m_;
  }

 private:
  double within_m_;
  Room tunnel_{false};
};

double information_along(double within_m) {
  const TunnelWithPosts tunnel(within_m);
  const PointCloud points = room_points();
  const MatchingConfig config;
  Workers workers{2};
  ScanMatcher matcher(points, tunnel, Pose{}, config, workers);
  return matcher.linearise(Pose{}).information(0, 0);
}

/// Two posts at the tunnel's ends have nobody to bear them out, walls have each other.
TEST(ScanMatcher, what_two_places_say_of_an_open_axis_is_not_believed) {
  EXPECT_GT(information_along(4.0), 50.0);
  EXPECT_NEAR(information_along(0.5), 0.0, 1e-6);
}

/// A tunnel at whose ends planes lie as chance laid them, wherever a point is, all along the same
/// way across: some of what they make up, they make up of the tunnel's walls.
class TunnelWithRings final : public UnchangingMap {
 public:
  bool match_surface(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    return tunnel_.match_surface(p, plane);
  }

  bool match_nearest(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    const VoxelIndex voxel = voxel_index(p.x(), p.y(), p.z(), 5.0);
    std::mt19937 chance(
        static_cast<unsigned>(voxel.x * 73856093 ^ voxel.y * 19349663 ^ voxel.z * 83492791));
    std::uniform_real_distribution<double> beside_m(-0.1, 0.1);
    const Eigen::Vector3d normal = Eigen::Vector3d(0.8, 0.6, 0.0);
    const Eigen::Vector3d centre = (Eigen::Vector3d(voxel.x, voxel.y, voxel.z).array() + 0.5) / 5.0;
    plane = {normal, -normal.dot(centre) + beside_m(chance), 0.1 * 0.1, 0.0};
    return true;
  }

 private:
  Room tunnel_{false};
};

TEST(ScanMatcher, walls_do_not_vouch_for_what_planes_of_chance_say_along_them) {
  const TunnelWithRings tunnel;
  const PointCloud points = room_points();
  const MatchingConfig config;
  Workers workers{2};
  ScanMatcher matcher(points, tunnel, Pose{}, config, workers);
  const Matrix6d information = matcher.linearise(Pose{}).information;
  EXPECT_GT(information(1, 1), 1e3);
  EXPECT_LT(information(0, 0), 1e-4 * information(1, 1));
}

/// Ends of a tunnel that most points find; in a corner planes go with them instead.
class TunnelWithLeaves final : public UnchangingMap {
 public:
  bool match_surface(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    return tunnel_.match_surface(p, plane);
  }

  bool match_nearest(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    const VoxelIndex voxel = voxel_index(p.x(), p.y(), p.z(), 5.0);
    const double end_m = p.x() < 0.0 ? -4.0 : 4.0;
    const double centre_m = (voxel.x + 0.5) / 5.0;
    const bool is_leaf = p.y() > 0.0 && (p.z() > 0.0 || p.x() > 0.0);
    plane = {Eigen::Vector3d::UnitX(), is_leaf ? -centre_m : -end_m, 0.1 * 0.1, 0.0};
    return true;
  }

 private:
  Room tunnel_{false};
};

/// The part of the pull that is not certain makes the step less certain, not longer.
TEST(ScanMatcher, a_step_is_as_long_as_the_scan_is_pulled_back) {
  constexpr double kAway_m = 0.1;
  const TunnelWithLeaves tunnel;
  const PointCloud points = room_points();
  const MatchingConfig config;
  Workers workers{2};
  ScanMatcher matcher(points, tunnel, Pose{}, config, workers);
  const PoseInformation sum =
      matcher.linearise({Eigen::Quaterniond::Identity(), {kAway_m, 0.0, 0.0}});
  const Vector6d step = -sum.information.ldlt().solve(sum.gradient);
  EXPECT_NEAR(step[0], -kAway_m, 0.25 * kAway_m);
}

/// Walls 4 m beside the tunnel's axis; its length is told by a field of plates far to one side, and
/// a part of these goes along with the scan.
class TunnelWithPlates final : public UnchangingMap {
 public:
  bool match_surface(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    return p.y() < 10.0 && tunnel_.match_surface(p, plane);
  }

  bool match_nearest(const Eigen::Vector3d& p, PlaneMatch& plane) const override {
    if (p.y() < 10.0) {
      return false;
    }
    const double plate_m = 4.0 * std::round(p.x() / 4.0);
    const VoxelIndex place = voxel_index(plate_m, p.y(), p.z(), 0.5);
    const bool goes_along = (7 * place.x + 3 * place.y + 5 * place.z) % 5 == 0;
    const double centre_m = (voxel_index(p.x(), p.y(), p.z(), 5.0).x + 0.5) / 5.0;
    plane = {Eigen::Vector3d::UnitX(), goes_along ? -centre_m : -plate_m, 0.01, 0.0};
    return true;
  }

 private:
  Room tunnel_{false};
};

/// What is shortened along the tunnel must not turn the robot instead.
TEST(ScanMatcher, an_open_axis_does_not_turn_the_robot) {
  constexpr double kAway_m = 0.1;
  const TunnelWithPlates tunnel;
  PointCloud points = room_points();
  for (int i = 0; i < 1600; ++i) {
    points.push_back({4.0F * static_cast<float>(i % 5 - 2),
                      12.0F + 0.5F * static_cast<float>(i / 5 % 16),
                      0.25F * static_cast<float>(i / 80) - 2.0F,
                      0.0F});
  }
  const MatchingConfig config;
  Workers workers{2};
  ScanMatcher matcher(points, tunnel, Pose{}, config, workers);
  const PoseInformation sum =
      matcher.linearise({Eigen::Quaterniond::Identity(), {kAway_m, 0.0, 0.0}});
  Matrix6d prior = Matrix6d::Zero();
  prior.diagonal() << Eigen::Vector3d::Constant(1.0 / 0.09), Eigen::Vector3d::Constant(4e4);
  const Matrix6d covariance = (sum.information + prior).inverse();
  const Vector6d step = -covariance * sum.gradient;
  EXPECT_LT(std::abs(step[5]), std::sqrt(covariance(5, 5)));
  EXPECT_LT(std::abs(step[5]), 1e-3);
  EXPECT_NEAR(step[0], -kAway_m, 0.4 * kAway_m);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
