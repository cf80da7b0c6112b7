// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The report of a session that went on another day.
#include "trigpoint/evaluation/report.hpp"
#include "trigpoint/export/session.hpp"

#include "../export/scratch_folder.hpp"
#include "made_session.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace trigpoint::evaluation {
namespace {

using exporter::Opening;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using trigpoint::test::ScratchFolder;

constexpr Nanoseconds kDayTwo_ns = 1'700'086'400'000'000'000;
constexpr double kSecondDrive_m = 100.0;
const ReportOptions kTextAndPage{false, "gnuplot", {}};

/// Metres after "Distance driven (lio.tum): ".
double driven_m(const std::string& text) {
  const std::string key = "Distance driven (lio.tum): ";
  const auto at = text.find(key);
  return at == std::string::npos ? -1.0 : std::stod(text.substr(at + key.size()));
}

/// 10 s along x at 10 m/s, 5000 m away from the first day's drive, in odom epoch `epoch`.
void add_day_two(const std::string& session, bool with_truth, std::uint32_t epoch = 0) {
  const auto path = [&](const char* name) { return exporter::path_in(session, name); };
  namespace file = exporter::session_file;
  const auto trajectory = [&](const char* name) {
    return exporter::TrajectoryWriter(path(name), "", Opening::kContinue);
  };
  auto fused = trajectory(file::kFused);
  auto lio = trajectory(file::kLio);
  auto gps = trajectory(file::kGps);
  auto truth = trajectory(with_truth ? file::kTruth : "unused.tum");
  exporter::ScanLog scans(path(file::kScans), Opening::kContinue);
  exporter::GateLog gate(path(file::kGate), Opening::kContinue);
  exporter::GpsStatusLog statuses(path(file::kGpsStatus), Opening::kContinue);
  for (int i = 0; i <= 100; ++i) {
    const Nanoseconds stamp_ns = kDayTwo_ns + i * Nanoseconds{100'000'000};
    Pose pose;
    pose.p = {5000.0 + i * kSecondDrive_m / 100.0, 0.0, 0.0};
    for (auto* writer : {&fused, &lio, &gps, &truth}) {
      writer->append(stamp_ns, pose);
    }
    LioStatus status;
    status.stamp_ns = stamp_ns;
    status.odom_epoch = epoch;
    status.aligned = true;
    status.scan_ms = 10.0;
    scans.append(status, 4000);
    FusionStatus judged;
    judged.stamp_ns = stamp_ns;
    judged.mode = "hard";
    judged.aligned = true;
    judged.fixes_seen = judged.fixes_used = static_cast<std::uint64_t>(i / 10);
    judged.verdicts = {{"used", judged.fixes_used}};
    gate.append(judged);
    GpsStatus gps_status;
    gps_status.stamp_ns = gps_status.last_accepted_fix_ns = stamp_ns;
    statuses.append(gps_status);
  }
  exporter::RunInfo run{"day two", "offline", "hard", "eskf18", 10.0, 5.0};
  run.begin_ns = kDayTwo_ns;
  run.end_ns = kDayTwo_ns + 10 * kNanosecondsPerSecond;
  run.before = exporter::runs_in(session);
  exporter::write_run(path(file::kRun), run);
}

TEST(ResumedSession, sums_distances_and_times_within_each_day) {
  const ScratchFolder folder;
  test::make_session(folder.path());
  const double day_one_m = driven_m(write_report(folder.path(), kTextAndPage).text);
  add_day_two(folder.path(), true);
  const ReportResult result = write_report(folder.path(), kTextAndPage);
  EXPECT_NEAR(driven_m(result.text), day_one_m + kSecondDrive_m, 0.11);  // two roundings
  EXPECT_THAT(result.text,
              AllOf(HasSubstr("`campus.yaml`, 120.0 s"),
                    HasSubstr("`day two`, 10.0 s"),
                    HasSubstr("Processing time in all: 35.0 s, 3.71 times real time"),
                    HasSubstr("Fixes seen 91, used 82")));
  EXPECT_THAT(result.text, Not(HasSubstr("outage from 1700000120")));
  // 1201 scans of 1 to 100 ms (60.501 s) and 101 of 10 ms, in 130 s.
  EXPECT_THAT(result.text, HasSubstr("|                           2.1 |"));
  const std::string page = trigpoint::test::read_all(folder.file("report.html"));
  EXPECT_THAT(page, AllOf(HasSubstr("<small>130.0 s</small>"), HasSubstr("of 91 seen")));
}

/// Its run.yaml is that of its beginning: without durations.
TEST(KilledRun, has_no_pace) {
  const ScratchFolder folder;
  test::make_session(folder.path());
  auto run = exporter::read_run(folder.file("run.yaml"));
  run.data_s = run.wall_s = 0.0;
  exporter::write_run(folder.file("run.yaml"), run);
  const std::string text = write_report(folder.path(), kTextAndPage).text;
  EXPECT_THAT(text, AllOf(HasSubstr("Processing time: not known"), Not(HasSubstr("0.0 s\n"))));
  const std::string page = trigpoint::test::read_all(folder.file("report.html"));
  EXPECT_THAT(page, AllOf(HasSubstr("not known: the run was killed"), Not(HasSubstr("<b>- x<"))));
  add_day_two(folder.path(), true);
  EXPECT_THAT(write_report(folder.path(), kTextAndPage).text,
              HasSubstr("in all: 5.0 s, 2.00 times real time (without the runs of which"));
}

TEST(ResumedSession, counts_no_way_between_two_odom_epochs) {
  const ScratchFolder folder;
  test::make_session(folder.path());
  const double day_one_m = driven_m(write_report(folder.path(), kTextAndPage).text);
  add_day_two(folder.path(), true, 1);
  auto run = exporter::read_run(folder.file("run.yaml"));
  run.before.clear();  // nobody wrote down that there were two runs: the epochs tell
  exporter::write_run(folder.file("run.yaml"), run);
  EXPECT_NEAR(
      driven_m(write_report(folder.path(), kTextAndPage).text), day_one_m + kSecondDrive_m, 0.11);
}

TEST(ResumedSession, measures_no_segment_and_no_step_from_one_day_to_the_next) {
  const ScratchFolder folder;
  test::make_session(folder.path());
  const std::string before = write_report(folder.path(), kTextAndPage).text;
  add_day_two(folder.path(), true);
  const std::string after = write_report(folder.path(), kTextAndPage).text;
  const auto step_of = [](const std::string& text) {
    const auto at = text.find("Largest step of fused.tum");
    return text.substr(at, text.find(", of ", at) - at);
  };
  EXPECT_EQ(step_of(after), step_of(before));
  EXPECT_THAT(after, HasSubstr(" m of 649 m"));  // end to end: not the kilometres between them
}

TEST(ResumedSession, names_the_run_that_the_truth_says_nothing_of) {
  const ScratchFolder folder;
  test::make_session(folder.path());
  add_day_two(folder.path(), false);
  EXPECT_THAT(write_report(folder.path(), kTextAndPage).text,
              HasSubstr("**truth.tum holds nothing of the run of `day two`"));
  std::filesystem::remove(folder.file("unused.tum"));
  const ScratchFolder whole;
  test::make_session(whole.path());
  add_day_two(whole.path(), true);
  EXPECT_THAT(write_report(whole.path(), kTextAndPage).text,
              Not(HasSubstr("truth.tum holds nothing")));
}

// ---- alignments that are not in force any more --------------------------------------------------

TEST(Report, tells_that_an_alignment_is_not_admitted_any_more_and_prints_no_placeholder) {
  const ScratchFolder folder;
  test::make_session(folder.path());
  auto record = exporter::read_alignment(folder.file("alignment.yaml"));
  record.alignment.covariance = Alignment{}.covariance;
  exporter::write_alignment(folder.file("alignment.yaml"), record);  // as an older gate left it
  FusionStatus last;
  last.stamp_ns = 1'700'000'121'000'000'000;
  last.aligned = true;
  last.yaw_sigma_rad = 1000.0;
  last.position_sigma_m = {1000.0, 1000.0, 1000.0};
  last.fixes_seen = 82;
  exporter::GateLog(folder.file("gate.csv"), Opening::kContinue).append(last);
  const ReportResult result = write_report(folder.path(), kTextAndPage);
  EXPECT_THAT(result.text,
              AllOf(HasSubstr("**Not admitted at the end**"),
                    HasSubstr("How good it is nobody knows"),
                    HasSubstr("In force until 1700000120.000000000"),
                    Not(HasSubstr("1000.000")),
                    Not(HasSubstr("57295"))));
}

TEST(Report, fails_when_the_last_odom_epoch_was_not_aligned) {
  const ScratchFolder folder;
  test::make_session(folder.path());
  auto record = exporter::read_alignment(folder.file("alignment.yaml"));
  record.admitted = false;
  record.was_admitted = true;
  record.comment = "not admitted any more: odom began anew";
  exporter::write_alignment(folder.file("alignment.yaml"), record);
  exporter::ScanLog scans(folder.file("scans.csv"), Opening::kContinue);
  LioStatus status;
  status.odom_epoch = 1;
  for (int i = 1; i <= 3; ++i) {
    status.stamp_ns = 1'700'000'120'000'000'000 + i * Nanoseconds{100'000'000};
    scans.append(status, 4000);
  }
  const ReportResult unaligned = write_report(folder.path(), kTextAndPage);
  EXPECT_THAT(unaligned.failures,
              testing::ElementsAre(AllOf(HasSubstr("ended in odom epoch 1"),
                                         HasSubstr("its 3 scans are left out"))));
  EXPECT_THAT(unaligned.text, HasSubstr("by alignments that were admitted while it was driven"));
  status.stamp_ns += 100'000'000;
  status.aligned = true;  // for a while, until the mapper died
  scans.append(status, 4000);
  EXPECT_THAT(write_report(folder.path(), kTextAndPage).failures, IsEmpty());
}

}  // namespace
}  // namespace trigpoint::evaluation
