// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A mapper whose local map is exchanged for a corrected one.
#include "trigpoint/base/point_cloud.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"
#include "trigpoint/lio_mapper/past.hpp"

#include "local_map.hpp"
#include "room_drive.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

namespace trigpoint::lio_mapper {
namespace {

using testing_support::RoomDrive;

constexpr int kSnapshotSweep = 60;
constexpr int kAdoptSweep = 75;
constexpr int kLastSweep = 110;

/// A drive through the hall; `after_sweep` is called between two inputs.
class Drive {
 public:
  explicit Drive(bool corrected = true) : mapper(config(corrected), RobotConfig{}) {
    mapper.keep_past({});
  }

  void run(const std::function<void(int)>& after_sweep = [](int) {}) {
    constexpr Nanoseconds kImuPeriod_ns = 5'000'000;
    constexpr int kImuPerSweep = 20;
    const RoomDrive room(0.5, 3.0);
    for (int sweep = 0; sweep < kLastSweep; ++sweep) {
      const Nanoseconds begin_ns = RoomDrive::kEpoch_ns + sweep * kImuPerSweep * kImuPeriod_ns;
      for (int i = 0; i < kImuPerSweep; ++i) {
        take(mapper.on_imu(room.imu_at(begin_ns + i * kImuPeriod_ns)));
      }
      take(mapper.on_cloud(room.sweep_at(begin_ns, 300)));
      after_sweep(sweep);
    }
  }

  void take(Output output) {
    for (ScanResult& scan : output.scans) {
      if (scan.keyframe) {
        keyframes.push_back(*scan.keyframe);
      }
      scans.push_back(std::move(scan));
    }
    if (output.odometry_imu_rate) {
      imu_rate.push_back(*output.odometry_imu_rate);
    }
  }

  /// Nothing has drifted here, so the graph has nothing to move: all keyframes as driven.
  CorrectedMap correct(PastSnapshot snapshot) const {
    auto map = make_local_map({});
    for (const Keyframe& keyframe : keyframes) {
      map->insert(moved(keyframe.points_base, keyframe.T_odom_base));
    }
    return {std::move(map), std::move(snapshot), CorrectedPast{}, Pose{}};
  }

  static Config config(bool corrected) {
    Config config;
    config.past.enabled = corrected;
    return config;
  }

  LioMapper mapper;
  std::vector<ScanResult> scans;
  std::vector<Keyframe> keyframes;
  std::vector<Odometry> imu_rate;
};

/// Of the newest pose that is known at any time, over one interval of 10 ms.
double largest_step_m(const std::vector<Odometry>& poses) {
  double largest_m = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    largest_m =
        std::max(largest_m, (poses[i].T_frame_child.p - poses[i - 1].T_frame_child.p).norm());
  }
  return largest_m;
}

void expect_adopted(Drive& drive, CorrectedMap& corrected) {
  ASSERT_TRUE(drive.mapper.adopt(corrected));
}

/// A snapshot is corrected at once, and what comes of it is given to `adopt` later in the drive.
void adopt_corrected(Drive& drive,
                     const std::function<void(Drive&, CorrectedMap&)>& adopt = expect_adopted) {
  std::optional<CorrectedMap> corrected;
  drive.run([&](int sweep) {
    if (sweep == kSnapshotSweep) {
      corrected = drive.correct(drive.mapper.past_snapshot());
    } else if (sweep == kAdoptSweep) {
      adopt(drive, *corrected);
    }
  });
}

TEST(MapperPast, does_not_step_when_the_map_is_exchanged) {
  // Scans have a noise of 10 mm; a map of keyframes holds a tenth of them.
  constexpr double kSame_m = 0.005;
  Drive undisturbed;
  undisturbed.run();
  Drive drive;
  adopt_corrected(drive);
  ASSERT_EQ(drive.scans.size(), undisturbed.scans.size());
  for (std::size_t i = 0; i < drive.scans.size(); ++i) {
    const Pose& T = drive.scans[i].odometry.T_frame_child;
    ASSERT_LT((T.p - undisturbed.scans[i].odometry.T_frame_child.p).norm(), kSame_m) << i;
  }
  EXPECT_LT(largest_step_m(drive.imu_rate), largest_step_m(undisturbed.imu_rate) + 1e-3);
}

TEST(MapperPast, changes_no_pose_and_no_covariance_itself) {
  Drive driven;
  adopt_corrected(driven, [](Drive& drive, CorrectedMap& corrected) {
    const auto before = drive.mapper.checkpoint();
    ASSERT_TRUE(drive.mapper.adopt(corrected));
    const auto after = drive.mapper.checkpoint();
    EXPECT_EQ(before->T_odom_base.p, after->T_odom_base.p);
    EXPECT_EQ(before->T_odom_base.q.coeffs(), after->T_odom_base.q.coeffs());
    EXPECT_EQ(before->T_map_odom.p, after->T_map_odom.p);
    EXPECT_EQ(before->covariance, after->covariance);
  });
}

TEST(MapperPast, gives_the_same_bits_for_the_same_moments) {
  Drive a;
  adopt_corrected(a);
  Drive b;
  adopt_corrected(b);
  ASSERT_EQ(a.scans.size(), b.scans.size());
  for (std::size_t i = 0; i < a.scans.size(); ++i) {
    ASSERT_EQ(a.scans[i].odometry.T_frame_child.p, b.scans[i].odometry.T_frame_child.p);
    ASSERT_EQ(a.scans[i].odometry.T_frame_child.q.coeffs(),
              b.scans[i].odometry.T_frame_child.q.coeffs());
  }
}

bool same_points(const PointCloud& a, const PointCloud& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](auto& p, auto& q) {
           return p.position() == q.position();
         });
}

// An empty map is adopted: what is in it afterwards are the scans since the snapshot.
TEST(MapperPast, holds_the_points_that_came_since_the_snapshot) {
  for (const bool taken_on_the_way : {false, true}) {
    Drive drive;
    std::optional<CorrectedMap> corrected;
    auto expected = make_local_map({});
    std::size_t scans_before = 0;
    drive.run([&](int sweep) {
      if (sweep == kSnapshotSweep) {
        corrected.emplace(
            make_local_map({}), drive.mapper.past_snapshot(), CorrectedPast{}, Pose{});
        scans_before = drive.scans.size();
      } else if (sweep == kSnapshotSweep + 7 && taken_on_the_way) {
        for (const PointCloud& cloud : drive.mapper.take_inserted()) {
          corrected->insert({cloud});
        }
      } else if (sweep == kAdoptSweep) {
        for (std::size_t i = scans_before; i < drive.scans.size(); ++i) {
          expected->insert(drive.scans[i].points_odom);
        }
        ASSERT_TRUE(drive.mapper.adopt(*corrected));
        EXPECT_GT(expected->size(), 1000U);
        EXPECT_TRUE(same_points(drive.mapper.local_map(), expected->points()));
      }
    });
  }
}

TEST(MapperPast, gives_the_old_map_back_to_be_disposed_of) {
  Drive driven;
  adopt_corrected(driven, [](Drive& drive, CorrectedMap& corrected) {
    const PointCloud old = drive.mapper.local_map();
    ASSERT_TRUE(drive.mapper.adopt(corrected));
    EXPECT_TRUE(same_points(corrected.map().points(), old));
  });
}

TEST(MapperPast, keeps_its_map_when_the_correction_changes_nothing) {
  Drive drive;
  std::optional<CorrectedMap> corrected;
  drive.run([&](int sweep) {
    if (sweep == kSnapshotSweep) {
      corrected = correct_local_map(drive.mapper.past_snapshot(), [&](std::size_t i) {
        return drive.keyframes.at(i).points_base;
      });
      ASSERT_TRUE(corrected);
      ASSERT_FALSE(corrected->report.changed);
    } else if (sweep == kAdoptSweep) {
      const PointCloud before = drive.mapper.local_map();
      ASSERT_TRUE(drive.mapper.adopt(*corrected));
      EXPECT_TRUE(same_points(drive.mapper.local_map(), before));
      EXPECT_FALSE(drive.mapper.adopt(*corrected)) << "it is concluded";
    }
  });
}

TEST(MapperPast, adopts_a_correction_once_and_none_that_was_given_up) {
  Drive drive;
  std::optional<CorrectedMap> corrected;
  drive.run([&](int sweep) {
    if (sweep == kSnapshotSweep) {
      corrected = drive.correct(drive.mapper.past_snapshot());
    } else if (sweep == kSnapshotSweep + 5) {
      ASSERT_TRUE(drive.mapper.adopt(*corrected));
      EXPECT_FALSE(drive.mapper.adopt(*corrected));
    } else if (sweep == kAdoptSweep) {
      corrected = drive.correct(drive.mapper.past_snapshot());
      drive.mapper.forget_snapshot();
      EXPECT_FALSE(drive.mapper.adopt(*corrected));
    }
  });
}

TEST(MapperPast, is_not_kept_when_it_is_switched_off) {
  Drive drive(false);
  drive.run();
  EXPECT_FALSE(drive.mapper.past_is_due());
  EXPECT_TRUE(drive.mapper.take_inserted().empty());
}

}  // namespace
}  // namespace trigpoint::lio_mapper
