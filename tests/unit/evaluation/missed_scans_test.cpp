// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "missed_scans.hpp"

#include "trigpoint/evaluation/report.hpp"

#include "../export/scratch_folder.hpp"
#include "made_session.hpp"
#include "session_data.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

namespace trigpoint::evaluation {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using trigpoint::test::ScratchFolder;
using trigpoint::test::write_all;

constexpr Nanoseconds kStart_ns = 1'700'000'000'000'000'000;
constexpr Nanoseconds kInterval_ns = 100'000'000;
const ReportOptions kTextOnly{false, "gnuplot", {}};

/// Of sweep k: from its last point at 0.1 (k + 1) s to its arrival.
using Delay = std::function<Nanoseconds(int)>;
using Answered = std::function<bool(int)>;

struct Drive {
  std::vector<exporter::LoggedSweep> sweeps;
  std::vector<exporter::LoggedScan> scans;
};

Drive drive(
    int count,
    const Answered& answered,
    const Delay& delay = [](int) { return 3'000'000; }) {
  Drive made;
  for (int k = 0; k < count; ++k) {
    const Nanoseconds end_ns = kStart_ns + kInterval_ns * (k + 1);
    made.sweeps.push_back({end_ns - kInterval_ns, end_ns + delay(k), end_ns + delay(k)});
    if (answered(k)) {
      auto& scan = made.scans.emplace_back();
      scan.status.stamp_ns = end_ns;
      scan.status.scans_received = scan.status.scans_used = made.scans.size();
    }
  }
  return made;
}

std::vector<MissedScans> missed_in(const Drive& made, std::uint64_t refused = 0) {
  return find_unanswered_sweeps({made.sweeps, made.scans, refused, {}});
}

TEST(UnansweredSweeps, are_none_where_every_one_was_answered) {
  EXPECT_THAT(missed_in(drive(100, [](int) { return true; })), IsEmpty());
  EXPECT_THAT(missed_in({}), IsEmpty());
}

TEST(UnansweredSweeps, are_found_in_the_middle_between_the_scans_around_them) {
  const auto missed = missed_in(drive(100, [](int k) { return k < 40 || k >= 47; }));
  ASSERT_EQ(missed.size(), 1U);
  EXPECT_EQ(missed[0].scans, 7U);
  EXPECT_EQ(missed[0].after_ns, kStart_ns + 40 * kInterval_ns);
  EXPECT_EQ(missed[0].before_ns, kStart_ns + 48 * kInterval_ns);
  EXPECT_NEAR(missed[0].silence_s, 0.8, 1e-9);
}

TEST(UnansweredSweeps, are_found_at_the_beginning_and_at_the_end) {
  const auto missed = missed_in(drive(100, [](int k) { return k >= 20 && k < 60; }));
  ASSERT_EQ(missed.size(), 2U);
  EXPECT_FALSE(missed[0].after_ns);
  EXPECT_EQ(missed[0].scans, 20U);
  EXPECT_EQ(missed[1].scans, 40U);
  EXPECT_EQ(missed[1].after_ns, kStart_ns + 60 * kInterval_ns);
  EXPECT_FALSE(missed[1].before_ns);
  EXPECT_NEAR(missed[1].silence_s, 4.003, 1e-9);
}

TEST(UnansweredSweeps, are_all_when_no_scan_came) {
  const auto missed = missed_in(drive(100, [](int) { return false; }));
  ASSERT_EQ(missed.size(), 1U);
  EXPECT_EQ(missed[0].scans, 100U);
}

/// Arrivals that jitter by more than half an interval, and an IMU whose newest sample is older than
/// the sweep's last point.
TEST(UnansweredSweeps, are_counted_right_when_arrivals_jitter_or_are_early) {
  const auto answered = [](int k) { return k < 40 || k >= 47; };
  const auto count = [&](const Delay& delay) {
    std::uint64_t sum = 0;
    for (const MissedScans& gap : missed_in(drive(100, answered, delay))) {
      sum += gap.scans;
    }
    return sum;
  };
  EXPECT_EQ(count([](int k) { return Nanoseconds{10'000'000} + (k % 3) * 30'000'000; }), 7U);
  EXPECT_EQ(count([](int) { return Nanoseconds{-4'000'000}; }), 7U);
  EXPECT_EQ(count([](int) { return Nanoseconds{95'000'000}; }), 7U);
}

/// Half of those at the end were refused with a reason, and ten of the beginning.
TEST(UnansweredSweeps, are_not_those_that_were_refused_with_a_reason) {
  Drive made = drive(100, [](int k) { return k >= 10 && k < 60; });
  for (auto& scan : made.scans) {
    scan.status.scans_received += 10;
  }
  const auto missed = missed_in(made, 30);
  ASSERT_EQ(missed.size(), 1U);
  EXPECT_EQ(missed[0].scans, 20U);
  EXPECT_FALSE(missed[0].before_ns);
  EXPECT_THAT(missed_in(made, 50), IsEmpty());
}

/// A mapper that is behind has received more than it has used, and refused none.
TEST(UnansweredSweeps, are_not_explained_by_what_waits) {
  Drive made = drive(100, [](int k) { return k < 40 || k >= 47; });
  for (std::size_t i = 40; i < 60; ++i) {
    made.scans[i].status.scans_received += 12;
  }
  const auto missed = missed_in(made);
  ASSERT_EQ(missed.size(), 1U);
  EXPECT_EQ(missed[0].scans, 7U);
}

/// A fast LiDAR behind a slow driver: its sweeps arrive more than two intervals after their end.
TEST(UnansweredSweeps, are_none_when_every_sweep_comes_late_by_more_than_an_interval) {
  const auto all = [](int) { return true; };
  EXPECT_THAT(missed_in(drive(100, all, [](int) { return Nanoseconds{250'000'000}; })), IsEmpty());
  EXPECT_THAT(missed_in(drive(100, all, [](int) { return Nanoseconds{420'000'000}; })), IsEmpty());
}

/// A network that stalls for 0.9 s and then delivers ten sweeps at one moment.
TEST(UnansweredSweeps, are_not_those_that_came_in_a_burst) {
  const auto stalled = [](int k) {
    return Nanoseconds{3'000'000} + (k >= 60 && k < 69 ? (69 - k) * kInterval_ns : 0);
  };
  EXPECT_THAT(missed_in(drive(
                  100, [](int) { return true; }, stalled)),
              IsEmpty());
  const auto missed = missed_in(drive(
      100, [](int k) { return k < 40 || k >= 47; }, stalled));
  ASSERT_EQ(missed.size(), 1U);
  EXPECT_EQ(missed[0].scans, 7U);
}

/// Seconds from sweep k to the next one; also of the LiDAR's own stamps when there are none.
using Interval = std::function<double(int)>;

/// Every one answered, 3 ms after its last point.
Drive rhythm(int count, const Interval& interval_s, const Interval& by_stamps_s = {}) {
  Drive made;
  Nanoseconds end_ns = kStart_ns;
  Nanoseconds stamp_ns = kStart_ns - kInterval_ns;
  for (int k = 0; k < count; ++k) {
    made.sweeps.push_back({stamp_ns, end_ns + 3'000'000, end_ns + 3'000'000});
    auto& scan = made.scans.emplace_back();
    scan.status.stamp_ns = end_ns;
    scan.status.scans_received = scan.status.scans_used = made.scans.size();
    end_ns += from_seconds(interval_s(k));
    stamp_ns += from_seconds((by_stamps_s ? by_stamps_s : interval_s)(k));
  }
  return made;
}

/// Whether in two drives, in one, by loss, or from sweep to sweep.
TEST(UnansweredSweeps, are_none_where_the_interval_is_not_always_the_same) {
  const double day_s = 86'400.0;
  const auto rate_of_day = [&](int k) { return k == 2999 ? day_s : k < 3000 ? 0.05 : 0.1; };
  const Drive days = rhythm(7000, rate_of_day);
  EXPECT_THAT(missed_in(days), IsEmpty());
  const Breaks second_day{days.sweeps[3000].arrival_ns - kInterval_ns};
  EXPECT_THAT(find_unanswered_sweeps({days.sweeps, days.scans, 0, second_day}), IsEmpty());
  const Interval no_clock = [](int) { return 0.0; };
  EXPECT_THAT(missed_in(rhythm(7000, rate_of_day, no_clock)), IsEmpty());
  EXPECT_THAT(missed_in(rhythm(5000, [](int k) { return k < 3000 ? 0.1 : 0.05; })), IsEmpty());
  EXPECT_THAT(missed_in(rhythm(5000, [](int k) { return k < 2000 ? 0.05 : 0.1; })), IsEmpty());
  EXPECT_THAT(missed_in(rhythm(3000, [](int k) { return k * 55 % 100 < 55 ? 0.2 : 0.1; })),
              IsEmpty());
  const auto nine = [](int k) { return k % 9 == 8 ? 0.084 : 0.102; };
  EXPECT_THAT(missed_in(rhythm(6000, nine)), IsEmpty());
  EXPECT_THAT(missed_in(rhythm(
                  6000, [](int) { return 0.1; }, nine)),
              IsEmpty());
}

TEST(UnansweredSweeps, are_none_where_the_clock_of_the_lidar_is_set) {
  const auto even = [](int) { return 0.1; };
  for (const double step_s : {-3600.0, -0.35, 0.35, 2.0, 3600.0}) {
    EXPECT_THAT(missed_in(rhythm(2000, even, [&](int k) { return k == 999 ? 0.1 + step_s : 0.1; })),
                IsEmpty())
        << step_s;
  }
}

TEST(UnansweredSweeps, are_found_beside_a_burst_at_another_rate) {
  Drive made = rhythm(7000, [](int k) { return k < 4000 ? 0.1 : 0.05; });
  for (std::size_t k = 6000; k < 6030; ++k) {
    made.sweeps[k].arrival_ns = made.sweeps[6030].arrival_ns;
  }
  EXPECT_THAT(missed_in(made), IsEmpty());
  made.scans.erase(made.scans.begin() + 6010, made.scans.begin() + 6017);
  const auto missed = missed_in(made);
  ASSERT_EQ(missed.size(), 1U);
  EXPECT_EQ(missed[0].scans, 7U);
}

/// A scan with too few matches is refused and has a row: it explains no other one.
TEST(UnansweredSweeps, are_not_explained_by_a_refused_scan_that_has_a_row) {
  Drive made = drive(100, [](int k) { return k < 40 || k >= 47; });
  for (std::size_t i = 40; i < made.scans.size(); ++i) {
    made.scans[i].status.scans_used -= 1;
  }
  const auto missed = missed_in(made, 1);
  ASSERT_EQ(missed.size(), 1U);
  EXPECT_EQ(missed[0].scans, 7U);
}

TEST(UnansweredSweeps, of_two_days_are_not_what_lies_between_them) {
  Drive made = drive(50, [](int k) { return k < 48; });
  const Nanoseconds day_ns = 86'400 * kNanosecondsPerSecond;
  for (int k = 0; k < 50; ++k) {
    exporter::LoggedSweep sweep = made.sweeps[static_cast<std::size_t>(k)];
    sweep.arrival_ns += day_ns;
    made.sweeps.push_back(sweep);
    if (k >= 3) {
      auto& scan = made.scans.emplace_back();
      scan.status.stamp_ns = kStart_ns + kInterval_ns * (k + 1) + day_ns;
      scan.status.scans_received = scan.status.scans_used = made.scans.size();
    }
  }
  const auto missed = find_unanswered_sweeps({made.sweeps, made.scans, 0, {kStart_ns + day_ns}});
  ASSERT_EQ(missed.size(), 2U);
  EXPECT_EQ(missed[0].scans, 2U);
  EXPECT_FALSE(missed[0].before_ns);
  EXPECT_EQ(missed[1].scans, 3U);
  EXPECT_FALSE(missed[1].after_ns);
}

TEST(Restarts, count_the_scans_missed_by_the_usual_interval) {
  std::vector<exporter::LoggedScan> scans;
  for (const int tenth : {0, 1, 2, 3, 8, 9, 10, 12, 13}) {
    scans.emplace_back().status.stamp_ns = 1'000'000'000 + tenth * Nanoseconds{100'000'000};
  }
  const std::vector<MissedScans> missed = find_missed_scans(scans);
  ASSERT_EQ(missed.size(), 2U);
  EXPECT_EQ(missed[0].scans, 4U);
  EXPECT_EQ(missed[0].after_ns, 1'300'000'000);
  EXPECT_EQ(missed[0].before_ns, 1'800'000'000);
  EXPECT_EQ(missed[1].scans, 1U);
  EXPECT_TRUE(find_missed_scans({}).empty());
  EXPECT_EQ(find_missed_scans(scans, {1'800'000'000}).size(), 1U);  // another day begins
}

/// The made session with a mapper that answered no sweep after `last`.
void make_lost_end(const ScratchFolder& folder, int last) {
  test::make_session(folder.path());
  exporter::SweepLog sweeps(folder.file("sweeps.csv"));
  exporter::ScanLog scans(folder.file("scans.csv"));
  for (int k = 0; k <= test::kScans; ++k) {
    const Nanoseconds stamp_ns = kStart_ns + k * kInterval_ns;
    sweeps.append({stamp_ns - kInterval_ns, stamp_ns, stamp_ns + 1'000'000});
    if (k <= last) {
      LioStatus status;
      status.stamp_ns = stamp_ns;
      status.aligned = true;
      status.scans_received = status.scans_used = static_cast<std::uint64_t>(k) + 1;
      scans.append(status, 4000);
    }
  }
}

void write_restart(const ScratchFolder& folder, std::int64_t unix_s = 1'700'000'000) {
  write_all(folder.file("restarts.csv"),
            "unix_s,program,restarted,lived_s,what\n" + std::to_string(unix_s) +
                ",trigpoint_lio_mapper,1,23.1,\"was killed by signal 9 (Killed)\"\n");
}

/// Refused for `no_points`, as the mapper counted when it ended.
void write_refused(const ScratchFolder& folder, std::uint64_t used, std::uint64_t refused) {
  exporter::CountsWriter(folder.path(), "lio_mapper")
      .write({{"points.received", used + refused},
              {"points.used", used},
              {"points.refused.no_points", refused}});
}

/// And was started again.
ReportResult report_of_lost_end(const ScratchFolder& folder, int last) {
  make_lost_end(folder, last);
  write_restart(folder);
  return write_report(folder.path(), kTextOnly);
}

TEST(Report, fails_when_the_mapper_never_came_back) {
  const ScratchFolder folder;
  const ReportResult result = report_of_lost_end(folder, 400);
  EXPECT_THAT(result.failures,
              ElementsAre(AllOf(HasSubstr("800 of 1201 sweeps were never answered"),
                                HasSubstr("the last 80.0 s"))));
  EXPECT_THAT(result.text,
              AllOf(HasSubstr("## Failed"),
                    HasSubstr("Scans missed: 800 of the 1201 sweeps"),
                    HasSubstr("- 800 between 1700000040.000000000 and the last one at "
                              "1700000120.001000000 (80.00 s)")));
}

TEST(Report, lists_what_a_restart_at_the_end_costs_and_does_not_fail_for_it) {
  const ScratchFolder folder;
  const ReportResult result = report_of_lost_end(folder, test::kScans - 12);
  EXPECT_THAT(result.failures, IsEmpty());
  EXPECT_THAT(result.text, HasSubstr("Scans missed: 12 of the 1201 sweeps"));
}

/// The LiDAR gives empty clouds for the last 10 s, and one sweep is not counted.
TEST(Report, does_not_take_refused_sweeps_at_the_end_for_a_mapper_that_is_gone) {
  const ScratchFolder folder;
  make_lost_end(folder, test::kScans - 101);
  write_refused(folder, test::kScans - 100, 100);
  const ReportResult result = write_report(folder.path(), kTextOnly);
  EXPECT_THAT(result.failures, Not(Contains(HasSubstr("never answered"))));
  EXPECT_THAT(result.text, HasSubstr("Scans missed: 1 of the 1201 sweeps"));
}

/// Empty clouds from 60 s on; the mapper dies at 75 s, and what it had refused dies with it.
TEST(Report, does_not_fail_for_what_a_mapper_refused_that_died_when_the_next_one_came_back) {
  const ScratchFolder folder;
  make_lost_end(folder, 600);
  write_refused(folder, 601, 450);
  write_restart(folder);
  const ReportResult result = write_report(folder.path(), kTextOnly);
  EXPECT_THAT(result.failures, Not(Contains(HasSubstr("never answered"))));
  EXPECT_THAT(result.text, HasSubstr("Scans missed: 150 of the 1201 sweeps"));
}

/// It dies at 115 s: what the next one refuses is all that there is since.
TEST(Report,
     does_not_fail_for_a_mapper_that_refused_all_since_it_came_back_shortly_before_the_end) {
  const ScratchFolder folder;
  make_lost_end(folder, 600);
  write_refused(folder, 601, 45);
  write_restart(folder, 1'700'000'115);
  EXPECT_THAT(write_report(folder.path(), kTextOnly).failures,
              Not(Contains(HasSubstr("never answered"))));
}

/// Killed at 5 s and back at 8 s, behind by 30 s at the end, which it ends with an empty cloud; or
/// killed when it was behind by 20 s, and none but that cloud was answered by the next one.
TEST(Report, fails_for_a_backlog_at_the_end_also_when_one_sweep_of_it_was_refused) {
  for (const std::int64_t restart_s : {1'700'000'005, 1'700'000'110}) {
    const ScratchFolder folder;
    make_lost_end(folder, test::kScans - 300);
    write_refused(folder, test::kScans - 299, 1);
    write_restart(folder, restart_s);
    EXPECT_THAT(write_report(folder.path(), kTextOnly).failures,
                Contains(HasSubstr("299 of 1201 sweeps were never answered")));
  }
}

/// Every sweep of the first drive was answered, and of the second one, at 20 Hz, all but the newest
/// `missing`.
SessionData faster_on_last_day(int count, std::size_t missing, bool has_clock) {
  SessionData data;
  const auto rate = [](int k) { return k < 3000 ? 0.1 : k == 3000 ? 86'400.0 : 0.05; };
  const Interval none = [](int) { return 0.0; };
  Drive made = rhythm(count, rate, has_clock ? Interval(rate) : none);
  data.sweeps = std::move(made.sweeps);
  data.scans = std::move(made.scans);
  data.scans.resize(data.scans.size() - missing);
  data.has_scan_log = true;
  const Nanoseconds begin_ns = data.sweeps[3001].arrival_ns - kInterval_ns;
  data.run.emplace().begin_ns = begin_ns;
  data.run->before.emplace_back().begin_ns = kStart_ns;
  return data;
}

std::string lost_end_of(const SessionData& data) {
  return lost_end(data, missed_scans_of(data));
}

TEST(LostEnd, is_as_long_as_the_last_drive_took_for_it) {
  EXPECT_THAT(lost_end_of(faster_on_last_day(5000, 31, true)), IsEmpty());
  EXPECT_THAT(lost_end_of(faster_on_last_day(5000, 31, false)), IsEmpty());
  EXPECT_THAT(lost_end_of(faster_on_last_day(5000, 70, true)),
              HasSubstr("70 of 1999 sweeps were never answered"));
}

TEST(LostEnd, is_found_where_the_lidar_has_no_clock) {
  EXPECT_THAT(lost_end_of(faster_on_last_day(5000, 70, false)),
              HasSubstr("70 of 1999 sweeps were never answered"));
}

TEST(Report, fails_when_a_mapper_that_was_there_did_not_answer_at_the_end) {
  const ScratchFolder folder;
  make_lost_end(folder, 600);
  write_refused(folder, 601, 450);
  const ReportResult result = write_report(folder.path(), kTextOnly);
  EXPECT_THAT(result.failures,
              Contains(AllOf(HasSubstr("150 of 1201 sweeps were never answered"),
                             HasSubstr("15.0 s of the last 60.0 s"),
                             HasSubstr("it was there to the end"),
                             Not(HasSubstr("did not come back")))));
}

TEST(Report, lists_the_longest_stretches_of_missed_scans_and_counts_the_others) {
  std::vector<MissedScans> missed;
  for (std::uint64_t i = 0; i < 30; ++i) {
    MissedScans& gap = missed.emplace_back();
    gap.scans = i % 3 == 0 ? 5 : 2;
    gap.after_ns = kStart_ns + static_cast<Nanoseconds>(i) * kNanosecondsPerSecond;
    gap.before_ns = *gap.after_ns + kInterval_ns;
  }
  const std::string text = print_missed(SessionData{}, missed);
  EXPECT_THAT(text,
              AllOf(HasSubstr("Scans missed: 90"),
                    HasSubstr("- 5 between 1700000027"),
                    HasSubstr("- 2 between 1700000001"),
                    HasSubstr("- and 10 more stretches, none longer, with 20 together")));
  EXPECT_EQ(std::count(text.begin(), text.end(), '-'), 21);
}

TEST(Report, tells_missed_scans_also_without_a_restart) {
  const ScratchFolder folder;
  report_of_lost_end(folder, test::kScans - 12);
  std::filesystem::remove(folder.file("restarts.csv"));
  const std::string text = write_report(folder.path(), kTextOnly).text;
  EXPECT_THAT(text, AllOf(HasSubstr("## Scans missed"), Not(HasSubstr("## Restarts"))));
}

}  // namespace
}  // namespace trigpoint::evaluation
