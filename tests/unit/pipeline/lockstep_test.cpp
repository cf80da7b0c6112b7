// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/lockstep.hpp"

#include "stored_log.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

namespace trigpoint::pipeline {
namespace {

void print(std::ostream& out, const Odometry& odometry) {
  out << odometry.stamp_ns << ' ' << odometry.T_frame_child.p.transpose() << ' '
      << odometry.T_frame_child.q.coeffs().transpose() << ' ' << odometry.pose_covariance << '\n';
}

/// Poses and covariances to the last bit.
std::string bits_of(const Step& step) {
  std::ostringstream out;
  out << std::hexfloat;
  for (const auto* odometries : {&step.gps_odometry, &step.lio_imu_rate, &step.fused}) {
    for (const Odometry& odometry : *odometries) {
      print(out, odometry);
    }
  }
  for (const lio_mapper::ScanResult& scan : step.scans) {
    print(out, scan.odometry);
    for (const PointXyzi& point : scan.points_odom) {
      out << point.x << ' ' << point.y << ' ' << point.z << '\n';
    }
  }
  for (const FusionStatus& status : step.fusion_status) {
    out << status.stamp_ns << ' ' << status.fixes_used << ' ' << status.verdict.reason << '\n';
  }
  return out.str();
}

std::string run(const Entries& entries) {
  Lockstep cores(stored_drive().configs);
  std::string bits;
  for (const recording::LogEntry& entry : entries) {
    bits += bits_of(cores.step(entry));
  }
  return bits + bits_of(cores.finish());
}

TEST(Lockstep, gives_the_same_bits_for_the_same_entries) {
  const std::string first = run(stored_drive().entries);
  EXPECT_GT(first.size(), 1'000'000U) << "something must have come out";
  EXPECT_TRUE(first == run(stored_drive().entries));
}

TEST(Lockstep, joins_the_three_cores_to_a_pose_in_map) {
  Lockstep cores(stored_drive().configs);
  std::size_t updates = 0;
  std::size_t fused = 0;
  for (const recording::LogEntry& entry : stored_drive().entries) {
    const Step step = cores.step(entry);
    updates += step.state_updates.size();
    fused += step.fused.size();
  }
  EXPECT_GT(updates, 0U) << "the gate says nothing to the mapper";
  EXPECT_TRUE(cores.lio_status().aligned) << "the mapper did not hear the gate";
  EXPECT_GT(fused, 50U) << "the gate did not hear the mapper";
  EXPECT_TRUE(cores.best_alignment());
  EXPECT_EQ(cores.gps_status().fixes_received, count<GnssFix>(stored_drive().entries));
}

TEST(Lockstep, feeds_a_withheld_fix_to_nobody) {
  Entries withheld = stored_drive().entries;
  Entries without;
  std::size_t fixes = 0;
  for (recording::LogEntry& entry : withheld) {
    if (holds<GnssFix>(entry) && fixes++ % 2 == 1) {
      entry.withheld = true;
    } else {
      without.push_back(entry);
    }
  }
  ASSERT_LT(without.size(), withheld.size());
  EXPECT_TRUE(run(withheld) == run(without));
}

// Were an input used before it had arrived, something would speak of a moment of which nobody can
// know yet.
TEST(Lockstep, says_nothing_about_a_moment_before_its_measurements_have_arrived) {
  Lockstep cores(stored_drive().configs);
  for (const recording::LogEntry& entry : stored_drive().entries) {
    const Step step = cores.step(entry);
    for (const auto* odometries : {&step.gps_odometry, &step.lio_imu_rate, &step.fused}) {
      for (const Odometry& odometry : *odometries) {
        ASSERT_LE(odometry.stamp_ns, entry.receive_ns);
      }
    }
    for (const lio_mapper::ScanResult& scan : step.scans) {
      ASSERT_LE(scan.odometry.stamp_ns, entry.receive_ns);
    }
  }
}

TEST(Lockstep, takes_a_sweep_in_once_its_last_point_and_the_imu_up_to_it_are_there) {
  Lockstep cores(stored_drive().configs);
  Nanoseconds newest_sweep_ns = 0;
  std::size_t scans = 0;
  for (const recording::LogEntry& entry : stored_drive().entries) {
    if (holds<PointCloudMessage>(entry)) {
      newest_sweep_ns = entry.receive_ns;
    }
    for (const lio_mapper::ScanResult& scan : cores.step(entry).scans) {
      ++scans;
      EXPECT_LE(scan.odometry.stamp_ns, newest_sweep_ns) << "of a sweep that has not come";
    }
  }
  scans += cores.finish().scans.size();
  EXPECT_EQ(scans, count<PointCloudMessage>(stored_drive().entries)) << "each sweep once";
}

TEST(Lockstep, counts_a_late_fix_from_its_arrival_with_its_own_stamp) {
  Lockstep cores(stored_drive().configs);
  std::size_t fixes = 0;
  std::size_t judged = 0;
  for (const recording::LogEntry& entry : stored_drive().entries) {
    const bool had_one = cores.gps_status().last_accepted_fix_ns != 0;
    cores.step(entry);
    if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
      ++fixes;
      EXPECT_LT(fix->stamp_ns, entry.receive_ns) << "the simulator delivers fixes late";
      if (had_one) {  // the first ones wait until the filter has levelled itself
        ++judged;
        EXPECT_EQ(cores.gps_status().last_accepted_fix_ns, fix->stamp_ns);
      }
    }
    ASSERT_EQ(cores.gps_status().fixes_received, fixes);
  }
  EXPECT_GT(judged, fixes / 2);
}

// Wheels and heading are the filter's alone.
TEST(Lockstep, feeds_twists_and_headings_to_the_filter) {
  Lockstep cores(stored_drive().configs);
  std::size_t twists = 0;
  std::size_t yaws = 0;
  for (const recording::LogEntry& entry : stored_drive().entries) {
    cores.step(entry);
    if (holds<GnssFix>(entry)) {
      TwistMeasurement twist;
      twist.stamp_ns = entry.receive_ns;
      cores.step({entry.receive_ns, twist});  // not a number
      YawMeasurement yaw;
      yaw.stamp_ns = entry.receive_ns;
      cores.step({entry.receive_ns, yaw});  // no orientation
      ++twists;
      ++yaws;
    }
  }
  const auto rejections = cores.gps_status().rejections;
  const auto count_of = [&](const std::string& name) {
    const auto found = std::find_if(rejections.begin(), rejections.end(), [&](const auto& count) {
      return count.name == name;
    });
    return found == rejections.end() ? std::uint64_t{0} : found->count;
  };
  EXPECT_GT(twists, 10U);
  EXPECT_EQ(count_of("twist_not_finite"), twists);
  EXPECT_EQ(count_of("yaw_without_orientation"), yaws);
}

TEST(Lockstep, is_not_changed_by_twists_and_headings_that_are_refused) {
  Entries with_bad_ones;
  for (const recording::LogEntry& entry : stored_drive().entries) {
    with_bad_ones.push_back(entry);
    if (holds<GnssFix>(entry)) {
      with_bad_ones.push_back({entry.receive_ns, TwistMeasurement{}});
      with_bad_ones.push_back({entry.receive_ns, YawMeasurement{}});
    }
  }
  EXPECT_TRUE(run(stored_drive().entries) == run(with_bad_ones));
}

TEST(Lockstep, says_nothing_when_nothing_was_fed) {
  Lockstep cores(stored_drive().configs);
  const Step step = cores.finish();
  EXPECT_TRUE(step.scans.empty());
  EXPECT_TRUE(step.fused.empty());
  EXPECT_FALSE(cores.best_alignment());
}

}  // namespace
}  // namespace trigpoint::pipeline
