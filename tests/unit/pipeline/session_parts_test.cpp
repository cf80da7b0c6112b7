// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

#include "trigpoint/export/session.hpp"

#include "../export/scratch_folder.hpp"
#include "stored_log.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::pipeline {
namespace {

using test::read_all;
using test::ScratchFolder;
using test::write_all;
using ::testing::AllOf;
using ::testing::HasSubstr;

Alignment at_x(double x_m, std::uint32_t odom_epoch = 0) {
  Alignment alignment;
  alignment.odom_epoch = odom_epoch;
  alignment.T_map_odom.p.x() = x_m;
  alignment.covariance = 0.01 * Eigen::Matrix4d::Identity();
  return alignment;
}

exporter::AlignmentRecord kept_in(const ScratchFolder& folder) {
  return exporter::read_alignment(folder.file("alignment.yaml"));
}

TEST(GatePart, rewrites_the_alignment_when_it_moves_and_not_at_every_status) {
  const ScratchFolder folder;
  GatePart part(folder.path());
  const auto at = [&](double now_s, double x_m, bool admitted) {
    FusionStatus status;
    status.stamp_ns = from_seconds(now_s);
    part.on_status(status);
    part.on_alignment(at_x(x_m), admitted);
    return kept_in(folder).alignment.T_map_odom.p.x();
  };
  EXPECT_EQ(at(100.0, 1.0, false), 1.0);
  EXPECT_EQ(at(101.0, 2.0, false), 1.0);   // too soon
  EXPECT_EQ(at(101.2, 2.0, true), 2.0);    // admitted: at once
  EXPECT_EQ(at(110.0, 2.001, true), 2.0);  // nothing new
  EXPECT_EQ(at(111.0, 2.5, true), 2.5);
  part.close();
}

/// A mapper that was killed: its successor says aligned, and for how good only the placeholder.
TEST(GatePart, does_not_admit_any_more_what_a_mapper_without_its_place_has_left) {
  const ScratchFolder folder;
  GatePart part(folder.path());
  part.on_alignment(at_x(3.0), true);
  EXPECT_TRUE(kept_in(folder).admitted);
  Alignment of_searching = at_x(3.0);
  of_searching.covariance = Alignment{}.covariance;
  part.on_alignment(of_searching, true);
  EXPECT_FALSE(kept_in(folder).admitted);
  EXPECT_TRUE(kept_in(folder).was_admitted);
  EXPECT_EQ(kept_in(folder).alignment.covariance, at_x(3.0).covariance);
  EXPECT_THAT(kept_in(folder).comment, HasSubstr("has not found its place"));
  part.on_alignment(at_x(3.0), true);  // found
  EXPECT_TRUE(kept_in(folder).admitted);
  EXPECT_FALSE(kept_in(folder).was_admitted);
}

TEST(GatePart, does_not_admit_in_a_new_odom_epoch_what_it_admitted_in_the_one_before) {
  const ScratchFolder folder;
  {
    GatePart part(folder.path());
    part.on_alignment(at_x(3.0), true);
  }
  GatePart part(folder.path(), exporter::Opening::kContinue);  // the gate was started again
  part.on_alignment(std::nullopt, false);
  EXPECT_FALSE(kept_in(folder).admitted);
  EXPECT_TRUE(kept_in(folder).was_admitted);
  EXPECT_EQ(kept_in(folder).alignment.T_map_odom.p.x(), 3.0);
  EXPECT_THAT(kept_in(folder).comment, HasSubstr("odom began anew"));
  part.on_alignment(at_x(8.0, 1), false);
  part.close();
  EXPECT_EQ(kept_in(folder).alignment.odom_epoch, 1U);
  EXPECT_FALSE(kept_in(folder).admitted);
  EXPECT_TRUE(kept_in(folder).was_admitted);
  EXPECT_THAT(kept_in(folder).comment, HasSubstr("one before it was"));
}

/// A power failure leaves files of no bytes.
TEST(GatePart, begins_anew_and_says_so_where_what_it_goes_on_from_is_damaged) {
  const ScratchFolder folder;
  write_all(folder.file("alignment.yaml"), "");
  write_all(folder.file("fusion_gate.counts.yaml"), "fix.judged: [\n");
  GatePart part(folder.path(), exporter::Opening::kContinue);
  const Events events = part.take_events();
  ASSERT_EQ(events.size(), 2U);
  EXPECT_THAT(events[0].text, HasSubstr("fusion_gate.counts.yaml"));
  EXPECT_THAT(events[1].text, HasSubstr("alignment.yaml"));
  EXPECT_TRUE(part.take_events().empty());
  part.on_alignment(at_x(3.0), true);
  part.close();
  EXPECT_TRUE(kept_in(folder).admitted);
  EXPECT_FALSE(kept_in(folder).was_admitted);
}

TEST(GpsPart, begins_its_counts_anew_and_says_so_where_they_are_damaged) {
  const ScratchFolder folder;
  write_all(folder.file("gps_odometry.counts.yaml"), "fix.received: [\n");
  GpsPart part(folder.path(), exporter::Opening::kContinue);
  const Events events = part.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].severity, Severity::kWarning);
  EXPECT_THAT(events[0].text, HasSubstr("gps_odometry.counts.yaml"));
  part.keep_counts({});
  EXPECT_FALSE(exporter::read_counts(folder.file("gps_odometry.counts.yaml")).empty());
}

TEST(LogPart, begins_its_counts_anew_and_says_so_where_a_power_failure_emptied_them) {
  const ScratchFolder folder;
  write_all(folder.file("log.counts.yaml"), "");
  const Events events = LogPart(folder.path(), exporter::Opening::kContinue).take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_THAT(events[0].text, HasSubstr("log.counts.yaml: empty"));
}

TEST(StoredDatum, that_is_damaged_counts_for_none_with_a_warning_where_a_program_must_start) {
  const ScratchFolder folder;
  Events events;
  EXPECT_FALSE(stored_datum(folder.path(), events));
  EXPECT_TRUE(events.empty());
  write_all(folder.file("datum.yaml"), "");
  EXPECT_FALSE(stored_datum(folder.path(), events));
  EXPECT_THROW(read_stored_datum(folder.path()), std::runtime_error);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].severity, Severity::kWarning);
  EXPECT_THAT(events[0].text, HasSubstr("datum.yaml"));
  const Datum datum{43.0, -78.0, 100.0};
  exporter::write_datum(folder.file("datum.yaml"), datum);
  EXPECT_EQ(stored_datum(folder.path(), events).value().id(), datum.id());
  EXPECT_EQ(events.size(), 1U);
}

TEST(GatePart, writes_nothing_while_nobody_knows_an_alignment) {
  const ScratchFolder folder;
  GatePart part(folder.path());
  part.on_alignment(std::nullopt, false);
  part.on_alignment(Alignment{}, true);
  part.close();
  EXPECT_FALSE(std::filesystem::exists(folder.file("alignment.yaml")));
}

void receive(LogPart& part, Nanoseconds receive_ns, auto measurement, Nanoseconds stamp_ns) {
  measurement.stamp_ns = stamp_ns;
  recording::LogEntry entry;
  entry.receive_ns = receive_ns;
  entry.measurement = measurement;
  part.on_entry(entry);
}

/// The LiDAR's own clock is far ahead, as one on TAI is: its stamps say nothing of the arrival.
TEST(LogPart, writes_every_sweep_down_on_the_clock_of_the_imu) {
  const ScratchFolder folder;
  LogPart part(folder.path());
  EXPECT_FALSE(part.begin_ns());
  receive(part, 1000, PointCloudMessage{}, 37'077);  // before any IMU sample
  EXPECT_TRUE(exporter::read_sweeps(folder.file("sweeps.csv")).empty());
  receive(part, 1010, ImuSample{}, 500);
  receive(part, 1030, PointCloudMessage{}, 37'090);
  receive(part, 1040, ImuSample{}, 540);
  EXPECT_EQ(part.begin_ns(), 500);
  EXPECT_EQ(part.end_ns(), 540);
  const auto sweeps = exporter::read_sweeps(folder.file("sweeps.csv"));
  ASSERT_EQ(sweeps.size(), 2U);
  EXPECT_EQ(sweeps[0].stamp_ns, 37'077);
  EXPECT_EQ(sweeps[0].receive_ns, 1000);
  EXPECT_EQ(sweeps[0].arrival_ns, 490);
  EXPECT_EQ(sweeps[1].stamp_ns, 37'090);
  EXPECT_EQ(sweeps[1].receive_ns, 1030);
  EXPECT_EQ(sweeps[1].arrival_ns, 520);
}

/// A log whose stamps begin at zero, as simulators' do.
TEST(LogPart, knows_an_imu_sample_at_time_zero) {
  const ScratchFolder folder;
  LogPart part(folder.path());
  receive(part, 0, ImuSample{}, 0);
  receive(part, 30, PointCloudMessage{}, 10);
  EXPECT_EQ(part.begin_ns(), 0);
  const auto sweeps = exporter::read_sweeps(folder.file("sweeps.csv"));
  ASSERT_EQ(sweeps.size(), 1U);
  EXPECT_EQ(sweeps[0].arrival_ns, 30);
}

/// Has truth beside it.
class LogWithTruth final : public recording::LogReader {
 public:
  explicit LogWithTruth(std::string truth) : truth_(std::move(truth)) {}

  const recording::LogSummary& summary() const override { return summary_; }

  std::optional<recording::LogEntry> next() override { return std::nullopt; }

  double progress() const override { return 1.0; }

  std::optional<std::string> truth_file() const override { return truth_; }

 private:
  std::string truth_;
  recording::LogSummary summary_;
};

const std::string kHead = "# datum 43.0 -78.0 100.0\n";
const std::string kDayOne = "1.000000000 1 0 0 0 0 0 1\n2.000000000 2 0 0 0 0 0 1\n";
const std::string kDayTwo = "86401.500000000 5 0 0 0 0 0 1\n";

/// The second day's log has no IMU: its sweeps are on another clock than those of the first.
TEST(LogPart, leaves_out_sweeps_without_imu_of_a_session_that_goes_on_and_says_so) {
  const ScratchFolder folder;
  const LogWithTruth log("");
  const auto sweeps = [&] { return exporter::read_sweeps(folder.file("sweeps.csv")); };
  {
    LogPart part(folder.path());
    receive(part, 1000, PointCloudMessage{}, 990);
    part.close(log);
    EXPECT_TRUE(part.take_events().empty());
    ASSERT_EQ(sweeps().size(), 1U);
    EXPECT_EQ(sweeps()[0].arrival_ns, 1000);
  }
  LogPart part(folder.path(), exporter::Opening::kContinue);
  receive(part, 5000, PointCloudMessage{}, 4990);
  receive(part, 5100, PointCloudMessage{}, 5090);
  part.close(log);
  EXPECT_EQ(sweeps().size(), 1U);
  const Events events = part.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].severity, Severity::kWarning);
  EXPECT_THAT(events[0].text, AllOf(HasSubstr("its 2 sweeps"), HasSubstr("sweeps.csv")));
}

TEST(LogPart, appends_the_truth_of_a_later_day_to_that_of_the_session) {
  const ScratchFolder folder;
  const ScratchFolder logs;
  write_all(logs.file("one.tum"), kHead + kDayOne);
  write_all(logs.file("two.tum"), kHead + kDayTwo);
  LogPart(folder.path()).keep_truth(LogWithTruth(logs.file("one.tum")));
  LogPart resumed(folder.path(), exporter::Opening::kContinue);
  resumed.keep_truth(LogWithTruth(logs.file("two.tum")));
  resumed.keep_truth(LogWithTruth(logs.file("two.tum")));  // at the end once more
  EXPECT_TRUE(resumed.take_events().empty());
  const std::string whole = read_all(folder.file("truth.tum"));
  EXPECT_TRUE(whole.starts_with(kHead + kDayOne));
  const auto poses = exporter::read_trajectory(folder.file("truth.tum"));
  ASSERT_EQ(poses.size(), 3U);
  EXPECT_EQ(poses[2].stamp_ns, 86'401'500'000'000);
  EXPECT_EQ(poses[2].pose.p.x(), 5.0);
}

TEST(LogPart, appends_only_what_is_later_of_a_truth_with_blank_lines_and_indented_comments) {
  const ScratchFolder folder;
  const ScratchFolder logs;
  write_all(logs.file("one.tum"), kHead + kDayOne);
  write_all(logs.file("two.tum"), "  \n # a comment\n" + kDayOne + kDayTwo);
  LogPart(folder.path()).keep_truth(LogWithTruth(logs.file("one.tum")));
  LogPart resumed(folder.path(), exporter::Opening::kContinue);
  resumed.keep_truth(LogWithTruth(logs.file("two.tum")));
  EXPECT_TRUE(resumed.take_events().empty());
  EXPECT_EQ(exporter::read_trajectory(folder.file("truth.tum")).size(), 3U);
}

TEST(LogPart, leaves_out_a_truth_that_cannot_be_read_and_says_so) {
  const ScratchFolder folder;
  const ScratchFolder logs;
  write_all(logs.file("one.tum"), kHead + kDayOne);
  write_all(logs.file("two.tum"), kDayTwo + kDayTwo);  // one stamp twice
  LogPart(folder.path()).keep_truth(LogWithTruth(logs.file("one.tum")));
  LogPart resumed(folder.path(), exporter::Opening::kContinue);
  resumed.keep_truth(LogWithTruth(logs.file("two.tum")));
  const Events left_out = resumed.take_events();
  ASSERT_EQ(left_out.size(), 1U);
  EXPECT_EQ(left_out[0].severity, Severity::kWarning);
  EXPECT_THAT(left_out[0].text, HasSubstr("two.tum:2"));
  EXPECT_EQ(read_all(folder.file("truth.tum")), kHead + kDayOne);
}

TEST(LogPart, appends_no_truth_in_another_frame) {
  const ScratchFolder folder;
  const ScratchFolder logs;
  write_all(logs.file("one.tum"), kHead + kDayOne);
  write_all(logs.file("two.tum"), "# datum 43.1 -78.0 100.0\n" + kDayTwo);
  LogPart(folder.path()).keep_truth(LogWithTruth(logs.file("one.tum")));
  LogPart resumed(folder.path(), exporter::Opening::kContinue);
  resumed.keep_truth(LogWithTruth(logs.file("two.tum")));
  EXPECT_TRUE(resumed.take_events().empty());
  EXPECT_EQ(read_all(folder.file("truth.tum")), kHead + kDayOne);
}

}  // namespace
}  // namespace trigpoint::pipeline
