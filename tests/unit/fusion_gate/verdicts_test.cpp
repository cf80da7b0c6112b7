// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/verdicts.hpp"

#include "trigpoint/fusion_gate/fusion_gate.hpp"

#include "verdict_counts.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace trigpoint::fusion_gate {
namespace {

using testing::HasSubstr;

FixRecord record_of(double stamp_s, const std::string& refused_because = "") {
  FixRecord record;
  record.stamp_ns = from_seconds(stamp_s);
  record.accepted = refused_because.empty();
  record.reason = refused_because;
  record.antenna_map_m.setZero();
  record.covariance_map_m2 = Eigen::Matrix3d::Identity() * 1e-4;
  return record;
}

/// A filter and its receiver, message by message; every raw fix also goes to the gate.
class ToldFilter {
 public:
  /// `before`: what it holds of fixes when the gate begins, which sees the last of them come.
  explicit ToldFilter(const std::vector<FixRecord>& before = {}) : gate_(Config{}, RobotConfig{}) {
    status_.source = "ekf15";
    status_.health = GpsHealth::kOk;
    status_.datum_id = Datum{49.0, 8.0, 100.0, 0}.id();
    status_.accepted_covariance_map_m2 = Eigen::Matrix3d::Identity() * 1e-4;
    status_.accepted_antenna_map_m.setZero();
    status_.recent_fixes = before;
    status_.fixes_received = status_.fixes_accepted = before.size();
    if (!before.empty()) {
      see(before.back().stamp_ns);
    }
    tell(1000.0);
  }

  void accepts(double stamp_s) {
    receives(stamp_s);
    ++status_.fixes_accepted;
    if (!status_.datum_id.empty()) {
      status_.last_accepted_fix_ns = std::max(status_.last_accepted_fix_ns, from_seconds(stamp_s));
    }
    tell(stamp_s);
  }

  /// A new fix, of a filter that keeps records.
  void tells_of(const FixRecord& record) {
    see(record.stamp_ns);
    ++status_.fixes_received;
    status_.recent_fixes.push_back(record);
    tell(to_seconds(record.stamp_ns));
  }

  void refuses(double stamp_s, const std::string& reason) {
    receives(stamp_s);
    note(reason);
    tell(stamp_s);
  }

  void note(const std::string& reason) {
    for (NamedCount& entry : status_.rejections) {
      if (entry.name == reason) {
        ++entry.count;
        return;
      }
    }
    status_.rejections.push_back({reason, 1});
  }

  void lio_at(double stamp_s) {
    Odometry odometry;
    odometry.stamp_ns = from_seconds(stamp_s);
    odometry.pose_covariance = PoseCovariance::Identity() * 1e-4;
    keep(gate_.on_lio_odometry(odometry));
  }

  void tell(double stamp_s) {
    status_.stamp_ns = std::max(status_.stamp_ns, from_seconds(stamp_s));
    keep(gate_.on_gps_status(status_, "gps-a"));
  }

  /// LIO's status, at the origin of map.
  void lio_says(double stamp_s, std::uint32_t epoch, bool aligned) {
    LioStatus lio;
    lio.stamp_ns = from_seconds(stamp_s);
    lio.odom_epoch = epoch;
    lio.health = LioHealth::kOk;
    lio.aligned = aligned;
    lio.T_map_odom_covariance.setZero();
    keep(gate_.on_lio_status(lio));
  }

  void datum(const Datum& datum) { keep(gate_.on_datum(datum)); }

  GpsStatus& status() { return status_; }

  const FusionStatus& last() const { return last_; }

  std::uint64_t verdicts() const {
    std::uint64_t sum = 0;
    for (const NamedCount& entry : last_.verdicts) {
      sum += entry.count;
    }
    return sum;
  }

 private:
  void receives(double stamp_s) {
    see(from_seconds(stamp_s));
    ++status_.fixes_received;
  }

  void see(Nanoseconds stamp_ns) {
    GnssFix fix;
    fix.stamp_ns = stamp_ns;
    keep(gate_.on_fix(fix));
  }

  void keep(const Output& out) { last_ = out.status.value_or(last_); }

  FusionGate gate_;
  GpsStatus status_;
  FusionStatus last_;
};

TEST(FusionGateVerdicts, are_one_a_fix_also_when_a_late_fix_was_overtaken) {
  ToldFilter filter;
  for (int k = 0; k < 20; ++k) {
    // Every fifth comes behind its successor.
    const int order = k % 5 == 0 ? k + 1 : k % 5 == 1 ? k - 1 : k;
    filter.accepts(1000.2 + 0.2 * order);
    filter.lio_at(1000.3 + 0.2 * k);
  }
  filter.lio_at(1006.0);
  EXPECT_EQ(filter.last().fixes_seen, 20U);
  EXPECT_EQ(filter.verdicts(), 20U);
  EXPECT_EQ(count_of(filter.last(), "behind_newer_fix"), 4U);
  EXPECT_EQ(count_of(filter.last(), "waiting"), 0U);
}

TEST(FusionGateVerdicts, take_a_remark_on_a_used_fix_or_on_the_imu_for_no_refusal) {
  ToldFilter filter;
  for (int k = 0; k < 6; ++k) {
    filter.note("used_with_default_covariance");
    filter.note("imu_not_finite");
    filter.accepts(1000.2 + 0.2 * k);
  }
  filter.note("imu_not_finite");
  filter.refuses(1001.4, "gate");
  filter.lio_at(1001.9);
  EXPECT_EQ(filter.verdicts(), 7U);
  EXPECT_EQ(count_of(filter.last(), "refused_by_filter_gate"), 1U);
  for (const NamedCount& entry : filter.last().verdicts) {
    EXPECT_THAT(entry.name, testing::Not(HasSubstr("imu_")));
    EXPECT_THAT(entry.name, testing::Not(HasSubstr("used_with")));
  }
}

TEST(FusionGateVerdicts, give_a_fix_from_before_the_datum_one_verdict_only) {
  ToldFilter filter;
  const std::string datum = filter.status().datum_id;
  filter.status().datum_id.clear();
  filter.accepts(1000.2);
  filter.accepts(1000.4);
  EXPECT_EQ(count_of(filter.last(), "before_datum"), 2U);
  filter.status().datum_id = datum;
  filter.status().last_accepted_fix_ns = from_seconds(1000.4);
  filter.tell(1000.5);  // the datum came from elsewhere; the fix now has a place in map
  filter.accepts(1000.6);
  filter.lio_at(1001.0);
  EXPECT_EQ(filter.last().fixes_seen, 3U);
  EXPECT_EQ(filter.verdicts(), 3U);
}

TEST(FusionGateVerdicts, give_a_fix_that_was_refused_before_the_datum_one_verdict_only) {
  ToldFilter filter;
  const std::string datum = filter.status().datum_id;
  filter.status().datum_id.clear();
  filter.refuses(1000.0, "before_imu");
  filter.accepts(1000.2);
  filter.status().datum_id = datum;
  filter.status().recent_fixes = {record_of(1000.0, "before_imu"), record_of(1000.2)};
  filter.note("gate");
  filter.tells_of(record_of(1000.4, "gate"));
  for (int k = 3; k < 20; ++k) {
    filter.tells_of(record_of(1000.0 + 0.2 * k));
    filter.lio_at(1000.0 + 0.2 * k);
  }
  EXPECT_EQ(count_of(filter.last(), "refused_by_filter_before_imu"), 1U);
  EXPECT_EQ(count_of(filter.last(), "refused_by_filter_gate"), 1U);
  EXPECT_EQ(count_of(filter.last(), "before_datum"), 0U);
  EXPECT_EQ(filter.verdicts(), filter.last().fixes_seen);
}

TEST(FusionGateVerdicts, count_fixes_of_which_no_filter_has_told_as_waiting) {
  FusionGate gate{Config{}, RobotConfig{}};
  Odometry lio;
  lio.stamp_ns = from_seconds(1000.0);
  gate.on_lio_odometry(lio);
  GnssFix fix;
  fix.stamp_ns = from_seconds(1000.1);
  const Output out = gate.on_fix(fix);
  ASSERT_TRUE(out.status);
  EXPECT_EQ(count_of(*out.status, "waiting"), 1U);
}

TEST(FusionGateVerdicts, refuse_a_value_that_turned_nan_while_its_fix_waited) {
  ToldFilter filter;
  filter.tells_of(record_of(1000.2));
  filter.status().recent_fixes[0].antenna_map_m.y() = kNaN;
  filter.tell(1000.3);
  filter.lio_at(1000.2);
  filter.lio_at(1002.9);
  EXPECT_EQ(count_of(filter.last(), "not_finite"), 1U);
  EXPECT_EQ(filter.verdicts(), 1U);
}

TEST(FusionGateVerdicts, forget_the_other_datum_of_a_fix_that_is_told_of_again_in_ours) {
  ToldFilter filter;
  filter.datum({49.0, 8.0, 100.0, 0});
  const std::string ours = filter.status().datum_id;
  filter.status().datum_id = "somewhere else";
  filter.tells_of(record_of(1000.2));
  filter.status().datum_id = ours;
  filter.tell(1000.3);
  filter.lio_at(1000.2);
  filter.lio_at(1001.9);
  EXPECT_EQ(count_of(filter.last(), "other_datum"), 0U);
  EXPECT_EQ(filter.verdicts(), 1U);
}

TEST(FusionGateVerdicts, know_a_fix_as_accepted_that_was_refused_first) {
  ToldFilter filter;
  filter.tells_of(record_of(1000.2, "gate"));
  filter.lio_says(1000.2, 0, true);
  filter.lio_at(1000.5);
  EXPECT_THAT(filter.last().axes[0].reason, HasSubstr("no accepted fix yet"));
  filter.status().recent_fixes = {record_of(1000.2)};
  filter.tell(1000.6);
  filter.lio_at(1000.8);
  EXPECT_THAT(filter.last().axes[0].reason, testing::Not(HasSubstr("no accepted fix")));
}

TEST(FusionGateVerdicts, leave_out_the_fixes_from_before_the_gate_began) {
  ToldFilter filter({record_of(999.4), record_of(999.6), record_of(999.8, "gate")});
  filter.tells_of(record_of(1000.0));
  filter.lio_at(1000.1);
  filter.lio_at(1003.0);
  EXPECT_EQ(filter.last().fixes_seen, 2U);
  EXPECT_EQ(filter.verdicts(), 2U);
  EXPECT_EQ(count_of(filter.last(), "waiting"), 0U);
}

TEST(FusionGateVerdicts, refuse_what_waits_in_a_datum_that_is_no_longer_ours) {
  ToldFilter filter;
  filter.datum({49.0, 8.0, 100.0, 50});
  filter.tells_of(record_of(1000.2));
  filter.datum({49.1, 8.0, 100.0, 40});  // elected earlier
  filter.lio_at(1000.2);
  filter.lio_at(1001.9);
  EXPECT_EQ(count_of(filter.last(), "other_datum"), 1U);
  EXPECT_EQ(filter.verdicts(), 1U);
}

TEST(FusionGateVerdicts, keep_what_waits_when_the_first_datum_is_the_filters) {
  ToldFilter same;
  ToldFilter other;
  for (ToldFilter* filter : {&same, &other}) {
    filter->tells_of(record_of(1000.2));
    filter->datum({filter == &same ? 49.0 : 49.1, 8.0, 100.0, 0});
    filter->lio_at(1000.2);
    filter->lio_at(1001.9);
    EXPECT_EQ(filter->verdicts(), 1U);
  }
  EXPECT_EQ(count_of(same.last(), "other_datum"), 0U);
  EXPECT_EQ(count_of(other.last(), "other_datum"), 1U);
}

TEST(FusionGateVerdicts, name_the_filters_refusal_of_a_fix_that_the_full_queue_drops_and_say_so) {
  constexpr int kMayWait = 64;
  ToldFilter filter;
  for (int k = 1; k <= kMayWait; ++k) {
    filter.tells_of(record_of(1000.0 + 0.01 * k, "gate"));
  }
  EXPECT_EQ(count_of(filter.last(), "waiting"), 64U);
  // An older one: data time stands still, no status is due.
  filter.tells_of(record_of(1000.005, "gate"));
  EXPECT_EQ(count_of(filter.last(), "refused_by_filter_gate"), 1U);
  EXPECT_EQ(count_of(filter.last(), "no_lio_pose"), 0U);
}

TEST(FusionGateVerdicts, name_the_filters_refusal_of_a_fix_that_waits_when_an_odom_epoch_begins) {
  ToldFilter filter;
  filter.lio_says(1000.1, 7, false);
  filter.tells_of(record_of(1000.2, "gate"));
  filter.tells_of(record_of(1000.4));
  filter.lio_says(1000.5, 8, false);
  EXPECT_EQ(count_of(filter.last(), "refused_by_filter_gate"), 1U);
  EXPECT_EQ(count_of(filter.last(), "odom_epoch"), 1U);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
