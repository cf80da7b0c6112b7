// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/session.hpp"

#include "scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace trigpoint::exporter {
namespace {

using test::error_of;
using test::read_all;
using test::ScratchFolder;
using test::write_all;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// One rounding when a sigma becomes a variance again.
constexpr double kSigmaRoundTrip = 1e-12;

GnssFix some_fix() {
  GnssFix fix;
  fix.stamp_ns = 1'317'377'394'123'456'789;
  fix.latitude_deg = 49.011212804408;
  fix.longitude_deg = 8.4228850417969;
  fix.altitude_m = 112.83492279053;
  fix.status = FixStatus::kGbas;
  fix.covariance_enu_m2.diagonal() = Eigen::Vector3d(0.01, 0.04, 0.09);
  fix.covariance_type = CovarianceType::kDiagonalKnown;
  return fix;
}

TEST(FixLog, returns_every_bit_of_a_place) {
  const ScratchFolder folder;
  FixLog log(folder.file("fixes.csv"));
  log.append(some_fix(), 42, true);
  const auto fixes = read_fixes(folder.file("fixes.csv"));
  ASSERT_EQ(fixes.size(), 1U);
  EXPECT_EQ(fixes[0].fix.stamp_ns, some_fix().stamp_ns);
  EXPECT_EQ(fixes[0].fix.latitude_deg, some_fix().latitude_deg);
  EXPECT_EQ(fixes[0].fix.longitude_deg, some_fix().longitude_deg);
  EXPECT_EQ(fixes[0].fix.altitude_m, some_fix().altitude_m);
  EXPECT_EQ(fixes[0].fix.status, FixStatus::kGbas);
  EXPECT_EQ(fixes[0].receive_ns, 42);
  EXPECT_TRUE(fixes[0].withheld);
  EXPECT_NEAR(fixes[0].fix.covariance_enu_m2(2, 2), 0.09, kSigmaRoundTrip);
}

TEST(FixLog, keeps_an_unknown_covariance_unknown) {
  const ScratchFolder folder;
  FixLog log(folder.file("fixes.csv"));
  auto fix = some_fix();
  fix.covariance_type = CovarianceType::kUnknown;
  fix.altitude_m = kNaN;
  log.append(fix, 0, false);
  const auto fixes = read_fixes(folder.file("fixes.csv"));
  ASSERT_EQ(fixes.size(), 1U);
  EXPECT_EQ(fixes[0].fix.covariance_type, CovarianceType::kUnknown);
  EXPECT_TRUE(std::isnan(fixes[0].fix.altitude_m));
}

TEST(FixLog, refuses_a_wrong_word_with_file_line_and_column) {
  const ScratchFolder folder;
  {
    FixLog log(folder.file("fixes.csv"));
    log.append(some_fix(), 42, false);
  }
  auto text = read_all(folder.file("fixes.csv"));
  text.replace(text.find("gbas"), 4, "best");
  write_all(folder.file("fixes.csv"), text);
  EXPECT_THAT(error_of([&] { read_fixes(folder.file("fixes.csv")); }),
              AllOf(HasSubstr("fixes.csv:2"), HasSubstr("status"), HasSubstr("'best'")));
}

TEST(FixLog, refuses_another_header) {
  const ScratchFolder folder;
  write_all(folder.file("fixes.csv"), "time,lat,lon\n1,2,3\n");
  EXPECT_THAT(error_of([&] { read_fixes(folder.file("fixes.csv")); }),
              AllOf(HasSubstr("fixes.csv:1"), HasSubstr("expected the header")));
}

TEST(GateLog, returns_reasons_with_commas_quotes_and_line_breaks_in_one_row) {
  const ScratchFolder folder;
  FusionStatus status;
  status.stamp_ns = 7;
  status.mode = "hard";
  status.axes[0] = {AxisSource::kFused, 0.1, 0.5, ""};
  status.axes[1] = {AxisSource::kLio, 0.62, 0.5, "sigma 0.62 m > \"threshold\", 0.50 m\nsecond"};
  status.aligned = true;
  status.T_map_odom = {0.25, {1.0, 2.0, 3.0}};
  status.yaw_sigma_rad = 0.01;
  status.verdict = {5, true, "used"};
  status.fixes_seen = 12;
  status.fixes_used = 9;
  status.verdicts = {{"stale: 2 s", 2}, {"no_fix", 1}};
  status.gps_source = "ekf15";
  GateLog log(folder.file("gate.csv"));
  log.append(status);
  const auto rows = read_gate_log(folder.file("gate.csv"));
  ASSERT_EQ(rows.size(), 1U);
  const auto& row = rows[0];
  EXPECT_EQ(row.axes[1].reason, "sigma 0.62 m > \"threshold\", 0.50 m second");
  EXPECT_EQ(row.axes[0].source, AxisSource::kFused);
  EXPECT_EQ(row.axes[2].source, AxisSource::kNone);
  EXPECT_TRUE(std::isnan(row.axes[2].sigma_m));
  EXPECT_EQ(row.T_map_odom.p, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(row.verdict.fix_stamp_ns, 5);
  EXPECT_EQ(row.fixes_used, 9U);
  ASSERT_EQ(row.verdicts.size(), 2U);
  EXPECT_EQ(row.verdicts[0].name, "stale: 2 s");
  EXPECT_EQ(row.verdicts[0].count, 2U);
  EXPECT_EQ(row.gps_source, "ekf15");
}

TEST(GateLog, keeps_every_verdict_of_a_status_the_newest_last) {
  const ScratchFolder folder;
  FusionStatus status;
  status.stamp_ns = 9;
  status.fixes_seen = 4;
  status.judged = {{5, true, "alignment"}, {7, false, "late"}, {6, true, "used"}};
  status.verdict = status.judged.back();
  GateLog log(folder.file("gate.csv"));
  log.append(status);
  status.judged.clear();  // nothing new
  log.append(status);
  const auto rows = read_gate_log(folder.file("gate.csv"));
  std::vector<Nanoseconds> fixes_ns;
  for (const FusionStatus& row : rows) {
    fixes_ns.push_back(row.verdict.fix_stamp_ns);
    EXPECT_EQ(row.stamp_ns, 9);
    EXPECT_EQ(row.fixes_seen, 4U);
  }
  EXPECT_THAT(fixes_ns, ElementsAre(5, 7, 6, 6));
  EXPECT_EQ(rows.at(1).verdict.reason, "late");
  EXPECT_FALSE(rows.at(1).verdict.used);
}

TEST(ScanLog, returns_what_was_logged) {
  const ScratchFolder folder;
  LioStatus status;
  status.stamp_ns = 11;
  status.odom_epoch = 2;
  status.health = LioHealth::kDegraded;
  status.scan_ms = 12.5;
  status.observability[5] = 0.125;
  status.sigma[3] = 0.001;
  status.rows_applied = 4;
  status.last_refusal = "too old, by 2 s";
  ScanLog log(folder.file("scans.csv"));
  log.append(status, 1234);
  const auto scans = read_scans(folder.file("scans.csv"));
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0].points, 1234U);
  EXPECT_EQ(scans[0].status.scan_ms, 12.5);
  EXPECT_EQ(scans[0].status.health, LioHealth::kDegraded);
  EXPECT_EQ(scans[0].status.observability[5], 0.125);
  EXPECT_EQ(scans[0].status.sigma[3], 0.001);
  EXPECT_EQ(scans[0].status.last_refusal, "too old, by 2 s");
}

TEST(GpsStatusLog, returns_what_was_logged) {
  const ScratchFolder folder;
  GpsStatus status;
  status.stamp_ns = 13;
  status.source = "eskf18";
  status.health = GpsHealth::kDeadReckoning;
  status.gnss_class = GnssClass::kFixed;
  status.accepted_covariance_map_m2(1, 1) = 0.25;
  status.rejections = {{"stale", 3}};
  GpsStatusLog log(folder.file("gps_status.csv"));
  log.append(status);
  const auto rows = read_gps_status(folder.file("gps_status.csv"));
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].health, GpsHealth::kDeadReckoning);
  EXPECT_EQ(rows[0].gnss_class, GnssClass::kFixed);
  EXPECT_NEAR(rows[0].accepted_covariance_map_m2(1, 1), 0.25, kSigmaRoundTrip);
  ASSERT_EQ(rows[0].rejections.size(), 1U);
  EXPECT_EQ(rows[0].rejections[0].count, 3U);
}

TEST(Datum, returns_every_bit) {
  const ScratchFolder folder;
  const Datum datum{48.982658, 8.391234567890123, 116.25, 1'317'377'394'123'456'789};
  write_datum(folder.file("datum.yaml"), datum);
  const auto read = read_datum(folder.file("datum.yaml"));
  EXPECT_EQ(read.latitude_deg, datum.latitude_deg);
  EXPECT_EQ(read.longitude_deg, datum.longitude_deg);
  EXPECT_EQ(read.height_m, datum.height_m);
  EXPECT_EQ(read.elected_ns, datum.elected_ns);
  EXPECT_THAT(read_all(folder.file("datum.yaml")), HasSubstr(datum.id()));
}

TEST(Datum, is_refused_when_a_key_is_missing_or_no_place_on_the_earth) {
  const ScratchFolder folder;
  write_all(folder.file("datum.yaml"), "latitude_deg: 48\nlongitude_deg: 8\n");
  EXPECT_THAT(error_of([&] { read_datum(folder.file("datum.yaml")); }),
              AllOf(HasSubstr("datum.yaml"), HasSubstr("height_m is missing")));
  write_all(folder.file("datum.yaml"),
            "latitude_deg: 98\nlongitude_deg: 8\nheight_m: 1\nelected_ns: 0\n");
  EXPECT_THAT(error_of([&] { read_datum(folder.file("datum.yaml")); }), HasSubstr("not a place"));
}

TEST(AlignmentRecord, returns_yaw_translation_and_covariance) {
  const ScratchFolder folder;
  AlignmentRecord record;
  record.alignment.odom_epoch = 3;
  record.alignment.T_map_odom = {-1.25, {10.0, -20.0, 0.5}};
  record.alignment.covariance.diagonal() = Eigen::Vector4d(1e-4, 0.01, 0.04, 0.09);
  record.alignment.covariance(0, 2) = 1e-3;
  record.comment = "yaw sigma 0.6 deg: limit is 0.5";
  record.was_admitted = true;
  write_alignment(folder.file("alignment.yaml"), record);
  const auto read = read_alignment(folder.file("alignment.yaml"));
  EXPECT_EQ(read.alignment.odom_epoch, 3U);
  EXPECT_EQ(read.alignment.T_map_odom.yaw_rad, -1.25);
  EXPECT_EQ(read.alignment.T_map_odom.p, record.alignment.T_map_odom.p);
  EXPECT_EQ(read.alignment.covariance, record.alignment.covariance);
  EXPECT_FALSE(read.admitted);
  EXPECT_TRUE(read.was_admitted);
  EXPECT_EQ(read.comment, record.comment);
}

TEST(RunInfo, keeps_paths_with_quotes_and_colons) {
  const ScratchFolder folder;
  const RunInfo run{"a \"log\": one.bag", "dds", "hard", "ekf15", 120.5, 30.25};
  write_run(folder.file("run.yaml"), run);
  const auto read = read_run(folder.file("run.yaml"));
  EXPECT_EQ(read.log, run.log);
  EXPECT_EQ(read.data_s, 120.5);
  EXPECT_EQ(read.wall_s, 30.25);
}

TEST(RunInfo, keeps_what_was_run_before_the_session_was_resumed) {
  const ScratchFolder folder;
  RunInfo first{"day one", "offline", "smooth", "eskf18", 40.0, 4.0};
  first.begin_ns = 1'700'000'000'000'000'001;
  first.end_ns = 1'700'000'040'000'000'000;
  write_run(folder.file("run.yaml"), first);
  RunInfo second{"day: \"two\"", "offline", "hard", "ekf15", 30.0, 3.0};
  second.before = runs_in(folder.path());
  write_run(folder.file("run.yaml"), second);
  RunInfo third{"day three", "offline", "hard", "ekf15", 20.0, 2.0};
  third.before = runs_in(folder.path());
  write_run(folder.file("run.yaml"), third);
  const auto runs = runs_in(folder.path());
  ASSERT_EQ(runs.size(), 3U);
  EXPECT_EQ(runs[0].log, "day one");
  EXPECT_EQ(runs[0].begin_ns, first.begin_ns);
  EXPECT_EQ(runs[0].end_ns, first.end_ns);
  EXPECT_EQ(runs[1].log, second.log);
  EXPECT_FALSE(runs[1].begin_ns);
  EXPECT_EQ(runs[2].data_s, 20.0);
  EXPECT_EQ(read_run(folder.file("run.yaml")).before.size(), 2U);
}

TEST(RunInfo, knows_a_session_whose_programs_wrote_none) {
  const ScratchFolder folder;
  EXPECT_TRUE(runs_in(folder.path()).empty());
  write_all(folder.file("lio.tum"), "");
  ASSERT_EQ(runs_in(folder.path()).size(), 1U);
  EXPECT_EQ(runs_in(folder.path()).front().log, "not recorded");
}

TEST(SweepLog, returns_what_was_appended_and_goes_on) {
  const ScratchFolder folder;
  SweepLog(folder.file("sweeps.csv")).append({1'700'000'000'013'000'000, 5, 6});
  SweepLog(folder.file("sweeps.csv"), Opening::kContinue).append({2, 3, 4});
  const auto sweeps = read_sweeps(folder.file("sweeps.csv"));
  ASSERT_EQ(sweeps.size(), 2U);
  EXPECT_EQ(sweeps[0].stamp_ns, 1'700'000'000'013'000'000);
  EXPECT_EQ(sweeps[0].receive_ns, 5);
  EXPECT_EQ(sweeps[1].arrival_ns, 4);
}

/// 1000 rad and m stand for what nobody knows.
TEST(Session, holds_no_placeholder_of_a_sigma_for_a_figure) {
  const ScratchFolder folder;
  EXPECT_FALSE(is_known(Alignment{}));
  write_alignment(folder.file("alignment.yaml"), {});
  const std::string alignment = read_all(folder.file("alignment.yaml"));
  EXPECT_THAT(alignment, HasSubstr("yaw_sigma_rad: nan\nx_sigma_m: nan"));
  FusionStatus status;
  status.aligned = true;
  status.yaw_sigma_rad = 1000.0;
  status.position_sigma_m = {1000.0, 0.25, 1000.0};
  GateLog(folder.file("gate.csv")).append(status);
  const auto row = read_gate_log(folder.file("gate.csv")).front();
  EXPECT_TRUE(std::isnan(row.yaw_sigma_rad));
  EXPECT_TRUE(std::isnan(row.position_sigma_m[0]));
  EXPECT_EQ(row.position_sigma_m[1], 0.25);
}

TEST(Counts, are_replaced_whole_and_may_be_none) {
  const ScratchFolder folder;
  const CountsWriter writer(folder.path(), "player");
  writer.write({});
  EXPECT_TRUE(read_counts(folder.file("player.counts.yaml")).empty());
  writer.write({{"points.in_log", 1200}, {"fix.refused.no fix: why", 3}});
  const auto counts = read_counts(folder.file("player.counts.yaml"));
  ASSERT_EQ(counts.size(), 2U);
  EXPECT_EQ(counts[0].name, "points.in_log");
  EXPECT_EQ(counts[0].count, 1200U);
  EXPECT_EQ(counts[1].name, "fix.refused.no fix: why");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()),
                          std::filesystem::directory_iterator()),
            1);
}

TEST(Counts, go_on_from_those_of_the_session_that_is_resumed) {
  const ScratchFolder folder;
  CountsWriter(folder.path(), "log").write({{"points.in_log", 100}, {"fix.withheld", 2}});
  const CountsWriter resumed(folder.path(), "log", Opening::kContinue);
  resumed.write({{"points.in_log", 10}});
  resumed.write({{"points.in_log", 30}, {"imu.in_log", 7}});  // the same run, later
  std::map<std::string, std::uint64_t> counts;
  for (const NamedCount& entry : read_counts(folder.file("log.counts.yaml"))) {
    counts[entry.name] = entry.count;
  }
  EXPECT_EQ(counts["points.in_log"], 130U);
  EXPECT_EQ(counts["fix.withheld"], 2U);
  EXPECT_EQ(counts["imu.in_log"], 7U);
  CountsWriter(folder.path(), "log").write({{"points.in_log", 5}});
  EXPECT_EQ(read_counts(folder.file("log.counts.yaml")).front().count, 5U);
}

TEST(SessionFolder, is_created_with_its_parents_and_refused_where_a_file_is) {
  const ScratchFolder folder;
  create_session_folder(folder.file("a/b"));
  EXPECT_TRUE(std::filesystem::is_directory(folder.file("a/b")));
  write_all(folder.file("c"), "");
  EXPECT_THAT(error_of([&] { create_session_folder(folder.file("c")); }),
              HasSubstr(folder.file("c")));
}

TEST(Session, counts_tell_refused_fixes_from_notes_and_from_the_imu) {
  GpsStatus status;
  status.fixes_received = 10;
  status.fixes_accepted = 7;
  status.rejections = {{"before_imu", 1},
                       {"before_imu", 1},
                       {"gate", 1},
                       {"imu_units_g", 4782},
                       {"recovered", 1},
                       {"used_with_default_covariance", 6}};
  const ScratchFolder folder;
  const CountsWriter writer(folder.path(), "gps_odometry");
  writer.write(counts_of(status));
  std::map<std::string, std::uint64_t> counts;
  for (const NamedCount& entry : read_counts(folder.file("gps_odometry.counts.yaml"))) {
    counts[entry.name] = entry.count;
  }
  EXPECT_EQ(counts["fix.refused.before_imu"], 2U);
  EXPECT_EQ(counts["fix.refused.gate"], 1U);
  EXPECT_EQ(counts["fix.note.recovered"], 1U);
  EXPECT_EQ(counts["fix.note.used_with_default_covariance"], 6U);
  EXPECT_EQ(counts["imu.refused.imu_units_g"], 4782U);
  EXPECT_FALSE(counts.contains("fix.refused.imu_units_g"));
}

TEST(Session, remembers_that_a_run_was_interrupted) {
  const ScratchFolder folder;
  RunInfo run{"log", "dds", "hard", "ekf15", 1.0, 2.0};
  write_run(folder.file("run.yaml"), run);
  EXPECT_FALSE(read_run(folder.file("run.yaml")).interrupted);
  // As a shell script notes it afterwards.
  write_all(folder.file("run.yaml"), read_all(folder.file("run.yaml")) + "interrupted: true\n");
  EXPECT_TRUE(read_run(folder.file("run.yaml")).interrupted);
  run.interrupted = true;
  write_run(folder.file("run.yaml"), run);
  EXPECT_TRUE(read_run(folder.file("run.yaml")).interrupted);
}

TEST(Session, reads_the_datum_that_a_truth_file_names) {
  const ScratchFolder folder;
  write_all(folder.file("t.tum"),
            "# truth\n# datum 43.945600000 -78.896800000 100.0000  # latitude\n");
  const auto datum = datum_named_in(folder.file("t.tum"));
  ASSERT_TRUE(datum);
  EXPECT_EQ(datum->id(), (Datum{43.9456, -78.8968, 100.0, 0}.id()));
  write_all(folder.file("u.tum"), "# truth\n1 0 0 0 0 0 0 1\n# datum 1 2 3\n");
  EXPECT_FALSE(datum_named_in(folder.file("u.tum")));
  EXPECT_FALSE(datum_named_in("/nowhere"));
}

TEST(Session, an_alignment_differs_when_a_map_would_lie_visibly_elsewhere) {
  AlignmentRecord written;
  written.alignment.T_map_odom = {3.1415, {10.0, 20.0, 1.0}};
  AlignmentRecord next = written;
  EXPECT_FALSE(differs_substantially(next, written));
  next.alignment.T_map_odom.p.x() += 0.01;
  next.alignment.T_map_odom.yaw_rad = -3.1415;  // 0.2 mrad further, across the cut
  EXPECT_FALSE(differs_substantially(next, written));
  next.alignment.T_map_odom.p.x() += 0.1;
  EXPECT_TRUE(differs_substantially(next, written));
  next = written;
  next.admitted = true;
  EXPECT_TRUE(differs_substantially(next, written));
}

TEST(FixLog, that_holds_anything_shows_it_harmless_and_short) {
  const ScratchFolder folder;
  write_all(folder.file("fixes.csv"), "\x1B[2J\xFF" + std::string(500, 'a') + "\n");
  const std::string error = error_of([&] { read_fixes(folder.file("fixes.csv")); });
  EXPECT_THAT(error, AllOf(HasSubstr("\\x1B[2J\\xFFaaa"), HasSubstr("aaa...'")));
  EXPECT_THAT(error, testing::Not(HasSubstr(std::string(100, 'a'))));
}

}  // namespace
}  // namespace trigpoint::exporter
