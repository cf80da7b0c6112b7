// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "past_record.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>

namespace trigpoint::lio_mapper {
namespace {

using Eigen::Vector3d;

constexpr double kStep_m = 1.0;  // a keyframe, a scan and, where there is GPS, a row each second

Pose at(double x, double y = 0.0) {
  return {Eigen::Quaterniond::Identity(), Vector3d(x, y, 0.0)};
}

class Driven {
 public:
  explicit Driven(PastConfig config = {}) : record(config, {}) {}

  /// To a place in odom; with GPS there is a row, after which T_map_odom is as given.
  void step(const Pose& T_odom_base, const std::optional<YawPose>& gps = {}) {
    stamp_ns += kNanosecondsPerSecond;
    if (gps) {
      T_map_odom = *gps;
      aligned = true;
      StoredRow row;
      row.applied = true;
      row.update.fix_stamp_ns = stamp_ns;
      record.on_row(row, T_map_odom, T_odom_base.p);
    }
    record.on_scan({stamp_ns, 0, T_odom_base});
    record.on_keyframe({stamp_ns, 0, T_odom_base, aligned, T_map_odom});
  }

  /// Metres of x from one place to another; the last of them when something is due.
  std::optional<double> along(double from_m, double to_m, const std::optional<YawPose>& gps = {}) {
    const double step_m = to_m > from_m ? kStep_m : -kStep_m;
    for (double x = from_m; step_m * (to_m - x) > 0.0; x += step_m) {
      step(at(x), gps);
      if (record.due()) {
        return x;
      }
    }
    return std::nullopt;
  }

  PastRecord record;
  Nanoseconds stamp_ns{1'000 * kNanosecondsPerSecond};
  YawPose T_map_odom;
  bool aligned{false};
};

YawPose shifted(double y_m) {
  YawPose T;
  T.p.y() = y_m;
  return T;
}

TEST(PastRecord, asks_for_nothing_on_a_way_that_is_new_and_has_gps) {
  Driven driven;
  EXPECT_FALSE(driven.along(0.0, 300.0, YawPose{}));
}

TEST(PastRecord, asks_for_a_correction_once_a_place_driven_before_has_been_driven_for_20_m) {
  Driven driven;
  ASSERT_FALSE(driven.along(0.0, 100.0));
  const auto due_at_m = driven.along(99.0, 0.0);
  ASSERT_TRUE(due_at_m);
  EXPECT_EQ(driven.record.due(), "place_revisited");
  // At x, what lies within 10 m was driven up to 2 (99 - x) + 10 m ago: 60 m at x = 74. From there
  // 20 m more.
  EXPECT_NEAR(*due_at_m, 54.0, 2.0);
}

TEST(PastRecord, does_not_take_a_neighbouring_street_for_the_same_place) {
  Driven driven;
  ASSERT_FALSE(driven.along(0.0, 100.0));
  for (double x = 100.0; x > 0.0; x -= kStep_m) {
    driven.step(at(x, 12.0));
    ASSERT_FALSE(driven.record.due()) << x;
  }
}

// In odom the second street is the first one, in map it lies 30 m beside it.
TEST(PastRecord, compares_places_in_map_where_it_is_known) {
  Driven driven;
  ASSERT_FALSE(driven.along(0.0, 100.0, shifted(0.0)));
  ASSERT_FALSE(driven.along(99.0, 0.0, shifted(30.0)));
}

TEST(PastRecord, asks_for_a_correction_when_gps_has_returned_and_settled_elsewhere) {
  Driven driven;
  ASSERT_FALSE(driven.along(0.0, 50.0, shifted(0.0)));
  ASSERT_FALSE(driven.along(50.0, 100.0));
  const auto due_at_m = driven.along(100.0, 150.0, shifted(0.3));
  ASSERT_TRUE(due_at_m);
  EXPECT_NEAR(*due_at_m, 105.0, 1.0);  // five seconds later
  EXPECT_EQ(driven.record.due(), "gps_returned");
  EXPECT_EQ(driven.record.snapshot({}).reason, "gps_returned");
}

TEST(PastRecord, lets_it_be_when_gps_returns_where_it_was_or_was_hardly_gone) {
  Driven same;
  ASSERT_FALSE(same.along(0.0, 50.0, shifted(0.0)));
  ASSERT_FALSE(same.along(50.0, 100.0));
  EXPECT_FALSE(same.along(100.0, 150.0, shifted(0.02)));
  Driven brief;
  ASSERT_FALSE(brief.along(0.0, 50.0, shifted(0.0)));
  ASSERT_FALSE(brief.along(50.0, 53.0));
  EXPECT_FALSE(brief.along(53.0, 100.0, shifted(0.3)));
}

TEST(PastRecord, waits_for_the_interval_and_for_the_correction_under_way) {
  PastConfig config;
  config.interval_s = 60.0;
  Driven driven(config);
  ASSERT_FALSE(driven.along(0.0, 50.0, shifted(0.0)));
  ASSERT_FALSE(driven.along(50.0, 60.0));
  ASSERT_TRUE(driven.along(60.0, 90.0, shifted(0.3)));
  const Nanoseconds began_ns = driven.stamp_ns;
  driven.record.snapshot({});
  ASSERT_FALSE(driven.along(70.0, 80.0));
  ASSERT_FALSE(driven.along(80.0, 100.0, shifted(0.6))) << "one is under way";
  driven.record.conclude();
  ASSERT_TRUE(driven.along(100.0, 200.0, shifted(0.6)));
  EXPECT_NEAR(to_seconds(driven.stamp_ns - began_ns), config.interval_s, 1.0);
}

TEST(PastRecord, never_asks_where_rows_overwrite_odom) {
  Driven driven;
  StoredRow row;
  row.applied = true;
  row.update.mode = UpdateMode::kOverwrite;
  row.update.fix_stamp_ns = driven.stamp_ns;
  driven.record.on_row(row, {}, Vector3d::Zero());
  driven.along(0.0, 100.0);
  EXPECT_FALSE(driven.along(99.0, 0.0));
}

TEST(PastRecord, keeps_clouds_only_while_a_correction_is_under_way_and_not_for_ever) {
  Driven driven;
  driven.step(at(0.0));
  driven.record.on_inserted(PointCloud(1));
  const PastSnapshot snapshot = driven.record.snapshot({});
  EXPECT_TRUE(driven.record.take_inserted().empty()) << "of before";
  driven.record.on_inserted(PointCloud(2));
  const auto inserted = driven.record.take_inserted();
  ASSERT_EQ(inserted.size(), 1U);
  EXPECT_EQ(inserted[0].size(), 2U);
  EXPECT_TRUE(driven.record.is_current(snapshot));
  for (int scan = 0; scan < 2000; ++scan) {
    driven.record.on_inserted(PointCloud(1));
  }
  EXPECT_FALSE(driven.record.is_current(snapshot));
  EXPECT_TRUE(driven.record.take_inserted().empty());
}

TEST(PastRecord, knows_a_snapshot_of_another_epoch) {
  Driven driven;
  driven.step(at(0.0));
  const PastSnapshot snapshot = driven.record.snapshot({});
  driven.record.on_new_epoch();
  EXPECT_FALSE(driven.record.is_current(snapshot));
}

TEST(PastRecord, goes_on_from_what_a_session_holds) {
  GraphInput earlier;
  for (int i = 0; i < 100; ++i) {
    earlier.keyframes.push_back({i * kNanosecondsPerSecond, 0, at(i), false, {}});
    earlier.trajectory.push_back({i * kNanosecondsPerSecond, 0, at(i)});
  }
  Driven driven;
  driven.record = PastRecord({}, earlier);
  EXPECT_TRUE(driven.along(99.0, 0.0)) << "the way out is the session's";
}

}  // namespace
}  // namespace trigpoint::lio_mapper
