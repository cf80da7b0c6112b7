// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/pose_graph.hpp"

#include "pose_graph_registration.hpp"
#include "pose_graph_solver.hpp"
#include "walled_world.hpp"
#include <gtest/gtest.h>

#include <algorithm>

namespace trigpoint::lio_mapper {
namespace {

using Eigen::Vector3d;
using test::circle;
using test::driven_with_drift;
using test::moved_by;
using test::row_at;
using test::seen_from;
using test::walled_world;

constexpr double kSolved_m = 1e-3;  // of a solution that has a closed form
constexpr double kSameSurface_m = 0.03;
constexpr Nanoseconds kSecond = kNanosecondsPerSecond;

PointCloud no_cloud(std::size_t) {
  return {};
}

PoseGraphOptions without_loops() {
  PoseGraphOptions options;
  options.loops = false;
  return options;
}

/// Poses a metre apart along x.
std::vector<Pose> straight(std::size_t count) {
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < count; ++i) {
    poses.emplace_back(Eigen::Quaterniond::Identity(), Vector3d(static_cast<double>(i), 0.0, 0.0));
  }
  return poses;
}

void align(GraphInput& input, const YawPose& T_map_odom) {
  for (GraphKeyframe& keyframe : input.keyframes) {
    keyframe.aligned = true;
    keyframe.T_map_odom = T_map_odom;
  }
}

/// Largest distance between places of the second lap and the same places of the first.
double gap_between_laps_m(const std::vector<Pose>& truth, const CorrectedPast& past) {
  double largest_m = 0.0;
  for (std::size_t later = 0; later < truth.size(); ++later) {
    for (std::size_t earlier = 0; earlier + 60 < later; ++earlier) {
      const Pose expected = truth[earlier].inverse() * truth[later];
      if (expected.p.norm() < 0.6) {
        const Pose found = past.T_map_base[earlier]->inverse() * *past.T_map_base[later];
        largest_m = std::max(largest_m, (found.p - expected.p).norm());
      }
    }
  }
  return largest_m;
}

TEST(PoseGraph, shares_drift_between_two_fixes_evenly) {
  // Position walks, heading does not: between two exact positions the expectation of such a walk
  // is a straight line (Brownian bridge), so the correction in the middle is half of that at the
  // end.
  const std::vector<Pose> truth = straight(101);
  GraphInput input = driven_with_drift(truth, 0.0, {0.0, 0.01, 0.0});
  input.drift = {0.02, 1e-7, 1e-7};
  align(input, {});
  for (const std::size_t i : {0, 100}) {
    for (int repeated = 0; repeated < 10; ++repeated) {
      input.rows.push_back(
          row_at(input.keyframes[i].stamp_ns + (i == 0 ? 1 : 0), truth[i].p, 1e-4));
    }
  }
  const CorrectedPast past = correct_past(input, no_cloud, without_loops());
  ASSERT_EQ(past.report.rows, 20U);
  EXPECT_TRUE(past.report.converged);
  EXPECT_NEAR(input.keyframes[100].T_odom_base.p.y(), 1.0, 1e-9);
  for (const std::size_t i : {0, 25, 50, 75, 100}) {
    // An error that grows evenly is met exactly.
    EXPECT_NEAR((past.T_map_base[i]->p - truth[i].p).norm(), 0.0, kSolved_m) << i;
  }
}

TEST(PoseGraph, places_the_antenna_and_not_the_base_on_a_fix) {
  const Vector3d lever_arm_base_m(0.5, -0.3, 1.2);
  const std::vector<Pose> truth = circle(20.0, 60.0);
  GraphInput input = driven_with_drift(truth, 0.0, Vector3d::Zero());
  align(input, {0.05, {0.4, -0.3, 0.2}, {0.0, 0.0}});  // where the map was thought to be
  for (std::size_t i = 1; i < truth.size(); ++i) {
    input.rows.push_back(row_at(input.keyframes[i].stamp_ns, truth[i] * lever_arm_base_m, 0.02));
    input.rows.back().update.lever_arm_base_m = lever_arm_base_m;
  }
  const CorrectedPast past = correct_past(input, no_cloud, without_loops());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_LT((past.T_map_base[i]->p - truth[i].p).norm(), 5e-3) << i;
  }
}

TEST(PoseGraph, uses_only_the_axes_that_the_gate_fused) {
  const std::vector<Pose> truth = straight(60);
  GraphInput input = driven_with_drift(truth, 0.0, Vector3d::Zero());
  align(input, {});
  for (std::size_t i = 1; i < truth.size(); ++i) {
    StoredRow row =
        row_at(input.keyframes[i].stamp_ns, truth[i].p + Vector3d(0.0, 0.5, 40.0), 0.02);
    row.update.decision[2] = AxisDecision::kCoast;
    input.rows.push_back(row);
  }
  const CorrectedPast past = correct_past(input, no_cloud, without_loops());
  EXPECT_NEAR(past.T_map_base[30]->p.y(), 0.5, 0.02);
  EXPECT_NEAR(past.T_map_base[30]->p.z(), 0.0, 0.02);
}

TEST(PoseGraph, is_not_moved_by_a_wrong_fix_among_good_ones) {
  const std::vector<Pose> truth = circle(30.0, 120.0);
  GraphInput input = driven_with_drift(truth, 1e-4, Vector3d::Zero());
  align(input, {});
  for (std::size_t i = 2; i < truth.size(); i += 2) {
    input.rows.push_back(row_at(input.keyframes[i].stamp_ns, truth[i].p, 0.05));
  }
  const CorrectedPast good = correct_past(input, no_cloud, without_loops());
  input.rows[30].update.position_map_m += Vector3d(5.0, -3.0, 2.0);
  const CorrectedPast bad = correct_past(input, no_cloud, without_loops());
  EXPECT_EQ(good.report.rows_doubted, 0U);
  EXPECT_EQ(bad.report.rows_doubted, 1U);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    // A hundredth of the fix's error.
    EXPECT_LT((bad.T_map_base[i]->p - good.T_map_base[i]->p).norm(), 0.06) << i;
  }
}

TEST(PoseGraph, levels_by_the_tilt_that_was_learnt_farther_on) {
  const std::vector<Pose> truth = straight(150);
  const Eigen::Quaterniond q_odom_map = so3_exp({0.0, 0.01, 0.0});  // odom leans by 0.6 degree
  GraphInput input =
      driven_with_drift(truth, 0.0, Vector3d::Zero(), {q_odom_map, Vector3d::Zero()});
  align(input, {});
  for (std::size_t i = 90; i < truth.size(); ++i) {
    input.keyframes[i].T_map_odom.tilt_rad = {0.0, -0.01};
  }
  const CorrectedPast past = correct_past(input, no_cloud, without_loops());
  for (const std::size_t i : {0, 40, 80}) {
    EXPECT_LT(past.T_map_base[i]->q.angularDistance(Eigen::Quaterniond::Identity()), 1e-3) << i;
  }
}

class TwoLaps : public testing::Test {
 protected:
  std::vector<Vector3d> world_{walled_world(55.0, 3)};
  std::vector<Pose> truth_{circle(25.0, 250.0)};
  // A degree a hundred metres.
  GraphInput input_{driven_with_drift(truth_, 1.75e-4, {5e-4, 0.0, 0.0})};
};

TEST_F(TwoLaps, meet_themselves_by_loop_closures_without_any_gps) {
  const auto cloud_of = [&](std::size_t i) { return seen_from(world_, truth_[i]); };
  const CorrectedPast open = correct_past(input_, cloud_of, without_loops());
  const CorrectedPast closed = correct_past(input_, cloud_of);
  EXPECT_EQ(closed.frame, "odom");
  EXPECT_GT(gap_between_laps_m(truth_, open), 0.5);
  EXPECT_LT(gap_between_laps_m(truth_, closed), kSameSurface_m);
  EXPECT_GT(closed.report.loops, 15U);
}

TEST_F(TwoLaps, come_out_with_the_same_bits_each_time) {
  const auto cloud_of = [&](std::size_t i) { return seen_from(world_, truth_[i]); };
  const CorrectedPast once = correct_past(input_, cloud_of);
  const CorrectedPast again = correct_past(input_, cloud_of);
  for (std::size_t i = 0; i < truth_.size(); ++i) {
    EXPECT_EQ(once.T_map_base[i]->p, again.T_map_base[i]->p);
    EXPECT_EQ(once.T_map_base[i]->q.coeffs(), again.T_map_base[i]->q.coeffs());
  }
}

TEST_F(TwoLaps, do_not_believe_a_place_that_only_looks_like_another) {
  // One keyframe in eight of the second lap sees the world 1.5 m farther along.
  const auto cloud_of = [&](std::size_t i) {
    const bool wrong = i > 160 && i % 8 == 0;
    return seen_from(world_, wrong ? truth_[i] * moved_by({1.5, 0.0, 0.0}) : truth_[i]);
  };
  const CorrectedPast past = correct_past(input_, cloud_of);
  EXPECT_LT(gap_between_laps_m(truth_, past), kSameSurface_m);
  // Seen from their neighbours alone, before the graph is asked.
  EXPECT_TRUE(std::any_of(past.report.loops_refused.begin(),
                          past.report.loops_refused.end(),
                          [](const NamedCount& reason) { return reason.name == "inconsistent"; }));
  for (const Loop& loop : past.loops) {
    const Pose expected = truth_[loop.earlier].inverse() * truth_[loop.later];
    EXPECT_LT((loop.T_earlier_later.p - expected.p).norm(), 0.1);
  }
}

TEST_F(TwoLaps, of_two_sessions_land_on_each_other) {
  const std::vector<Pose> first(truth_.begin(), truth_.begin() + 125);
  const std::vector<Pose> second(truth_.begin() + 125, truth_.end());
  GraphInput both = driven_with_drift(first, 1e-4, Vector3d::Zero());
  GraphInput other = driven_with_drift(second, -1e-4, Vector3d::Zero());
  align(both, {});
  align(other, {0.01, {-3.6, 0.9, 0.4}, {0.0, 0.0}});  // GPS of another day: half a metre off
  merge_sessions(both, other, moved_by({4.0, -1.0, -0.5}));
  EXPECT_EQ(both.keyframes.back().odom_epoch, 1U);
  const CorrectedPast past =
      correct_past(both, [&](std::size_t i) { return seen_from(world_, truth_[i]); });
  EXPECT_GT(past.report.loops, 10U);
  EXPECT_LT(gap_between_laps_m(truth_, past), kSameSurface_m);
}

TEST(CorrectedTrajectory, goes_over_from_one_keyframe_to_the_next) {
  GraphInput input = driven_with_drift(straight(3), 0.0, Vector3d::Zero());
  CorrectedPast past;
  past.T_map_base = {
      moved_by({0.0, 0.0, 0.0}), moved_by({1.0, 0.4, 0.0}), moved_by({2.0, 0.4, 0.0})};
  const std::vector<MapSample> samples = corrected_trajectory(input, past);
  ASSERT_EQ(samples.size(), 9U);
  EXPECT_EQ(samples[2].stamp_ns, kSecond / 2);
  EXPECT_LT((samples[2].T_map_base.p - Vector3d(0.5, 0.2, 0.0)).norm(), 1e-12);
  EXPECT_LT((samples[4].T_map_base.p - Vector3d(1.0, 0.4, 0.0)).norm(), 1e-12);
  EXPECT_LT((samples[6].T_map_base.p - Vector3d(1.5, 0.4, 0.0)).norm(), 1e-12);
}

TEST(CorrectedTrajectory, leaves_out_an_epoch_that_nothing_ties_to_the_map) {
  GraphInput input = driven_with_drift(straight(20), 0.0, Vector3d::Zero());
  align(input, {});
  GraphInput unaligned = driven_with_drift(straight(5), 0.0, Vector3d::Zero());
  merge_sessions(input, unaligned, Pose{});
  const CorrectedPast past = correct_past(input, no_cloud, without_loops());
  EXPECT_EQ(past.report.keyframes_left_out, 5U);
  EXPECT_FALSE(past.T_map_base.back().has_value());
  EXPECT_EQ(corrected_trajectory(input, past).size(), 4U * 19U + 1U);
}

TEST(FitCloud, finds_a_known_displacement) {
  const std::vector<Vector3d> world = walled_world(30.0, 5);
  PointCloud cloud;
  for (const Vector3d& p : world) {
    cloud.push_back(
        {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()), 0.0F});
  }
  SurfelMapConfig config;
  config.max_residual_m = 1.0;
  const auto map = make_surfel_map(config);
  map->insert(cloud);
  const Pose truth(from_yaw(0.3), {2.0, 1.0, 1.0});
  std::vector<Vector3d> points;
  for (const PointXyzi& point : seen_from(world, truth)) {
    points.push_back(point.position().cast<double>());
  }
  const auto found =
      fit_cloud(points, *map, truth * Pose(so3_exp({0.01, -0.01, 0.04}), {0.4, -0.3, 0.15}));
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((found->T_map_cloud.p - truth.p).norm(), 0.02);
  EXPECT_LT(found->T_map_cloud.q.angularDistance(truth.q), 2e-3);
  EXPECT_GT(found->fit, 0.9);
}

TEST(FitCloud, says_that_a_corridor_leaves_its_own_direction_free) {
  PointCloud corridor;
  std::vector<Vector3d> points;
  for (double x = -15.0; x < 15.0; x += 0.15) {
    for (double z = 0.0; z < 2.5; z += 0.2) {
      for (const double y : {-1.5, 1.5}) {
        corridor.push_back(
            {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z), 0.0F});
        if (std::abs(x) < 8.0) {
          points.emplace_back(x, y, z - 1.0);
        }
      }
    }
    for (double y = -1.4; y < 1.5; y += 0.2) {
      corridor.push_back({static_cast<float>(x), static_cast<float>(y), 0.0F, 0.0F});
      if (std::abs(x) < 8.0) {
        points.emplace_back(x, y, -1.0);
      }
    }
  }
  const auto map = make_surfel_map({});
  map->insert(corridor);
  const auto found = fit_cloud(points, *map, moved_by({0.3, 0.1, 1.0}));
  ASSERT_TRUE(found.has_value());
  // More than it is off along the corridor; planes where floor and wall meet tell a little.
  EXPECT_GT(std::sqrt(found->covariance(0, 0)), 0.5);
  EXPECT_LT(std::sqrt(found->covariance(1, 1)), 0.05);
  EXPECT_NEAR(found->T_map_cloud.p.x(), 0.3, 0.05);
  EXPECT_NEAR(found->T_map_cloud.p.y(), 0.0, 0.02);
}

TEST(PoseGraphSolver, whitens_to_the_inverse_of_the_covariance) {
  Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Random();
  const Eigen::Matrix<double, 6, 6> covariance =
      a * a.transpose() + Eigen::Matrix<double, 6, 6>::Identity();
  const Eigen::Matrix<double, 6, 6> W = whitening(covariance);
  EXPECT_LT((W.transpose() * W - covariance.inverse()).norm(), 1e-9);
}

TEST(PoseGraphSolver, weighs_two_measurements_by_their_information) {
  Graph graph;
  const auto covariance = [](double sigma) {
    return Eigen::Matrix<double, 6, 6>(sigma * sigma * Eigen::Matrix<double, 6, 6>::Identity());
  };
  graph.priors.push_back({0, moved_by({0.0, 0.0, 0.0}), covariance(1.0)});
  graph.priors.push_back({0, moved_by({5.0, 0.0, 0.0}), covariance(0.5)});
  std::vector<Pose> nodes(1);
  solve(graph, nodes);
  EXPECT_NEAR(nodes[0].p.x(), 4.0, 1e-6);  // (0 / 1 + 5 / 0.25) / (1 + 1 / 0.25)
}

}  // namespace
}  // namespace trigpoint::lio_mapper
