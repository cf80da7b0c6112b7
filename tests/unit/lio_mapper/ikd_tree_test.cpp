// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "ikd_tree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <random>
#include <thread>
#include <tuple>

namespace trigpoint::lio_mapper {
namespace {

using Neighbour = IkdTree::Neighbour;
using Box = IkdTree::Box;
using Eigen::Vector3f;

auto key_of(const PointXyzi& p) {
  return std::make_tuple(p.x, p.y, p.z);
}

PointCloud sorted(PointCloud points) {
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
    return key_of(a) < key_of(b);
  });
  return points;
}

bool same_places(const PointCloud& a, const PointCloud& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& p, const auto& q) {
    return key_of(p) == key_of(q);
  });
}

/// A cube of points, or a street-like slab when `flat`.
PointCloud random_tree_points(std::size_t count,
                              std::mt19937& random,
                              float half_m = 20.0F,
                              bool flat = false) {
  std::uniform_real_distribution<float> place(-half_m, half_m);
  std::uniform_real_distribution<float> height(-0.1F, 0.1F);
  PointCloud points;
  for (std::size_t i = 0; i < count; ++i) {
    const float x = place(random);
    const float y = place(random);
    points.push_back({x, y, flat ? height(random) : place(random), static_cast<float>(i)});
  }
  return points;
}

/// The same answers without any tree.
std::vector<Neighbour> by_brute_force(const PointCloud& points,
                                      const Vector3f& query,
                                      float max_distance_m,
                                      std::size_t k) {
  std::vector<Neighbour> all;
  for (const PointXyzi& p : points) {
    const float dx = p.x - query.x();
    const float dy = p.y - query.y();
    const float dz = p.z - query.z();
    const float d2 = dx * dx + dy * dy + dz * dz;
    if (d2 <= max_distance_m * max_distance_m) {
      all.push_back({d2, {p.x, p.y, p.z}});
    }
  }
  std::sort(all.begin(), all.end(), [](const Neighbour& a, const Neighbour& b) {
    return std::make_tuple(a.distance2_m2, a.position_m.x(), a.position_m.y(), a.position_m.z()) <
           std::make_tuple(b.distance2_m2, b.position_m.x(), b.position_m.y(), b.position_m.z());
  });
  all.resize(std::min(all.size(), k));
  return all;
}

void expect_same_answers(const IkdTree& tree, const PointCloud& points, std::mt19937& random) {
  std::uniform_real_distribution<float> place(-25.0F, 25.0F);
  for (int i = 0; i < 20; ++i) {
    const Vector3f query{place(random), place(random), place(random)};
    const float reach_m = i % 3 == 0 ? 2.2F : 100.0F;
    const std::size_t k = i % 2 == 0 ? 5 : 17;
    std::vector<Neighbour> found(k);
    found.resize(tree.nearest(query, reach_m, found));
    const auto expected = by_brute_force(points, query, reach_m, k);
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t j = 0; j < found.size(); ++j) {
      ASSERT_EQ(found[j].distance2_m2, expected[j].distance2_m2);
      ASSERT_EQ(found[j].position_m, expected[j].position_m);
    }
  }
}

TEST(IkdTree, answers_nothing_when_empty) {
  const IkdTree tree;
  std::array<Neighbour, 5> found;
  EXPECT_EQ(tree.nearest(Vector3f::Zero(), 1e6F, found), 0U);
  EXPECT_TRUE(tree.empty());
}

TEST(IkdTree, leaves_out_what_is_not_finite) {
  IkdTree tree;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  tree.insert(
      PointCloud{{nan, 0, 0, 0}, {0, std::numeric_limits<float>::infinity(), 0, 0}, {1, 2, 3, 0}});
  tree.insert_thinned(PointCloud{{0, nan, 0, 0}, {4, 5, 6, 0}}, 0.5F);
  EXPECT_EQ(tree.size(), 2U);
  std::array<Neighbour, 5> found;
  EXPECT_EQ(tree.nearest({nan, 0, 0}, 10.0F, found), 0U);
}

class RandomOperations : public ::testing::TestWithParam<unsigned> {};

/// Insertions and deletions of all kinds, in any order, small rebuilds and rebuilds aside among
/// them.
TEST_P(RandomOperations, leave_the_nearest_neighbours_equal_to_brute_force) {
  std::mt19937 random(GetParam());
  IkdTree tree({.unbalanced_share = 0.65, .deleted_share = 0.5, .rebuilt_aside = 200});
  PointCloud held;
  const auto pick = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
  for (int step = 0; step < 60; ++step) {
    const int what = pick(10);
    if (what < 6) {
      // Some land in a corner, so that the tree leans.
      PointCloud more =
          random_tree_points(static_cast<std::size_t>(pick(400)), random, 20.0F, pick(2) == 0);
      if (pick(2) == 0) {
        for (PointXyzi& p : more) {
          p = {0.05F * p.x + static_cast<float>(step), 0.05F * p.y, p.z, p.intensity};
        }
      }
      tree.insert(more);
      held.insert(held.end(), more.begin(), more.end());
    } else {
      const Vector3f corner = random_tree_points(1, random)[0].position();
      const float side = 0.5F * static_cast<float>(1 + pick(60));
      const Box box(corner, Vector3f(corner + Vector3f::Constant(side)));
      const bool inside = what < 9;
      if (inside) {
        tree.erase_inside(box);
      } else {
        tree.erase_outside(Box(Vector3f::Constant(-15.0F), Vector3f::Constant(18.0F)));
      }
      std::erase_if(held, [&](const PointXyzi& p) {
        return inside ? box.contains(p.position())
                      : !Box(Vector3f::Constant(-15.0F), Vector3f::Constant(18.0F))
                             .contains(p.position());
      });
    }
    if (pick(8) == 0) {
      tree.finish_rebuilds();
    }
    ASSERT_EQ(tree.size(), held.size()) << "step " << step;
    ASSERT_NO_FATAL_FAILURE(expect_same_answers(tree, held, random)) << "step " << step;
  }
  EXPECT_TRUE(same_places(tree.points(), sorted(held)));
  EXPECT_GT(tree.rebuilds_aside(), 0U);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomOperations, ::testing::Range(1U, 11U));

/// The rule of on-tree down-sampling, written with a map of voxels instead.
class ThinnedByHand {
 public:
  explicit ThinnedByHand(float voxel_m) : voxel_m_(voxel_m) {}

  void insert(const PointCloud& points) {
    for (const PointXyzi& p : points) {
      const auto index = [&](float c) {
        return static_cast<int>(std::floor(static_cast<double>(c) * (1.0F / voxel_m_)));
      };
      const std::tuple voxel{index(p.x), index(p.y), index(p.z)};
      const auto [entry, is_new] = voxels_.try_emplace(voxel, p);
      if (!is_new && to_centre(p, voxel) < to_centre(entry->second, voxel)) {
        entry->second = p;
      }
    }
  }

  void erase_outside(const Box& box) {
    std::erase_if(voxels_,
                  [&](const auto& entry) { return !box.contains(entry.second.position()); });
  }

  PointCloud points() const {
    PointCloud all;
    for (const auto& [voxel, point] : voxels_) {
      all.push_back(point);
    }
    return sorted(all);
  }

 private:
  float to_centre(const PointXyzi& p, const std::tuple<int, int, int>& voxel) const {
    const auto [x, y, z] = voxel;
    const Vector3f centre = voxel_m_ * Vector3f(static_cast<float>(x) + 0.5F,
                                                static_cast<float>(y) + 0.5F,
                                                static_cast<float>(z) + 0.5F);
    return (p.position() - centre).squaredNorm();
  }

  float voxel_m_;
  std::map<std::tuple<int, int, int>, PointXyzi> voxels_;
};

TEST_P(RandomOperations, thinned_insertion_keeps_the_centremost_point_of_each_voxel) {
  std::mt19937 random(GetParam() + 1000);
  IkdTree tree({.unbalanced_share = 0.65, .deleted_share = 0.5, .rebuilt_aside = 200});
  ThinnedByHand expected(0.5F);
  for (int scan = 0; scan < 15; ++scan) {
    PointCloud points = random_tree_points(1500, random, 6.0F, scan % 3 != 0);
    for (PointXyzi& p : points) {
      p.x += static_cast<float>(scan);
    }
    tree.insert_thinned(points, 0.5F);
    expected.insert(points);
    if (scan % 4 == 3) {
      const Box box(Vector3f(static_cast<float>(scan) - 7.0F, -5.0F, -5.0F),
                    Vector3f(static_cast<float>(scan) + 9.0F, 5.0F, 5.0F));
      tree.erase_outside(box);
      expected.erase_outside(box);
    }
    ASSERT_TRUE(same_places(tree.points(), expected.points())) << "scan " << scan;
  }
  tree.finish_rebuilds();
  EXPECT_TRUE(same_places(tree.points(), expected.points()));
}

TEST(IkdTree, stays_balanced_while_a_drive_goes_one_way) {
  std::mt19937 random(5);
  IkdTree tree;
  for (int scan = 0; scan < 200; ++scan) {
    PointCloud points = random_tree_points(500, random, 10.0F, true);
    for (PointXyzi& p : points) {
      p.x += 2.0F * static_cast<float>(scan);
    }
    tree.insert(points);
  }
  tree.finish_rebuilds();
  // 100,000 points in half-full buckets are 14 levels when perfectly balanced; a share of 0.65 a
  // level allows ln(12500) / ln(1 / 0.65) = 22.
  EXPECT_LE(tree.depth(), 24U);
  EXPECT_GT(tree.rebuilds_aside(), 0U);
}

TEST(IkdTree, holds_many_points_at_one_place) {
  IkdTree tree;
  tree.insert(PointCloud(100, PointXyzi{1.0F, 2.0F, 3.0F, 0.0F}));
  EXPECT_EQ(tree.size(), 100U);
  std::array<Neighbour, 50> found;
  EXPECT_EQ(tree.nearest({1.0F, 2.0F, 3.5F}, 1.0F, found), 50U);
  tree.erase_inside(Box(Vector3f(0, 0, 0), Vector3f(5, 5, 5)));
  EXPECT_TRUE(tree.empty());
}

TEST(IkdTree, answers_several_threads_at_once_while_a_rebuild_is_under_way) {
  std::mt19937 random(9);
  IkdTree tree({.unbalanced_share = 0.65, .deleted_share = 0.5, .rebuilt_aside = 100});
  PointCloud held;
  for (int scan = 0; scan < 20; ++scan) {
    PointCloud points = random_tree_points(800, random, 5.0F);
    for (PointXyzi& p : points) {
      p.x += static_cast<float>(scan);
    }
    tree.insert(points);
    held.insert(held.end(), points.begin(), points.end());
    std::vector<std::thread> threads;
    for (unsigned t = 0; t < 2; ++t) {
      threads.emplace_back([&tree, &held, t] {
        std::mt19937 own(t);
        expect_same_answers(tree, held, own);
      });
    }
    for (std::thread& thread : threads) {
      thread.join();
    }
  }
  EXPECT_GT(tree.rebuilds_aside(), 0U);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
