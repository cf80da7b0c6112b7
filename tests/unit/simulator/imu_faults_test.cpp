// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "entries.hpp"
#include "faults.hpp"
#include <gtest/gtest.h>

namespace trigpoint::simulator {

namespace {

constexpr double kImu_s = 0.005;

std::vector<ImuSample> samples_of(const Scenario& scenario) {
  return messages_of<ImuSample>(entries_of(scenario, 1, 4.0, false));
}

bool is_active(const ImuSample& sample, double from_s, double to_s) {
  const double t_s = seconds(small_scenario(), sample.stamp_ns);
  return t_s >= from_s && t_s < to_s;
}

}  // namespace

TEST(ImuSaturation, cuts_every_axis_at_its_range_on_both_sides) {
  const Scenario scenario = scenario_with_fault(
      "type: imu_saturation, start_s: 1.0, duration_s: 1.0, gyro_limit_radps: 0.5, "
      "accel_limit_mps2: 9.0");
  ImuSample sample;
  sample.gyro_radps = {0.7, -0.7, 0.3};
  sample.accel_mps2 = {1.0, -9.5, 9.8};
  const ImuEpoch cut = imu_at(scenario, 1.5, 1, sample);
  EXPECT_EQ(cut.sample.gyro_radps, Eigen::Vector3d(0.5, -0.5, 0.3));
  EXPECT_EQ(cut.sample.accel_mps2, Eigen::Vector3d(1.0, -9.0, 9.0));
  EXPECT_EQ(imu_at(scenario, 2.5, 1, sample).sample.gyro_radps, sample.gyro_radps);
}

TEST(ImuStuck, repeats_the_last_good_sample_under_new_stamps) {
  const auto clean = samples_of(small_scenario());
  const auto stuck =
      samples_of(scenario_with_fault("type: imu_stuck, start_s: 1.0, duration_s: 0.5"));
  ASSERT_EQ(stuck.size(), clean.size());
  int repeated = 0;
  for (std::size_t i = 1; i < clean.size(); ++i) {
    const bool active = is_active(clean[i], 1.0, 1.5);
    const ImuSample& expected = active ? stuck[i - 1] : clean[i];
    EXPECT_EQ(stuck[i].stamp_ns, clean[i].stamp_ns);
    EXPECT_EQ(stuck[i].gyro_radps, expected.gyro_radps);
    EXPECT_EQ(stuck[i].accel_mps2, expected.accel_mps2);
    repeated += active ? 1 : 0;
  }
  EXPECT_EQ(repeated, 100);
}

TEST(ImuBiasStep, adds_its_biases_while_active) {
  const auto clean = samples_of(small_scenario());
  const auto biased = samples_of(scenario_with_fault(
      "type: imu_bias_step, start_s: 1.0, duration_s: 0.5, gyro_radps: [0.0, 0.02, 0.01], "
      "accel_mps2: [0.3, 0.0, -0.2]"));
  ASSERT_EQ(biased.size(), clean.size());
  for (std::size_t i = 0; i < clean.size(); ++i) {
    const double on = is_active(clean[i], 1.0, 1.5) ? 1.0 : 0.0;
    EXPECT_LT(
        (biased[i].gyro_radps - clean[i].gyro_radps - on * Eigen::Vector3d(0.0, 0.02, 0.01)).norm(),
        1e-12);
    EXPECT_LT(
        (biased[i].accel_mps2 - clean[i].accel_mps2 - on * Eigen::Vector3d(0.3, 0.0, -0.2)).norm(),
        1e-12);
  }
}

TEST(ImuClock, steps_the_stamps_and_nothing_else) {
  const auto clean = entries_of(small_scenario(), 1, 4.0, false);
  const auto shifted = entries_of(
      scenario_with_fault("type: imu_clock, start_s: 1.0, duration_s: 0.5, shift_s: -3600.0"),
      1,
      4.0,
      false);
  ASSERT_EQ(shifted.size(), clean.size());
  for (std::size_t i = 0; i < clean.size(); ++i) {
    EXPECT_EQ(shifted[i].receive_ns, clean[i].receive_ns);
    if (const auto* sample = std::get_if<ImuSample>(&clean[i].measurement)) {
      const auto& other = std::get<ImuSample>(shifted[i].measurement);
      EXPECT_EQ(other.stamp_ns - sample->stamp_ns,
                is_active(*sample, 1.0, 1.5) ? from_seconds(-3600.0) : 0);
      EXPECT_EQ(other.gyro_radps, sample->gyro_radps);
    }
  }
}

TEST(ImuGap, comes_now_and_then_for_a_drawn_time) {
  const Scenario scenario =
      scenario_with_fault("type: imu_gap, every_s: 10.0, shortest_s: 0.05, longest_s: 5.0");
  int gaps = 0;
  double gap_s = 0.0;
  double good_s = 0.0;
  double since_s = 0.0;
  bool was_lost = false;
  for (int i = 0; i < 400000; ++i) {  // 2000 s
    const double t_s = i * kImu_s;
    const bool lost = imu_at(scenario, t_s).lost;
    if (lost == was_lost) {
      continue;
    }
    const double length_s = t_s - since_s;
    if (was_lost) {
      EXPECT_GT(length_s, 0.05 - 1.01 * kImu_s);
      EXPECT_LT(length_s, 5.0 + 1.01 * kImu_s);
      ++gaps;
      gap_s += length_s;
    } else {
      EXPECT_GT(length_s, 5.0 - 1.01 * kImu_s);
      EXPECT_LT(length_s, 15.0 + 1.01 * kImu_s);
      good_s += length_s;
    }
    was_lost = lost;
    since_s = t_s;
  }
  EXPECT_NEAR(gap_s / gaps, 2.525, 5.0 * 4.95 / std::sqrt(12.0 * gaps));
  EXPECT_NEAR(good_s / gaps, 10.0, 5.0 * 10.0 / std::sqrt(12.0 * gaps));
}

}  // namespace trigpoint::simulator
