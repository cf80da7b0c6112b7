// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/point_cloud.hpp"
#include "trigpoint/lio_mapper/past.hpp"

#include "local_map.hpp"
#include "relative_sigma.hpp"
#include "walled_world.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace trigpoint::lio_mapper {
namespace {

using Eigen::Vector3d;
using test::circle;
using test::driven_with_drift;
using test::row_at;
using test::seen_from;
using test::walled_world;

constexpr double kHalfSide_m = 60.0;

/// A circle of 120 m and a quarter of it again, on which the heading drifts: half a metre when it
/// closes.
struct TwoPasses {
  std::vector<Vector3d> world{walled_world(kHalfSide_m, 7)};
  std::vector<Pose> truth{circle(19.1, 150.0)};
  PastSnapshot snapshot;

  TwoPasses() {
    snapshot.input = driven_with_drift(truth, 2e-4, Vector3d::Zero());
    snapshot.reason = "place_revisited";
  }

  CloudOfKeyframe clouds() const {
    return [this](std::size_t i) { return seen_from(world, truth[i]); };
  }

  const Pose& newest_odom() const { return snapshot.input.keyframes.back().T_odom_base; }

  /// What a map without correction holds: every cloud where odom had it.
  std::unique_ptr<LocalMap> as_driven() const {
    auto map = make_local_map(snapshot.local_map);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      map->insert(moved(clouds()(i), snapshot.input.keyframes[i].T_odom_base));
    }
    return map;
  }

  /// Share of the map's points round the robot that lie where, seen from it, nothing is.
  double ghosts(const LocalMap& map) const {
    const Pose T_world_odom = truth.back() * newest_odom().inverse();
    std::size_t near = 0;
    std::size_t wrong = 0;
    for (const PointXyzi& point : map.points()) {
      const Vector3d p = T_world_odom * point.position().cast<double>();
      if (p.z() < 0.5 || (p - truth.back().p).norm() > 12.0) {
        continue;
      }
      ++near;
      // Walls are sampled every 0.2 m, a little unevenly.
      constexpr double kSampling_m = 0.22;
      wrong += std::none_of(world.begin(), world.end(), [&](const Vector3d& q) {
        return (p - q).norm() < kSampling_m;
      });
    }
    return static_cast<double>(wrong) / static_cast<double>(std::max<std::size_t>(1, near));
  }
};

const TwoPasses& two_passes() {
  static const TwoPasses made;
  return made;
}

TEST(CorrectLocalMap, lays_the_first_pass_of_a_place_onto_the_second) {
  const TwoPasses& passes = two_passes();
  const auto corrected = correct_local_map(passes.snapshot, passes.clouds());
  ASSERT_TRUE(corrected);
  EXPECT_GT(corrected->report.loops, 0U);
  EXPECT_GT(corrected->report.largest_move_m, 0.2) << "the first pass lay half a metre off";
  const double before = passes.ghosts(*passes.as_driven());
  const double after = passes.ghosts(corrected->map());
  EXPECT_GT(before, 0.2) << "without correction there must be a second wall";
  EXPECT_LT(after, 0.02);
}

TEST(CorrectLocalMap, leaves_the_newest_keyframe_where_odom_has_it) {
  const TwoPasses& passes = two_passes();
  const auto corrected = correct_local_map(passes.snapshot, passes.clouds());
  ASSERT_TRUE(corrected);
  std::vector<double> off_m;
  PlaneMatch plane;
  for (const PointXyzi& point : moved(passes.clouds()(149), passes.newest_odom())) {
    const Vector3d p = point.position().cast<double>();
    if (corrected->map().match(p, plane)) {
      off_m.push_back(plane.normal.dot(p) + plane.offset_m);
    }
  }
  ASSERT_GT(off_m.size(), 500U);
  std::nth_element(off_m.begin(), off_m.begin() + off_m.size() / 2, off_m.end());
  EXPECT_NEAR(off_m[off_m.size() / 2], 0.0, 0.01);
}

TEST(CorrectLocalMap, gives_the_same_bits_twice) {
  const TwoPasses& passes = two_passes();
  const auto a = correct_local_map(passes.snapshot, passes.clouds());
  const auto b = correct_local_map(passes.snapshot, passes.clouds());
  const PointCloud first = a->map().points();
  const PointCloud second = b->map().points();
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    ASSERT_EQ(first[i].position(), second[i].position());
  }
}

TEST(CorrectLocalMap, uses_what_was_registered_before_and_looks_only_at_what_is_new) {
  const TwoPasses& passes = two_passes();
  const CorrectedPast whole = correct_past(passes.snapshot.input, passes.clouds());
  PastSnapshot again = passes.snapshot;
  again.options.known_loops = whole.registered;
  again.options.search_from = again.input.keyframes.size();
  std::size_t clouds = 0;
  const CorrectedPast past = correct_past(
      again.input,
      [&](std::size_t i) {
        ++clouds;
        return passes.clouds()(i);
      },
      again.options);
  EXPECT_EQ(clouds, 0U);
  EXPECT_EQ(past.loops.size(), whole.loops.size());
  EXPECT_EQ(past.T_map_base.back()->p, whole.T_map_base.back()->p);
}

// GPS says that odom bends: 0.6 m in the last 180 m. With 2 m a fix that may be GPS itself.
TEST(CorrectLocalMap, leaves_out_what_was_moved_by_rows_that_know_no_better) {
  const std::vector<Pose> truth = [] {
    std::vector<Pose> poses;
    for (double x = 0.0; x < 400.0; x += 1.0) {
      poses.emplace_back(Eigen::Quaterniond::Identity(), Vector3d(x, 0.0, 1.0));
    }
    return poses;
  }();
  for (const bool good : {false, true}) {
    PastSnapshot snapshot;
    snapshot.options.loops = false;
    snapshot.input = driven_with_drift(truth, 0.0, Vector3d::Zero());
    snapshot.input.drift.position_sigma_m_sqrtm = 0.05;
    for (GraphKeyframe& keyframe : snapshot.input.keyframes) {
      keyframe.aligned = true;
    }
    for (std::size_t i = 1; i < truth.size(); ++i) {
      const double back = 1.0 - static_cast<double>(i) / 400.0;
      const Vector3d off(0.0, std::min(0.6, 3.0 * back * back), 0.0);
      snapshot.input.rows.push_back(
          row_at(snapshot.input.keyframes[i].stamp_ns, truth[i].p + off, good ? 0.2 : 2.0));
    }
    const auto corrected = correct_local_map(snapshot, [](std::size_t) { return PointCloud(1); });
    ASSERT_TRUE(corrected);
    EXPECT_EQ(corrected->report.left_out > 0, !good);
    EXPECT_EQ(corrected->report.largest_move_m > 0.1, good);
    EXPECT_GE(corrected->report.placed, 60U) << "the newest stretch is always there";
  }
}

TEST(CorrectLocalMap, does_not_build_where_hardly_anything_has_moved) {
  const TwoPasses& passes = two_passes();
  PastSnapshot snapshot;
  snapshot.input = driven_with_drift(passes.truth, 1e-6, Vector3d::Zero());
  const auto corrected = correct_local_map(snapshot, passes.clouds());
  ASSERT_TRUE(corrected);
  EXPECT_GT(corrected->report.loops, 0U);
  EXPECT_FALSE(corrected->report.changed);
  EXPECT_TRUE(corrected->map().empty());
}

// The first pass lies beyond the local map's side for a while: the mapper has forgotten it.
TEST(CorrectLocalMap, does_not_bring_back_what_was_forgotten) {
  const TwoPasses& passes = two_passes();
  PastSnapshot snapshot = passes.snapshot;
  // The circle's diameter is 38 m, seen along an axis at least 27 m.
  snapshot.local_map.half_side_m = 20.0;
  const auto corrected = correct_local_map(snapshot, passes.clouds());
  ASSERT_TRUE(corrected);
  EXPECT_GT(corrected->report.loops, 0U);
  EXPECT_LE(corrected->report.placed + corrected->report.left_out, 61U) << "half a circle";
}

TEST(CorrectLocalMap, lets_what_the_reader_of_clouds_throws_through) {
  EXPECT_THROW(correct_local_map(two_passes().snapshot,
                                 [](std::size_t) -> PointCloud { throw std::runtime_error("no"); }),
               std::runtime_error);
}

TEST(CorrectLocalMap, has_nothing_to_give_without_a_keyframe) {
  EXPECT_FALSE(correct_local_map({}, [](std::size_t) { return PointCloud{}; }));
}

/// Edges of 2 cm in a line.
Graph chain(std::size_t nodes) {
  Graph graph;
  for (std::size_t i = 0; i + 1 < nodes; ++i) {
    RelativeFactor edge{i, i + 1, {}, Matrix6d::Identity()};
    edge.covariance *= 0.02 * 0.02;
    graph.edges.push_back(edge);
  }
  return graph;
}

TEST(RelativeSigma, grows_with_the_root_of_the_edges_between) {
  const std::vector<Pose> nodes(26);
  const RelativeSigma sigma(chain(26), nodes, 25);
  EXPECT_NEAR(sigma.of(0), 0.1, 1e-6);
  EXPECT_NEAR(sigma.of(9), 0.08, 1e-6);
  EXPECT_NEAR(sigma.of(25), 0.0, 1e-6);
}

TEST(RelativeSigma, takes_a_loop_for_a_second_way) {
  Graph graph = chain(26);
  RelativeFactor loop{0, 25, {}, Matrix6d::Identity()};
  loop.covariance *= 0.1 * 0.1;
  graph.loops.push_back(loop);
  const std::vector<Pose> nodes(26);
  EXPECT_NEAR(RelativeSigma(graph, nodes, 25).of(0), 0.1 / std::sqrt(2.0), 1e-6);
}

TEST(RelativeSigma, takes_rows_for_a_way_through_the_map_unless_they_are_contradicted) {
  Graph graph = chain(1001);
  for (const std::size_t node : {std::size_t{0}, std::size_t{1000}}) {
    PositionFactor row;
    row.node = node;
    row.sqrt_information = Eigen::Matrix3d::Identity() / 0.03;
    graph.positions.push_back(row);
  }
  std::vector<Pose> nodes(1001);
  // Through the map 0.03 sqrt(2), beside it the chain.
  const double through = 2.0 * 0.03 * 0.03;
  const double along = 1000.0 * 0.02 * 0.02;
  EXPECT_NEAR(RelativeSigma(graph, nodes, 1000).of(0),
              std::sqrt(through * along / (through + along)),
              1e-6);
  graph.positions[0].position_map_m = {1.0, 0.0, 0.0};
  EXPECT_NEAR(RelativeSigma(graph, nodes, 1000).of(0), std::sqrt(along), 1e-3);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
