// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A street driven before an outage of GPS and again after it: with and without the correction of
// the past. Prints the figures.
#include "trigpoint/lio_mapper/keyframe_store.hpp"
#include "trigpoint/pipeline/lockstep.hpp"
#include "trigpoint/pipeline/past_beside.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "../unit/export/scratch_folder.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <future>
#include <set>
#include <vector>

namespace trigpoint {
namespace {

using Eigen::Vector3d;

struct Street {
  const char* scenario;
  double max_range_m;   ///< of the LiDAR
  double again_from_s;  ///< it is driven for the second time
  double end_s;
};

/// A street of 180 m, a hall for 120 s without GPS, and the street again; a street, a bore of 200 m
/// of which a LiDAR of 65 m sees neither end for a while, and the street again.
constexpr Street kStreets[] = {{"indoor_120", 100.0, 245.0, 300.0},
                               {"tunnel_return", 65.0, 148.0, 185.0}};
/// The local map is looked at every so often while the street is driven again.
constexpr double kLookEvery_s = 5.0;
constexpr std::uint64_t kAdoptAfterScans = 50;

/// Where surfaces are, in cells: points of all keyframes, each at its true place.
class Surfaces {
 public:
  void add(const PointCloud& points_base, const Pose& T_map_base) {
    for (const PointXyzi& point : points_base) {
      cells_.insert(cell_of(T_map_base * point.position().cast<double>()));
    }
  }

  /// Within a cell's neighbourhood, 0.15 to 0.3 m.
  bool is_near(const Vector3d& p_map_m) const {
    const Cell c = cell_of(p_map_m);
    for (int i = 0; i < 27; ++i) {
      if (cells_.contains({c[0] + i % 3 - 1, c[1] + i / 3 % 3 - 1, c[2] + i / 9 - 1})) {
        return true;
      }
    }
    return false;
  }

 private:
  using Cell = std::array<int, 3>;
  static constexpr double kCell_m = 0.15;

  static Cell cell_of(const Vector3d& p) {
    const auto index = [](double x) { return static_cast<int>(std::floor(x / kCell_m)); };
    return {index(p.x()), index(p.y()), index(p.z())};
  }

  std::set<Cell> cells_;
};

/// The local map as it was, and where the robot was.
struct Look {
  PointCloud points_odom;
  Pose T_odom_base;
  Pose truth;
};

struct Figures {
  double ghost_share{0.0};     ///< of the local map's points near the robot: where nothing is
  double largest_step_m{0.0};  ///< of odom from scan to scan, against the truth
  double fused_rmse_m{0.0};    ///< from the return of GPS on
  std::uint64_t corrections{0};
  double longest_hold_s{0.0};
};

class Drive {
 public:
  Drive(const Street& street, std::uint64_t seed, bool corrected)
      : again_from_s_(street.again_from_s) {
    const auto scenario = simulator::load_scenario(street.scenario);
    const auto reader = simulator::open_scenario(scenario, seed, street.end_s);
    truth_ = reader->truth();
    start_ns_ = scenario.start_ns();
    pipeline::CoreConfigs configs;
    configs.robot = *reader->robot();
    configs.gps_odometry.use_configured_datum = true;
    configs.gps_odometry.datum_latitude_deg = scenario.datum.latitude_deg;
    configs.gps_odometry.datum_longitude_deg = scenario.datum.longitude_deg;
    configs.gps_odometry.datum_height_m = scenario.datum.height_m;
    configs.lio_mapper.matching.threads = 1;
    configs.lio_mapper.sweep.max_range_m = street.max_range_m;
    configs.lio_mapper.past.enabled = corrected;
    pipeline::Lockstep cores(configs);
    const std::string store = folder_.file("keyframes.sqlite");
    lio_mapper::KeyframeWriter writer(store);
    pipeline::PastBeside past(
        cores.mapper(), store, {}, [](auto job) { job(); }, {kAdoptAfterScans, 0});
    while (const auto entry = reader->next()) {
      const pipeline::Step step = cores.step(*entry);
      for (const lio_mapper::ScanResult& scan : step.scans) {
        writer.commit(scan.checkpoint, scan.rows, scan.keyframe);
        on_scan(scan, cores);
      }
      for (const Odometry& fused : step.fused) {
        on_fused(fused);
      }
      for (const Event& event : past.after_scans(step.scans.size())) {
        std::printf("%.1f s: %s\n", since_start_s(event.stamp_ns), event.text.c_str());
      }
    }
    figures.corrections = past.corrections();
    figures.longest_hold_s = past.longest_hold_s();
    figures.fused_rmse_m = std::sqrt(fused_sum_m2_ / static_cast<double>(fused_count_));
    count_ghosts();
  }

  Figures figures;

 private:
  double since_start_s(Nanoseconds stamp_ns) const { return to_seconds(stamp_ns - start_ns_); }

  void on_scan(const lio_mapper::ScanResult& scan, pipeline::Lockstep& cores) {
    const Pose& T_odom_base = scan.odometry.T_frame_child;
    const Pose truth = truth_->at(scan.odometry.stamp_ns).T_map_base;
    if (scan.keyframe) {
      surfaces_.add(scan.keyframe->points_base, truth);
    }
    if (since_start_s(scan.odometry.stamp_ns) > again_from_s_ - 30.0) {
      const Vector3d moved = (T_before_.inverse() * T_odom_base).p;
      const Vector3d truly = (truth_before_.inverse() * truth).p;
      figures.largest_step_m = std::max(figures.largest_step_m, (moved - truly).norm());
    }
    T_before_ = T_odom_base;
    truth_before_ = truth;
    const double now_s = since_start_s(scan.odometry.stamp_ns);
    if (now_s > again_from_s_ + kLookEvery_s * static_cast<double>(looks_.size())) {
      looks_.push_back({cores.mapper().local_map(), T_odom_base, truth});
    }
  }

  void on_fused(const Odometry& fused) {
    if (since_start_s(fused.stamp_ns) > again_from_s_) {
      fused_sum_m2_ +=
          (fused.T_frame_child.p - truth_->at(fused.stamp_ns).T_map_base.p).squaredNorm();
      ++fused_count_;
    }
  }

  void count_ghosts() {
    std::size_t near = 0;
    std::size_t ghosts = 0;
    for (const Look& look : looks_) {
      const Pose T_map_odom = look.truth * look.T_odom_base.inverse();
      for (const PointXyzi& point : look.points_odom) {
        const Vector3d p = T_map_odom * point.position().cast<double>();
        const Vector3d away = p - look.truth.p;
        // Above the ground, which is the same surface wherever it is driven.
        if (away.norm() < 25.0 && away.z() > 0.5) {
          ++near;
          ghosts += surfaces_.is_near(p) ? 0U : 1U;
        }
      }
    }
    figures.ghost_share = static_cast<double>(ghosts) / static_cast<double>(near);
  }

  test::ScratchFolder folder_;
  double again_from_s_;
  std::shared_ptr<const simulator::Truth> truth_;
  Nanoseconds start_ns_{0};
  Surfaces surfaces_;
  std::vector<Look> looks_;
  Pose T_before_;
  Pose truth_before_;
  double fused_sum_m2_{0.0};
  std::size_t fused_count_{0};
};

void print(const char* name, const Figures& f) {
  std::printf(
      "%-12s ghosts %.2f %% of the local map within 25 m, largest step of odom %.1f mm, "
      "fused rmse %.3f m, %llu corrections, longest hold %.1f ms\n",
      name,
      100.0 * f.ghost_share,
      1e3 * f.largest_step_m,
      f.fused_rmse_m,
      static_cast<unsigned long long>(f.corrections),
      1e3 * f.longest_hold_s);
}

struct Pair {
  Figures without;
  Figures with;
};

/// Driven once for all tests.
const std::vector<Pair>& drives() {
  static const std::vector<Pair> made = [] {
    constexpr std::uint64_t kSeed = 1;
    std::vector<Pair> pairs;
    for (const Street& street : kStreets) {
      auto without =
          std::async(std::launch::async, [&] { return Drive(street, kSeed, false).figures; });
      const Figures with = Drive(street, kSeed, true).figures;
      pairs.push_back({without.get(), with});
      std::printf("%s, seed %llu\n", street.scenario, static_cast<unsigned long long>(kSeed));
      print("as driven", pairs.back().without);
      print("corrected", pairs.back().with);
    }
    return pairs;
  }();
  return made;
}

/// A scan's own noise.
constexpr double kNoise_m = 0.002;

TEST(Past, leaves_no_double_wall_where_a_street_is_driven_again_after_an_outage) {
  for (const Pair& drive : drives()) {
    EXPECT_GE(drive.with.corrections, 1U);
    EXPECT_EQ(drive.without.corrections, 0U);
    EXPECT_LT(drive.with.ghost_share, 0.5 * drive.without.ghost_share);
  }
}

TEST(Past, does_not_step_odom) {
  for (const Pair& drive : drives()) {
    EXPECT_LT(drive.with.largest_step_m, drive.without.largest_step_m + kNoise_m);
  }
}

// Not so yet: walls that were not corrected pull the robot back to where it was when they were
// seen, corrected ones come along with it, and what the loops know of its place in map is not told
// to the filter (README, "The past").
TEST(Past, DISABLED_makes_the_place_in_map_no_worse) {
  for (const Pair& drive : drives()) {
    EXPECT_LT(drive.with.fused_rmse_m, drive.without.fused_rmse_m + kNoise_m);
  }
}

}  // namespace
}  // namespace trigpoint
