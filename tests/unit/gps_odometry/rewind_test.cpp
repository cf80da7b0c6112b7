// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "drive.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kSameResult = 1e-9;

Sensors rtk_robot() {
  Sensors sensors;
  sensors.robot.antenna_position_base_m = {0.35, 0.15, 0.6};
  return sensors;
}

/// The last odometry and status of a filter that got these inputs in this order, and what it held
/// last of every fix.
struct End {
  Odometry odometry;
  GpsStatus status;
  std::map<Nanoseconds, FixRecord> records;
};

End end_of(const std::vector<Input>& inputs, const Sensors& sensors, const std::string& name) {
  Config config = config_with_datum(name);
  config.publish_rate_hz = 1000.0;  // every sample, whatever came before
  GpsOdometry filter(config, sensors.robot);
  End end;
  for (const Input& input : inputs) {
    const Output output = input.is_fix ? filter.on_fix(input.fix) : filter.on_imu(input.imu);
    if (output.odometry) {
      end.odometry = *output.odometry;
    }
    if (output.status) {
      end.status = *output.status;
      for (const FixRecord& record : end.status.recent_fixes) {
        end.records[record.stamp_ns] = record;
      }
    }
  }
  return end;
}

void expect_equal(const End& late, const End& sorted) {
  EXPECT_EQ(late.odometry.stamp_ns, sorted.odometry.stamp_ns);
  EXPECT_LT((late.odometry.T_frame_child.p - sorted.odometry.T_frame_child.p).norm(), kSameResult);
  EXPECT_LT(late.odometry.T_frame_child.q.angularDistance(sorted.odometry.T_frame_child.q),
            kSameResult);
  EXPECT_LT((late.odometry.pose_covariance - sorted.odometry.pose_covariance).norm(), kSameResult);
  EXPECT_EQ(late.status.fixes_accepted, sorted.status.fixes_accepted);
  EXPECT_EQ(late.status.last_accepted_fix_ns, sorted.status.last_accepted_fix_ns);
  EXPECT_LT((late.status.accepted_antenna_map_m - sorted.status.accepted_antenna_map_m).norm(),
            kSameResult);
  EXPECT_LT(
      (late.status.accepted_covariance_map_m2 - sorted.status.accepted_covariance_map_m2).norm(),
      kSameResult);
  ASSERT_EQ(late.records.size(), sorted.records.size());
  for (const auto& [stamp_ns, record] : sorted.records) {
    const FixRecord& held = late.records.at(stamp_ns);
    EXPECT_EQ(held.accepted, record.accepted);
    EXPECT_EQ(held.reason, record.reason);
    if (!record.accepted) {
      continue;
    }
    EXPECT_LT((held.antenna_map_m - record.antenna_map_m).norm(), kSameResult);
    EXPECT_LT((held.covariance_map_m2 - record.covariance_map_m2).norm(), kSameResult);
  }
}

std::vector<Input> sorted_by_stamp(std::vector<Input> inputs) {
  const auto stamp = [](const Input& input) {
    return input.is_fix ? input.fix.stamp_ns : input.imu.stamp_ns;
  };
  std::stable_sort(inputs.begin(), inputs.end(), [&](const Input& a, const Input& b) {
    return stamp(a) != stamp(b) ? stamp(a) < stamp(b) : a.is_fix < b.is_fix;
  });
  return inputs;
}

/// Long enough for heading, driving and turning, and an end after the last fix was delivered. Fixes
/// before the IMU has warmed up are left out: sorted and late they differ in being refused.
std::vector<Input> inputs_with(const Sensors& sensors, unsigned seed) {
  std::vector<Input> inputs = sense(drive(town(1.5, 1.0), 25.0), sensors, seed);
  std::erase_if(inputs, [](const Input& input) {
    const Nanoseconds stamp_ns = input.fix.stamp_ns;
    return input.is_fix && (stamp_ns < stamp_of(0.5) || stamp_ns > stamp_of(24.0));
  });
  return inputs;
}

class Rewind : public testing::TestWithParam<std::string> {};

TEST_P(Rewind, gives_with_late_fixes_what_sorted_input_gives) {
  Sensors sensors = rtk_robot();
  sensors.latency_s = 0.3;
  const auto late = inputs_with(sensors, 1);
  expect_equal(end_of(late, sensors, GetParam()),
               end_of(sorted_by_stamp(late), sensors, GetParam()));
}

TEST_P(Rewind, gives_with_shuffled_fixes_what_sorted_input_gives) {
  Sensors sensors = rtk_robot();
  auto shuffled = inputs_with(sensors, 2);
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> latency(0.0, 0.8);
  for (Input& input : shuffled) {
    if (input.is_fix) {
      input.available_s += latency(random);
    }
  }
  std::stable_sort(shuffled.begin(), shuffled.end(), [](const Input& a, const Input& b) {
    return a.available_s < b.available_s;
  });
  expect_equal(end_of(shuffled, sensors, GetParam()),
               end_of(sorted_by_stamp(shuffled), sensors, GetParam()));
}

TEST_P(Rewind, is_not_moved_by_duplicates) {
  const Sensors sensors = rtk_robot();
  const auto inputs = inputs_with(sensors, 3);
  std::vector<Input> doubled;
  for (const Input& input : inputs) {
    doubled.push_back(input);
    if (input.is_fix) {
      doubled.push_back(input);
    }
  }
  const End once = end_of(inputs, sensors, GetParam());
  const End twice = end_of(doubled, sensors, GetParam());
  expect_equal(twice, once);
  EXPECT_EQ(count_of(twice.status, "duplicate_stamp"), once.status.fixes_received);
}

TEST_P(Rewind, refuses_and_counts_a_fix_older_than_the_buffer) {
  const Sensors sensors = rtk_robot();
  GpsOdometry filter(config_with_datum(GetParam()), sensors.robot);
  for (int i = 0; i < 300; ++i) {
    filter.on_imu(imu_at(0.01 * i));
  }
  const GpsStatus status = *filter.on_fix(fix_at({0.0, 0.0, 0.0}, 0.4, 0.014)).status;
  EXPECT_EQ(count_of(status, "too_old"), 1U);
  EXPECT_EQ(status.fixes_accepted, 0U);
  EXPECT_EQ(filter.on_fix(fix_at({0.0, 0.0, 0.0}, 2.1, 0.014)).status->fixes_accepted, 1U);
}

INSTANTIATE_TEST_SUITE_P(Filters, Rewind, testing::Values("ekf15", "eskf18"));

}  // namespace
}  // namespace trigpoint::gps_odometry
