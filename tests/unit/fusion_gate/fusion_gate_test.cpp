// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/fusion_gate/fusion_gate.hpp"

#include "trigpoint/base/config.hpp"

#include "simulated_drive.hpp"
#include "verdict_counts.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace trigpoint::fusion_gate {
namespace {

using testing::HasSubstr;

Scenario with_outage(double from_s, double until_s, double sigma_m) {
  Scenario scenario;
  scenario.duration_s = until_s + 10.0;
  scenario.reception = {{from_s, 0.02, true, GpsHealth::kOk},
                        {until_s, sigma_m, false, GpsHealth::kDeadReckoning},
                        {1e9, 0.02, true, GpsHealth::kOk}};
  return scenario;
}

TEST(FusionGate, aligns_and_publishes_the_pose_in_map) {
  SimulatedDrive drive{Scenario{}};
  const Record record = drive.run();
  ASSERT_FALSE(record.fused.empty());
  const double first_s = to_seconds(record.fused.front().stamp_ns - drive.stamp(0.0));
  EXPECT_GT(first_s, 5.0 / 1.2);  // not before the baseline
  EXPECT_LT(first_s, 8.0);
  const double last_s = to_seconds(record.fused.back().stamp_ns - drive.stamp(0.0));
  EXPECT_LT((record.fused.back().T_frame_child.p - drive.T_map_base(last_s).p).norm(), 1e-3);
  EXPECT_EQ(record.fused.back().frame_id, "map");
  EXPECT_TRUE(record.statuses.back().aligned);
  EXPECT_LT(record.statuses.back().yaw_sigma_rad, 0.0175);
}

TEST(FusionGate, publishes_nothing_in_map_before_the_alignment) {
  Scenario scenario;
  scenario.speed_mps = 0.1;  // 3 m in 30 s
  SimulatedDrive drive{scenario};
  const Record record = drive.run();
  EXPECT_TRUE(record.fused.empty());
  EXPECT_TRUE(record.updates.empty());
  EXPECT_EQ(record.statuses.back().axes[0].source, AxisSource::kNone);
  EXPECT_THAT(record.statuses.back().axes[0].reason, HasSubstr("baseline"));
  EXPECT_TRUE(drive.gate().best_alignment());  // for the georeferencing of a short log
}

TEST(FusionGate, repeats_the_first_alignment_until_the_mapper_has_it) {
  Scenario scenario;
  scenario.with_mapper = false;
  scenario.duration_s = 15.0;
  const Record record = SimulatedDrive{scenario}.run();
  EXPECT_GT(record.updates.size(), 10U);
  for (const StateUpdate& update : record.updates) {
    ASSERT_TRUE(update.first_alignment);
    EXPECT_EQ(update.first_alignment->odom_epoch, 7U);
    EXPECT_EQ(update.decision[0], AxisDecision::kLio);  // its fix is in the alignment already
  }
  EXPECT_TRUE(record.fused.empty());
}

TEST(FusionGate, judges_every_fix_of_a_mapper_that_never_takes_the_alignment) {
  Scenario scenario;
  scenario.with_mapper = false;
  scenario.duration_s = 60.0;  // 300 fixes, more than may wait
  const Record record = SimulatedDrive{scenario}.run();
  const FusionStatus& status = record.statuses.back();
  EXPECT_EQ(count_of(status, "no_lio_pose"), 0U);
  EXPECT_LE(count_of(status, "waiting"), 2U);
  ASSERT_FALSE(record.updates.empty());
  // All but those of the one wait, and the alignment is repeated with each fix.
  const Nanoseconds span_ns =
      record.updates.back().fix_stamp_ns - record.updates.front().fix_stamp_ns;
  EXPECT_GE(static_cast<double>(record.updates.size()),
            to_seconds(span_ns) / scenario.fix_interval_s);
}

TEST(FusionGate, waits_once_in_every_odom_epoch_for_the_mapper_to_take_the_alignment) {
  Scenario scenario;
  scenario.with_mapper = false;
  SimulatedDrive drive{scenario};
  double now_s = 0.0;
  for (int epoch = 0; epoch < 2; ++epoch) {
    const std::size_t before = drive.record().updates.size();
    while (drive.record().updates.size() == before && now_s < 30.0) {
      drive.run_until(now_s += 0.01);
    }
    drive.run_until(now_s += 0.45);
    EXPECT_EQ(drive.record().updates.size(), before + 1) << epoch;
    drive.run_until(now_s += 1.0);
    EXPECT_GE(drive.record().updates.size(), before + 6) << epoch;  // fixes of 1.2 s
    drive.begin_epoch(scenario.T_map_odom);
    drive.run_until(now_s += 0.2);  // and LIO's status has told of it
  }
}

TEST(FusionGate, makes_one_row_set_a_fix_whatever_the_rate_of_the_odometry) {
  Scenario scenario;
  scenario.gps_odometry_hz = 5.0;
  const std::vector<StateUpdate> slow = SimulatedDrive{scenario}.run().updates;
  scenario.gps_odometry_hz = 100.0;
  const std::vector<StateUpdate> fast = SimulatedDrive{scenario}.run().updates;
  ASSERT_GT(slow.size(), 100U);
  ASSERT_EQ(slow.size(), fast.size());
  std::set<Nanoseconds> stamps;
  for (std::size_t k = 0; k < slow.size(); ++k) {
    EXPECT_TRUE(stamps.insert(slow[k].fix_stamp_ns).second);
    EXPECT_EQ(slow[k].fix_stamp_ns, fast[k].fix_stamp_ns);
    EXPECT_EQ(slow[k].position_map_m, fast[k].position_map_m);
    EXPECT_EQ(slow[k].covariance_map_m2, fast[k].covariance_map_m2);
    EXPECT_EQ(slow[k].decision, fast[k].decision);
  }
}

TEST(FusionGate, never_makes_a_row_from_dead_reckoning) {
  const Scenario scenario = with_outage(15.0, 25.0, 0.1);  // sigma stays below the threshold
  SimulatedDrive drive{scenario};
  for (const StateUpdate& update : drive.run().updates) {
    const double at_s = to_seconds(update.fix_stamp_ns - drive.stamp(0.0));
    EXPECT_TRUE(at_s < 15.0 || at_s >= 25.0) << at_s;
  }
}

TEST(FusionGate, refuses_a_new_fix_from_an_unhealthy_filter) {
  Scenario scenario;
  scenario.reception = {{15.0, 0.02, true, GpsHealth::kOk}, {1e9, 0.02, true, GpsHealth::kStale}};
  scenario.duration_s = 20.0;
  SimulatedDrive drive{scenario};
  const Record record = drive.run();
  EXPECT_LT(record.updates.back().fix_stamp_ns, drive.stamp(15.0));
  EXPECT_EQ(count_of(record.statuses.back(), "health_stale"), 25U);
}

TEST(FusionGate, keeps_the_fix_out_of_the_axes_whose_sigma_is_above_the_threshold) {
  Scenario scenario;
  scenario.config.threshold = {0.01, 0.5, 0.01};
  const Record record = SimulatedDrive{scenario}.run();
  ASSERT_GT(record.rows().size(), 50U);
  for (const StateUpdate& update : record.rows()) {
    EXPECT_EQ(update.decision[0], AxisDecision::kLio);
    EXPECT_EQ(update.decision[1], AxisDecision::kFused);
    EXPECT_EQ(update.decision[2], AxisDecision::kLio);
  }
  const FusionStatus& status = record.statuses.back();
  EXPECT_EQ(status.axes[0].source, AxisSource::kLio);
  EXPECT_EQ(status.axes[0].reason, "sigma 0.02 m > threshold 0.01 m");
  EXPECT_EQ(status.axes[1].source, AxisSource::kFused);
}

TEST(FusionGate, falls_back_to_lio_in_an_outage_says_so_and_returns) {
  Scenario scenario = with_outage(15.0, 30.0, 3.0);
  SimulatedDrive drive{scenario};
  drive.run_until(14.9);
  EXPECT_EQ(drive.record().statuses.back().axes[0].source, AxisSource::kFused);
  drive.run_until(20.0);
  const FusionStatus& outage = drive.record().statuses.back();
  EXPECT_EQ(outage.axes[0].source, AxisSource::kLio);
  EXPECT_THAT(outage.axes[0].reason, HasSubstr("no accepted fix for 5."));
  EXPECT_THAT(outage.axes[0].reason, HasSubstr("sigma 3.00 m > threshold 0.50 m"));
  EXPECT_GT(count_of(outage, "refused_by_filter_chi_square"), 20U);
  EXPECT_LT(drive.stamp(20.0) - drive.record().fused.back().stamp_ns, from_seconds(0.02));
  drive.run_until(40.0);
  EXPECT_EQ(drive.record().statuses.back().axes[0].source, AxisSource::kFused);
  EXPECT_GT(drive.record().updates.back().fix_stamp_ns, drive.stamp(39.0));
}

TEST(FusionGate, fills_the_modes) {
  Scenario scenario;
  scenario.reception = {{15.0, 0.02, true, GpsHealth::kOk}, {1e9, 5.0, true, GpsHealth::kOk}};
  scenario.config.mode = "lio";
  const Record lio = SimulatedDrive{scenario}.run();
  EXPECT_TRUE(lio.rows().empty());
  EXPECT_FALSE(lio.updates.empty());  // the alignment still goes out
  EXPECT_FALSE(lio.fused.empty());

  scenario.config.mode = "fusion";
  const Record fusion = SimulatedDrive{scenario}.run();
  EXPECT_EQ(fusion.rows().back().decision[2], AxisDecision::kFused);
  EXPECT_EQ(fusion.rows().back().mode, UpdateMode::kRows);

  scenario.config.mode = "hard";
  const Record hard = SimulatedDrive{scenario}.run();
  EXPECT_EQ(hard.rows().back().decision[2], AxisDecision::kLio);

  scenario.config.mode = "literal";
  const Record literal = SimulatedDrive{scenario}.run();
  EXPECT_EQ(literal.rows().front().mode, UpdateMode::kOverwrite);
  EXPECT_EQ(literal.rows().front().decision[0], AxisDecision::kFused);
  EXPECT_EQ(literal.rows().back().decision[0], AxisDecision::kLio);
}

TEST(FusionGate, uses_late_statuses_at_the_stamp_of_their_fix) {
  Scenario scenario;
  scenario.fix_latency_s = 0.5;
  SimulatedDrive drive{scenario};
  const Record record = drive.run();
  ASSERT_GT(record.rows().size(), 50U);
  for (const StateUpdate& update : record.rows()) {
    const double at_s = to_seconds(update.fix_stamp_ns - drive.stamp(0.0));
    EXPECT_NEAR(
        (update.position_map_m - drive.T_map_base(at_s) * scenario.antenna_position_base_m).norm(),
        0.0,
        1e-9);
  }
  EXPECT_NEAR(drive.gate().best_alignment()->T_map_odom.yaw_rad, scenario.T_map_odom.yaw_rad, 1e-4);
}

TEST(FusionGate, refuses_fixes_that_are_too_late_with_the_numbers) {
  Scenario scenario;
  scenario.fix_latency_s = 2.5;
  const Record record = SimulatedDrive{scenario}.run();
  EXPECT_TRUE(record.updates.empty());
  EXPECT_THAT(record.statuses.back().verdict.reason, HasSubstr("s behind LIO, limit 2.30 s"));
  EXPECT_GT(count_of(record.statuses.back(), "late"), 100U);
}

TEST(FusionGate, makes_no_row_that_the_mapper_would_find_too_old) {
  constexpr double kMapperHistory_s = 2.5;  // its rows.history_s
  SimulatedDrive drive{Scenario{}};
  drive.run_until(20.0);
  drive.lio_alive = false;  // scans come late; odometry at IMU rate goes on
  drive.run_until(23.0);
  const std::size_t before = drive.record().updates.size();
  for (int k = 0; k < 30; ++k) {
    drive.keep(drive.gate().on_lio_odometry(drive.lio_odometry(20.0 + 0.1 * k)));
  }
  const std::vector<StateUpdate>& updates = drive.record().updates;
  ASSERT_GT(updates.size(), before);
  for (std::size_t k = before; k < updates.size(); ++k) {
    EXPECT_LE(to_seconds(drive.stamp(22.99) - updates[k].fix_stamp_ns), kMapperHistory_s);
  }
  EXPECT_EQ(count_of(drive.record().statuses.back(), "late"), 3U);  // of 20.0, 20.2 and 20.4 s
}

TEST(FusionGate, lets_no_fix_from_the_far_future_wait_in_the_place_of_true_ones) {
  SimulatedDrive drive{Scenario{}};
  drive.run_until(20.0);
  const std::size_t before = drive.record().updates.size();
  GpsStatus status = drive.status(20.0);
  constexpr int kFromTheFuture = 80;  // more than may wait
  for (int k = 0; k < kFromTheFuture; ++k) {
    status.recent_fixes.push_back({drive.stamp(1e6 + k),
                                   true,
                                   "",
                                   status.accepted_antenna_map_m,
                                   status.accepted_covariance_map_m2});
  }
  drive.keep(drive.gate().on_gps_status(status, "gps-a"));
  drive.run_until(24.0);
  const FusionStatus& last = drive.record().statuses.back();
  EXPECT_EQ(count_of(last, "from_the_future"), static_cast<std::uint64_t>(kFromTheFuture));
  EXPECT_EQ(count_of(last, "no_lio_pose"), 0U);
  EXPECT_GE(drive.record().updates.size(), before + 18);
}

TEST(FusionGate, judges_a_repeated_status_once) {
  SimulatedDrive drive{Scenario{}};
  drive.run_until(20.0);
  const std::size_t before = drive.record().updates.size();
  const GpsStatus status = drive.status(20.0);
  drive.keep(drive.gate().on_gps_status(status, "gps-a"));
  drive.keep(drive.gate().on_gps_status(status, "gps-a"));
  drive.gps_alive = false;
  drive.run_until(22.0);
  EXPECT_EQ(drive.record().updates.size(), before + 1);
}

TEST(FusionGate, judges_a_fix_once_when_statuses_come_shuffled) {
  SimulatedDrive drive{Scenario{}};
  drive.run_until(20.0);
  const std::size_t before = drive.record().updates.size();
  const GpsStatus older = drive.status(20.0);
  const GpsStatus newer = drive.status(20.2);
  for (const GpsStatus& status : {newer, older, newer, older}) {
    drive.keep(drive.gate().on_gps_status(status, "gps-a"));
  }
  drive.gps_alive = false;
  drive.run_until(22.0);
  EXPECT_EQ(drive.record().updates.size(), before + 2);
}

TEST(FusionGate, mixes_no_pairs_of_two_odom_epochs) {
  Scenario scenario;
  scenario.with_mapper = false;
  SimulatedDrive drive{scenario};
  drive.run_until(8.0);
  const YawPose moved{-1.0, {3.0, 2.0, 1.0}};
  drive.begin_epoch(moved);
  drive.run_until(20.0);
  std::size_t of_new_epoch = 0;
  for (const StateUpdate& update : drive.record().updates) {
    if (update.first_alignment->odom_epoch == drive.epoch) {
      ++of_new_epoch;
      EXPECT_NEAR(update.first_alignment->T_map_odom.yaw_rad, moved.yaw_rad, 1e-3);
    }
  }
  EXPECT_GT(of_new_epoch, 20U);
}

TEST(FusionGate, aligns_anew_in_a_new_odom_epoch) {
  Scenario scenario;
  SimulatedDrive drive{scenario};
  drive.run_until(20.0);
  const YawPose moved{-1.0, {3.0, 2.0, 1.0}};
  drive.begin_epoch(moved);
  drive.run_until(40.0);
  const StateUpdate& last = drive.record().updates.back();
  EXPECT_FALSE(last.first_alignment);
  EXPECT_NEAR(drive.gate().best_alignment()->T_map_odom.yaw_rad, moved.yaw_rad, 1e-4);
  EXPECT_EQ(drive.gate().best_alignment()->odom_epoch, 8U);
  const Odometry& fused = drive.record().fused.back();
  const double at_s = to_seconds(fused.stamp_ns - drive.stamp(0.0));
  EXPECT_LT((fused.T_frame_child.p - drive.T_map_base(at_s).p).norm(), 1e-3);
}

TEST(FusionGate, never_lets_a_stamp_of_the_fused_pose_go_back) {
  Scenario scenario;
  SimulatedDrive drive{scenario};
  drive.run_until(20.0);
  drive.keep(drive.gate().on_lio_odometry_imu_rate(drive.lio_odometry(19.5)));
  drive.run_until(21.0);
  drive.begin_epoch(scenario.T_map_odom);
  drive.run_until(35.0);
  const std::vector<Odometry>& fused = drive.record().fused;
  for (std::size_t k = 1; k < fused.size(); ++k) {
    EXPECT_GT(fused[k].stamp_ns, fused[k - 1].stamp_ns);
  }
}

TEST(FusionGate, follows_the_scan_rate_odometry_where_there_is_no_imu_rate) {
  Scenario scenario;
  scenario.with_imu_rate = false;
  const Record record = SimulatedDrive{scenario}.run();
  ASSERT_GT(record.fused.size(), 200U);
  EXPECT_LT(record.fused.size(), 300U);
}

TEST(FusionGate, carries_on_with_gps_when_the_mapper_dies_and_flags_it) {
  Scenario scenario;
  scenario.with_imu_rate = false;
  SimulatedDrive drive{scenario};
  drive.run_until(20.0);
  drive.lio_alive = false;
  drive.run_until(25.0);
  EXPECT_EQ(drive.record().statuses.back().axes[1].source, AxisSource::kGps);
  EXPECT_LT(drive.stamp(25.0) - drive.record().fused.back().stamp_ns, from_seconds(0.2));
  drive.lio_alive = true;
  drive.run_until(27.0);
  EXPECT_EQ(drive.record().statuses.back().axes[1].source, AxisSource::kFused);
}

TEST(FusionGate, takes_over_from_a_gps_that_went_astray_when_the_mapper_comes_back_behind_it) {
  Scenario scenario;
  scenario.config = Config{};  // mode smooth
  scenario.with_imu_rate = false;
  SimulatedDrive drive{scenario};
  drive.run_until(20.0);
  drive.lio_alive = false;
  drive.gps_alive = false;
  for (int k = 0; k < 150; ++k) {
    const double now_s = 20.0 + 0.02 * k;
    Odometry odometry = drive.lio_odometry(now_s);
    odometry.frame_id = "map";
    odometry.T_frame_child = drive.T_map_base(now_s);
    odometry.T_frame_child.p.x() += 5.0;
    drive.keep(drive.gate().on_gps_odometry(odometry, "gps-a"));
  }
  for (int k = 0; k < 30; ++k) {  // the scans that waited, and newer ones
    const double scan_s = 22.0 + 0.1 * k;
    drive.keep(drive.gate().on_lio_odometry(drive.lio_odometry(scan_s)));
    drive.keep(drive.gate().on_lio_status(drive.lio_status(scan_s)));
  }
  EXPECT_NEAR(to_seconds(drive.record().fused.back().stamp_ns - drive.stamp(0.0)), 24.9, 0.01);
  for (const Odometry& fused : drive.record().fused) {
    const Pose truth = drive.T_map_base(to_seconds(fused.stamp_ns - drive.stamp(0.0)));
    EXPECT_LT((fused.T_frame_child.p - truth.p).norm(), 1.0);  // 2 s of the hand-over to GPS
  }
}

TEST(FusionGate, carries_on_with_lio_when_gps_dies_and_flags_it) {
  SimulatedDrive drive{Scenario{}};
  drive.run_until(20.0);
  drive.gps_alive = false;
  drive.run_until(25.0);
  const FusionStatus& status = drive.record().statuses.back();
  EXPECT_EQ(status.axes[1].source, AxisSource::kLio);
  EXPECT_THAT(status.axes[1].reason, HasSubstr("no accepted fix for"));
  EXPECT_EQ(status.gps_source, "");
  EXPECT_LT(drive.stamp(25.0) - drive.record().fused.back().stamp_ns, from_seconds(0.02));
}

TEST(FusionGate, refuses_a_source_that_names_another_datum) {
  Scenario scenario;
  scenario.datum_id = "somewhere else";
  scenario.duration_s = 10.0;
  SimulatedDrive drive{scenario};
  drive.gate().on_datum({49.0, 8.0, 100.0, 0});
  const Record record = drive.run();
  EXPECT_TRUE(record.updates.empty());
  EXPECT_TRUE(record.selected.empty());
  EXPECT_EQ(count_of(record.statuses.back(), "other_datum"), 50U);
}

TEST(FusionGate, keeps_the_older_datum_in_a_conflict) {
  FusionGate gate({}, {});
  gate.on_datum({49.0, 8.0, 100.0, 50});
  const Output newer = gate.on_datum({49.1, 8.0, 100.0, 60});
  ASSERT_EQ(newer.events.size(), 1U);
  EXPECT_EQ(newer.events[0].code, "datum_conflict");
  const Output older = gate.on_datum({49.1, 8.0, 100.0, 40});
  EXPECT_EQ(older.events.at(0).code, "datum_adopted");
  const Output impossible = gate.on_datum({490.0, 8.0, 100.0, 1});
  EXPECT_EQ(impossible.events.at(0).code, "datum_refused");
}

TEST(FusionGate, changes_over_between_two_filters_without_using_a_fix_twice) {
  SimulatedDrive drive{Scenario{}};
  drive.run_until(20.0);
  const std::size_t before = drive.record().updates.size();
  // The second filter tells of a fix that the first has told of, then alone of new ones.
  GpsStatus second = drive.status(19.8);
  second.source = "eskf18";
  drive.keep(drive.gate().on_gps_status(second, "gps-b"));
  drive.gps_alive = false;
  for (int k = 0; k < 15; ++k) {
    const double now_s = 20.0 + 0.2 * k;
    Odometry odometry = drive.lio_odometry(now_s);
    odometry.frame_id = "map";
    odometry.T_frame_child = drive.T_map_base(now_s);
    drive.keep(drive.gate().on_gps_odometry(odometry, "gps-b"));
    drive.keep(drive.gate().on_gps_status(drive.status(now_s), "gps-b"));
    drive.run_until(now_s + 0.2);
  }
  EXPECT_EQ(drive.record().statuses.back().gps_source, "gps-b");
  std::set<Nanoseconds> stamps;
  for (const StateUpdate& update : drive.record().updates) {
    EXPECT_TRUE(stamps.insert(update.fix_stamp_ns).second);
  }
  EXPECT_GE(drive.record().updates.size(), before + 8);  // within 1.5 s
}

TEST(FusionGate, does_not_let_nan_through) {
  SimulatedDrive drive{Scenario{}};
  drive.run_until(20.0);
  const std::size_t before = drive.record().updates.size();
  GpsStatus status = drive.status(20.0);
  status.accepted_antenna_map_m.y() = kNaN;
  const Output refused = drive.gate().on_gps_status(status, "gps-a");
  EXPECT_TRUE(refused.state_updates.empty());
  EXPECT_EQ(count_of(*refused.status, "not_finite"), 1U);
  Odometry broken = drive.lio_odometry(20.1);
  broken.T_frame_child.p.z() = kNaN;
  EXPECT_FALSE(drive.gate().on_lio_odometry_imu_rate(broken).fused);
  EXPECT_FALSE(drive.gate().on_lio_odometry(broken).fused);
  LioStatus lio = drive.lio_status(20.1);
  lio.T_map_odom.yaw_rad = kNaN;
  EXPECT_EQ(drive.gate().on_lio_status(lio).events.at(0).code, "lio_status_refused");
  EXPECT_TRUE(drive.gate()
                  .on_lio_odometry_imu_rate(drive.lio_odometry(20.2))
                  .fused->T_frame_child.is_finite());
  EXPECT_EQ(drive.record().updates.size(), before);
}

TEST(FusionGate, reports_its_state_at_five_hertz_between_fixes) {
  Scenario scenario;
  scenario.fix_interval_s = 5.0;
  scenario.duration_s = 20.0;
  const Record record = SimulatedDrive{scenario}.run();
  EXPECT_GT(record.statuses.size(), 90U);
  EXPECT_LT(record.statuses.size(), 125U);
}

TEST(FusionGate, gives_the_same_bits_on_every_run) {
  const Record first = SimulatedDrive{with_outage(10.0, 15.0, 2.0)}.run();
  const Record second = SimulatedDrive{with_outage(10.0, 15.0, 2.0)}.run();
  ASSERT_EQ(first.fused.size(), second.fused.size());
  for (std::size_t k = 0; k < first.fused.size(); ++k) {
    ASSERT_EQ(first.fused[k].T_frame_child.p, second.fused[k].T_frame_child.p);
    ASSERT_EQ(first.fused[k].pose_covariance, second.fused[k].pose_covariance);
  }
}

TEST(FusionGateConfig, is_loaded_strictly_and_refuses_an_unknown_mode) {
  Config config;
  const auto document = [&](ConfigFields& fields) {
    fields.section("fusion_gate", "", [&](ConfigFields& section) { describe(config, section); });
  };
  load_config_text(
      "fusion_gate: {mode: literal, threshold: [1, 1, 2], alignment: {min_baseline_m: 8}}",
      "test",
      document);
  EXPECT_EQ(config.mode, "literal");
  EXPECT_EQ(config.alignment.min_baseline_m, 8.0);
  EXPECT_THROW(load_config_text("fusion_gate: {mode: soft}", "test", document), ConfigError);
  EXPECT_THROW(load_config_text("fusion_gate: {threshold: [0, 1, 1]}", "test", document),
               ConfigError);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
