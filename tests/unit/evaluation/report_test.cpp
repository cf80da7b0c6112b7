// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/report.hpp"

#include "trigpoint/export/map.hpp"
#include "trigpoint/export/session.hpp"

#include "../export/scratch_folder.hpp"
#include "made_session.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <sstream>

namespace trigpoint::evaluation {
namespace {

using test::make_session;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using trigpoint::test::error_of;
using trigpoint::test::read_all;
using trigpoint::test::ScratchFolder;
using trigpoint::test::write_all;

const ReportOptions kNoPictures{false, "gnuplot", {}};

/// The cells of the first table row below `heading` that begins with the given cells.
std::vector<std::string> row(const std::string& text,
                             const std::string& heading,
                             const std::vector<std::string>& first) {
  std::istringstream in(text.substr(std::min(text.size(), text.find(heading))));
  for (std::string line; std::getline(in, line);) {
    std::vector<std::string> cells;
    std::istringstream parts(line);
    for (std::string cell; std::getline(parts, cell, '|');) {
      const auto from = cell.find_first_not_of(' ');
      if (from != std::string::npos) {
        cells.push_back(cell.substr(from, cell.find_last_not_of(' ') - from + 1));
      }
    }
    if (cells.size() >= first.size() && std::equal(first.begin(), first.end(), cells.begin())) {
      return cells;
    }
  }
  return std::vector<std::string>(12, "no such row");
}

std::string three_digits(double value) {
  std::ostringstream text;
  text.precision(3);
  text << std::fixed << value;
  return text.str();
}

/// Fused is 3 cm off, and in the outage's 199 scans k = 1..199 it is off by 0.4 m * k / 200.
double fused_rmse_m() {
  const int poses = test::kScans - 100 + 1;
  double sum = 0.0;
  for (int k = 1; k <= 199; ++k) {
    sum += std::pow(test::kOutageEndError_m * k / 200.0, 2);
  }
  sum += (poses - 199) * std::pow(test::kFusedEastError_m, 2);
  return std::sqrt(sum / poses);
}

TEST(Report, of_a_made_session_contains_the_errors_it_was_made_with) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto result = write_report(folder.path(), kNoPictures);
  EXPECT_THAT(result.problems, IsEmpty());
  EXPECT_TRUE(result.complete);
  const auto fused = row(result.text, "Against truth.tum", {"fused.tum", "none"});
  EXPECT_EQ(fused[2], three_digits(fused_rmse_m()));
  EXPECT_EQ(fused[6], three_digits(fused_rmse_m()));  // all of it is east
  EXPECT_EQ(fused[7], "0.000");
  EXPECT_EQ(fused[9], "1101");
  EXPECT_EQ(fused[10], "100.0 %");
  EXPECT_EQ(fused[11], "91.7 %");  // of 2401 truth poses the 2203 from 9.9 s on
  EXPECT_THAT(read_all(result.report_file), HasSubstr(result.text));
}

TEST(Report, tells_gps_good_and_the_outage_apart) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto text = write_report(folder.path(), kNoPictures).text;
  const auto good = row(text, "With GPS and in its outages", {"fused.tum", "GPS good"});
  EXPECT_EQ(good[2], three_digits(test::kFusedEastError_m));
  const auto outage =
      row(text, "With GPS and in its outages", {"fused.tum", "outage from 1700000060.000000000"});
  EXPECT_EQ(outage[2], "20.0");
  EXPECT_EQ(outage[5], three_digits(test::kOutageEndError_m * 199.0 / 200.0));
}

TEST(Report, tells_how_many_steps_it_could_not_judge) {
  const ScratchFolder folder;
  make_session(folder.path());
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text, HasSubstr("of 1100 intervals."));
  const auto lio = exporter::read_trajectory(folder.file("lio.tum"));
  std::filesystem::remove(folder.file("lio.tum"));
  {
    exporter::TrajectoryWriter writer(folder.file("lio.tum"), "base_link in odom");
    for (std::size_t i = 0; i < lio.size(); ++i) {
      if (i < 500 || i >= 510) {  // a second without scans
        writer.append(lio[i].stamp_ns, lio[i].pose);
      }
    }
  }
  EXPECT_THAT(
      write_report(folder.path(), kNoPictures).text,
      HasSubstr("of 1089 intervals; 11 more are not judged, since lio.tum has no pose near them."));
}

TEST(Report, scores_lio_aligned_since_it_lives_in_odom) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto text = write_report(folder.path(), kNoPictures).text;
  const auto aligned = row(text, "Against truth.tum", {"lio.tum", "yaw + translation"});
  EXPECT_EQ(aligned[6], "0.000");
  // z drifts by 1.2 m linearly; after the mean is taken off its rms is 1.2 / sqrt(12).
  EXPECT_NEAR(std::stod(aligned[8]), 1.2 / std::sqrt(12.0), 0.001);
}

TEST(Report, scores_the_antenna_against_withheld_fixes_with_the_lever_arm) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto text = write_report(folder.path(), kNoPictures).text;
  const auto fused = row(text, "Against withheld fixes", {"fused.tum", "none"});
  // Withheld fixes lie outside the outage, where fused is 3 cm off.
  EXPECT_EQ(fused[2], three_digits(test::kFusedEastError_m));
  ReportOptions no_lever = kNoPictures;
  no_lever.antenna_position_base_m = Eigen::Vector3d::Zero();
  const auto without = row(
      write_report(folder.path(), no_lever).text, "Against withheld fixes", {"fused.tum", "none"});
  EXPECT_NEAR(std::stod(without[2]), std::hypot(0.5, 0.2, 1.5), 0.04);
}

TEST(Report, scores_against_fixes_on_the_ellipsoid_when_they_came_above_the_sea) {
  const ScratchFolder folder;
  make_session(folder.path());
  write_all(folder.file("config.yaml"),
            "robot:\n  antenna_position_base_m: [-0.5, 0.2, 1.5]\n  geoid_undulation_m: 40.0\n");
  const auto text = write_report(folder.path(), kNoPictures).text;
  const auto fused = row(text, "Against withheld fixes", {"fused.tum", "none"});
  EXPECT_NEAR(std::stod(fused[2]), 40.0, 0.01) << "of fixes that were above the ellipsoid already";
}

TEST(Report, says_that_scoring_on_the_fixes_that_were_used_is_circular) {
  const ScratchFolder folder;
  make_session(folder.path(), false);
  auto fixes = read_all(folder.file("fixes.csv"));
  for (auto at = fixes.find(",1\n"); at != std::string::npos; at = fixes.find(",1\n")) {
    fixes.replace(at, 3, ",0\n");
  }
  write_all(folder.file("fixes.csv"), fixes);
  const auto text = write_report(folder.path(), kNoPictures).text;
  EXPECT_THAT(text, HasSubstr("all fixes (circular)"));
  EXPECT_THAT(text, Not(HasSubstr("Against truth")));
}

TEST(Report, tells_scan_times_by_nearest_rank) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto times = row(write_report(folder.path(), kNoPictures).text, "## Times", {"1201"});
  EXPECT_EQ(times[1], "50.00");
  EXPECT_EQ(times[2], "99.00");
  EXPECT_EQ(times[3], "100.00");
}

TEST(Report, fails_with_the_reason_when_no_fix_was_used) {
  const ScratchFolder folder;
  make_session(folder.path());
  auto gate = read_all(folder.file("gate.csv"));
  const std::string used = ",81,72,used:72;stale:9,";
  ASSERT_THAT(gate, HasSubstr(used));
  for (auto at = gate.find(used); at != std::string::npos; at = gate.find(used)) {
    gate.replace(at, used.size(), ",81,0,off_level:70;stale:11,");
  }
  write_all(folder.file("gate.csv"), gate);
  EXPECT_THAT(write_report(folder.path(), kNoPictures).failures,
              testing::Contains(HasSubstr("None of 81 fixes was used, most often because: "
                                          "off_level (70)")));
}

TEST(Report, tells_the_gates_shares_of_time_per_axis) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto text = write_report(folder.path(), kNoPictures).text;
  // East: sigma 0.05 + 0.6 (t - 60) is above 0.5 from 60.8 (first row) to 80: 19.2 of 120 s.
  const auto east = row(text, "Share of time", {"east"});
  EXPECT_EQ(east[3], "16.0 %");
  EXPECT_EQ(east[5], "8.3 %");  // not aligned for 10 s
  EXPECT_THAT(text, AllOf(HasSubstr("| stale "), HasSubstr("Fixes seen 81, used 72")));
}

TEST(Report, prints_the_alignments_sigma_also_when_it_is_not_admitted) {
  const ScratchFolder folder;
  make_session(folder.path());
  auto record = exporter::read_alignment(folder.file("alignment.yaml"));
  record.admitted = false;
  record.comment = "yaw sigma too large";
  exporter::write_alignment(folder.file("alignment.yaml"), record);
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text,
              AllOf(HasSubstr("Not admitted"),
                    HasSubstr("yaw sigma too large"),
                    HasSubstr("yaw 0.115 deg, east 0.050 m, north 0.040 m, up 0.100 m")));
}

TEST(Report, tells_how_thick_the_maps_facades_are) {
  const ScratchFolder folder;
  make_session(folder.path());
  // The made walls have no noise; that their road bends is less than 1 cm in a cell.
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text,
              testing::ContainsRegex("## Map\n\n[^#]*Thickness of facades [^:]*: half[^:]*: median "
                                     "0.00[0-9] m, 90th percentile 0.0[0-9]+ m, [0-9]+ planes"));
  exporter::write_pcd(folder.file("map.pcd"), {{1.0F, 2.0F, 3.0F, 0.0F}});
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text,
              HasSubstr("there is no upright plane to measure"));
}

TEST(Report, says_that_all_messages_were_used) {
  const ScratchFolder folder;
  make_session(folder.path());
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text, HasSubstr("\nALL USED"));
}

TEST(Report, names_every_loss_of_messages) {
  const ScratchFolder folder;
  make_session(folder.path());
  exporter::CountsWriter(folder.path(), "lio_mapper")
      .write({{"points.received", 1199},
              {"points.used", 1195},
              {"points.refused.no_imu", 3},
              {"imu.received", 24000}});
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text,
              AllOf(HasSubstr("NOT ALL ACCOUNTED FOR"),
                    HasSubstr("lio_mapper received 1199 of 1201 points messages"),
                    HasSubstr("lio_mapper used 1195 of 1199 points messages (refused: no_imu 3)"),
                    HasSubstr("1195 of 1199 points messages and refused 3: 1 without a counted "
                              "reason")));
}

TEST(Report, tells_refusals_with_a_reason_from_losses) {
  const ScratchFolder folder;
  make_session(folder.path());
  exporter::CountsWriter(folder.path(), "lio_mapper")
      .write({{"points.received", 1201},
              {"points.used", 1198},
              {"points.refused.no_imu", 3},
              {"imu.received", 24000}});
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text,
              AllOf(HasSubstr("\nALL ACCOUNTED FOR"),
                    HasSubstr("lio_mapper used 1198 of 1201 points messages (refused: no_imu 3)"),
                    testing::Not(HasSubstr("NOT ALL"))));
}

TEST(Report, goes_on_with_the_rest_when_a_file_is_damaged_or_missing) {
  const ScratchFolder folder;
  make_session(folder.path());
  write_all(folder.file("gate.csv"), "nonsense\n");
  std::filesystem::remove(folder.file("gps.tum"));
  const auto result = write_report(folder.path(), kNoPictures);
  EXPECT_FALSE(result.complete);
  EXPECT_THAT(result.problems,
              testing::UnorderedElementsAre(HasSubstr("gate.csv:1"), HasSubstr("no gps.tum")));
  EXPECT_THAT(result.text, AllOf(HasSubstr("gate.csv:1"), HasSubstr("| fused.tum")));
}

TEST(Report, begins_with_what_failed_before_it) {
  const ScratchFolder folder;
  make_session(folder.path());
  ReportOptions options = kNoPictures;
  options.failures = {"The map was not rendered: too little disk."};
  const auto result = write_report(folder.path(), options);
  EXPECT_THAT(result.failures, testing::ElementsAre(options.failures.front()));
  EXPECT_THAT(result.text, HasSubstr(options.failures.front()));
}

TEST(Report, of_a_session_without_results_is_written_and_incomplete) {
  const ScratchFolder folder;
  write_all(folder.file("config.yaml"), "robot:\n  antenna_position_base_m: [0, 0, 0]\n");
  const auto result = write_report(folder.path());
  EXPECT_FALSE(result.complete);
  EXPECT_TRUE(std::filesystem::exists(result.report_file));
  EXPECT_THAT(result.text, HasSubstr("nothing to measure against"));
  EXPECT_THAT(result.problems, Each(Not(HasSubstr("gnuplot"))));
  EXPECT_FALSE(std::filesystem::exists(folder.file("uncertainty.png")));
}

TEST(Report, refuses_a_folder_that_is_no_session_and_writes_nothing_into_it) {
  const ScratchFolder folder;
  write_all(folder.file("letter.txt"), "dear");
  EXPECT_THAT(error_of([&] { write_report(folder.path()); }), HasSubstr("is not a session"));
  EXPECT_FALSE(std::filesystem::exists(folder.file("report.md")));
  EXPECT_FALSE(std::filesystem::exists(folder.file("plots")));
  EXPECT_THAT(error_of([] { write_report("/nowhere"); }), HasSubstr("/nowhere"));
}

TEST(Report, takes_a_program_that_left_no_counts_for_a_loss) {
  for (const char* program : {"lio_mapper", "fusion_gate", "gps_odometry"}) {
    const ScratchFolder folder;
    make_session(folder.path());
    std::filesystem::remove(folder.file(std::string(program) + ".counts.yaml"));
    const auto result = write_report(folder.path(), kNoPictures);
    const std::string sentence =
        "no counts of " + std::string(program) + ": it ended without closing its part";
    EXPECT_THAT(result.text, AllOf(HasSubstr("\nNOT ALL ACCOUNTED FOR"), HasSubstr(sentence)));
    EXPECT_THAT(result.failures, testing::ElementsAre(HasSubstr(sentence)));
  }
}

TEST(Report, knows_from_its_log_alone_that_a_program_ran) {
  const ScratchFolder folder;
  make_session(folder.path());
  for (const char* name : {"lio_mapper.counts.yaml", "lio.tum", "scans.csv"}) {
    std::filesystem::remove(folder.file(name));
  }
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text, HasSubstr("\nALL USED"));
  std::filesystem::create_directories(folder.file("logs"));
  write_all(folder.file("logs/trigpoint_lio_mapper.log"), "ready\n");
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text, HasSubstr("no counts of lio_mapper"));
}

TEST(Report, takes_the_death_of_the_player_for_a_loss) {
  const ScratchFolder folder;
  make_session(folder.path());
  std::filesystem::remove(folder.file("player.counts.yaml"));
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text,
              AllOf(HasSubstr("\nNOT ALL ACCOUNTED FOR"), HasSubstr("no counts of the log")));
}

TEST(Report, keeps_notes_on_used_fixes_and_refused_imu_samples_out_of_the_fixes_balance) {
  const ScratchFolder folder;
  make_session(folder.path());
  exporter::CountsWriter(folder.path(), "gps_odometry")
      .write({{"fix.received", 81},
              {"fix.used", 80},
              {"fix.refused.gate", 1},
              {"fix.note.used_with_default_covariance", 80},
              {"fix.note.recovered", 1},
              {"imu.received", 24000},
              {"imu.refused.imu_not_finite", 96}});
  const auto result = write_report(folder.path(), kNoPictures);
  EXPECT_THAT(result.failures, IsEmpty());
  EXPECT_THAT(result.text,
              AllOf(HasSubstr("\nALL ACCOUNTED FOR"),
                    HasSubstr("gps_odometry used 80 of 81 fix messages (refused: gate 1)"),
                    HasSubstr("gps_odometry refused 96 of 24000 imu messages (imu_not_finite 96)"),
                    HasSubstr("recovered 1, used_with_default_covariance 80"),
                    Not(HasSubstr("without a counted reason"))));
}

TEST(Report, takes_a_fix_without_a_verdict_of_the_gate_for_a_loss) {
  const ScratchFolder folder;
  make_session(folder.path());
  exporter::CountsWriter(folder.path(), "fusion_gate")
      .write({{"fix.judged", 81}, {"fix.used", 78}, {"fix.verdict.used", 78}});
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text,
              AllOf(HasSubstr("\nNOT ALL ACCOUNTED FOR"),
                    HasSubstr("fusion_gate gave 78 verdicts on 81 fix messages")));
}

TEST(Report, says_that_the_user_interrupted_the_run_and_takes_that_for_no_failure) {
  const ScratchFolder folder;
  make_session(folder.path());
  auto run = exporter::read_run(folder.file("run.yaml"));
  run.interrupted = true;
  exporter::write_run(folder.file("run.yaml"), run);
  exporter::CountsWriter(folder.path(), "lio_mapper")
      .write({{"points.received", 1200}, {"points.used", 1200}, {"imu.received", 24000}});
  const auto result = write_report(folder.path(), kNoPictures);
  EXPECT_THAT(result.failures, IsEmpty());
  EXPECT_THAT(result.text,
              AllOf(HasSubstr("**The run was interrupted by the user**"),
                    HasSubstr("NOT ALL ACCOUNTED FOR, because the run was interrupted")));
}

TEST(Report,
     lists_restarts_and_the_scans_missed_meanwhile_and_takes_what_they_cost_for_no_failure) {
  const ScratchFolder folder;
  make_session(folder.path());
  exporter::CountsWriter(folder.path(), "lio_mapper")
      .write({{"points.received", 1200}, {"points.used", 1200}, {"imu.received", 24000}});
  ASSERT_THAT(write_report(folder.path(), kNoPictures).failures, Not(IsEmpty()));
  write_all(folder.file("restarts.csv"),
            "unix_s,program,restarted,lived_s,what\n"
            "1700000000,trigpoint_lio_mapper,1,23.1,\"was killed by signal 9 (Killed)\"\n"
            "1700000050,trigpoint_fusion_gate,0,0.5,\"ended with code 1, again\"\n");
  const auto result = write_report(folder.path(), kNoPictures);
  EXPECT_THAT(result.failures, IsEmpty());
  EXPECT_THAT(result.text,
              AllOf(HasSubstr("## Restarts"),
                    HasSubstr("was killed by signal 9 (Killed)"),
                    HasSubstr("ended with code 1, again"),
                    HasSubstr("given up"),
                    HasSubstr("Scans missed: 0, by their usual interval"),
                    HasSubstr("NOT ALL ACCOUNTED FOR, because processes were down")));
  exporter::CountsWriter(folder.path(), "lio_mapper")
      .write({{"points.received", 1200}, {"points.used", 1200}, {"imu.received", 99'000}});
  EXPECT_THAT(write_report(folder.path(), kNoPictures).failures,
              Contains(HasSubstr("More came than the drive published: lio_mapper received 99000")));
  write_all(folder.file("restarts.csv"), "unix_s,program,restarted,lived_s,what\nnonsense\n");
  EXPECT_THAT(write_report(folder.path(), kNoPictures).problems,
              Contains(HasSubstr("restarts.csv:2")));
}

TEST(Report, fails_without_an_admitted_alignment_but_in_mode_lio) {
  const ScratchFolder folder;
  make_session(folder.path());
  auto record = exporter::read_alignment(folder.file("alignment.yaml"));
  record.admitted = false;
  exporter::write_alignment(folder.file("alignment.yaml"), record);
  const auto refused = write_report(folder.path(), kNoPictures);
  EXPECT_THAT(refused.failures, testing::ElementsAre(HasSubstr("No alignment")));
  EXPECT_THAT(refused.text, AllOf(HasSubstr("## Failed"), HasSubstr("**not admitted**")));
  auto run = exporter::read_run(folder.file("run.yaml"));
  run.mode = "lio";
  exporter::write_run(folder.file("run.yaml"), run);
  EXPECT_THAT(write_report(folder.path(), kNoPictures).failures, IsEmpty());
}

TEST(Report, of_mode_lio_without_fixes_misses_no_datum) {
  const ScratchFolder folder;
  make_session(folder.path());
  std::filesystem::remove(folder.file("datum.yaml"));
  const auto fixes = read_all(folder.file("fixes.csv"));
  write_all(folder.file("fixes.csv"), fixes.substr(0, fixes.find('\n') + 1));
  EXPECT_THAT(write_report(folder.path(), kNoPictures).problems, Contains(HasSubstr("no datum")));
  auto run = exporter::read_run(folder.file("run.yaml"));
  run.mode = "lio";
  exporter::write_run(folder.file("run.yaml"), run);
  EXPECT_THAT(write_report(folder.path(), kNoPictures).problems, IsEmpty());
}

TEST(Report, fails_when_nothing_was_published_in_map) {
  const ScratchFolder folder;
  make_session(folder.path());
  write_all(folder.file("fused.tum"), "# nothing\n");
  EXPECT_THAT(write_report(folder.path(), kNoPictures).failures,
              testing::ElementsAre(HasSubstr("fused.tum is empty")));
}

TEST(Report, does_not_score_against_truth_at_another_datum_and_says_why) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto truth = read_all(folder.file("truth.tum"));
  write_all(folder.file("truth.tum"), "# datum 48.980000000 8.390000000 116.0000  # lat\n" + truth);
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text, HasSubstr("### Against truth.tum"));
  write_all(folder.file("truth.tum"), "# datum 48.981000000 8.390000000 116.0000  # lat\n" + truth);
  // A thousandth of a degree of latitude is 111.2 m there.
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text,
              AllOf(Not(HasSubstr("### Against truth.tum")),
                    HasSubstr("truth.tum is in map at datum 48.981000000"),
                    HasSubstr("112 m away: not scored")));
}

TEST(Report, tells_that_too_few_good_fixes_came_for_a_datum) {
  const ScratchFolder folder;
  make_session(folder.path());
  std::filesystem::remove(folder.file("datum.yaml"));
  exporter::GpsStatusLog statuses(folder.file("gps_status.csv"));
  GpsStatus status;
  status.stamp_ns = 1'700'000'000'000'000'000;
  status.fixes_accepted = 4;
  statuses.append(status);
  EXPECT_THAT(write_report(folder.path(), kNoPictures).problems,
              testing::ElementsAre(HasSubstr("fewer than 10 good fixes (the GPS filter accepted 4 "
                                             "of 82)")));
}

TEST(Report, takes_the_maps_frame_from_the_map) {
  const ScratchFolder folder;
  make_session(folder.path());
  std::filesystem::remove(folder.file("alignment.yaml"));
  const auto pcd = read_all(folder.file("map.pcd"));
  const auto version = pcd.find("VERSION");
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text, HasSubstr("Its frame is odom"));
  write_all(folder.file("map.pcd"), pcd.substr(0, version) + "# frame map\n" + pcd.substr(version));
  EXPECT_THAT(write_report(folder.path(), kNoPictures).text, HasSubstr("Its frame is map, by the"));
}

TEST(Report, is_written_without_pictures_when_gnuplot_is_missing) {
  const ScratchFolder folder;
  make_session(folder.path());
  ReportOptions options;
  options.gnuplot = "gnuplot-that-does-not-exist";
  const auto result = write_report(folder.path(), options);
  EXPECT_THAT(result.pictures, IsEmpty());
  EXPECT_THAT(result.problems, Each(HasSubstr("gnuplot-nox")));
  EXPECT_FALSE(result.complete);
  EXPECT_THAT(read_all(result.report_file), HasSubstr("| fused.tum"));
}

class Pictures : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("gnuplot --version > /dev/null 2>&1") != 0) {
      GTEST_SKIP() << "gnuplot is not installed: pictures are not tested";
    }
  }
};

/// Width and height of a PNG (big-endian words of its first chunk).
std::pair<unsigned, unsigned> png_size(const std::string& file) {
  const auto bytes = read_all(file);
  if (bytes.size() < 24 || bytes.substr(0, 8) != "\x89PNG\r\n\x1a\n") {
    return {0, 0};
  }
  const auto word = [&](std::size_t at) {
    unsigned value = 0;
    for (std::size_t i = at; i < at + 4; ++i) {
      value = value << 8U | static_cast<unsigned char>(bytes[i]);
    }
    return value;
  };
  return {word(16), word(20)};
}

TEST_F(Pictures, are_pngs_of_a_sensible_size_that_their_scripts_draw_anew) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto result = write_report(folder.path());
  EXPECT_THAT(result.problems, IsEmpty());
  ASSERT_EQ(result.pictures.size(), 3U);
  for (const auto& picture : result.pictures) {
    const auto [width, height] = png_size(picture);
    EXPECT_EQ(width, 1300U) << picture;
    EXPECT_GE(height, 400U) << picture;
    EXPECT_GT(std::filesystem::file_size(picture), 10'000U) << picture;
  }
  EXPECT_THAT(read_all(folder.file("report.md")), HasSubstr("![trajectories.png]"));
  EXPECT_TRUE(std::filesystem::exists(folder.file("plots/uncertainty.gp")));
  EXPECT_FALSE(std::filesystem::exists(folder.file("plots/uncertainty.log")));  // no complaints

  const auto before = read_all(folder.file("scan_times.png"));
  std::filesystem::remove(folder.file("scan_times.png"));
  const auto again = "cd '" + folder.path() + "/plots' && gnuplot scan_times.gp";
  ASSERT_EQ(std::system(again.c_str()), 0);
  EXPECT_EQ(before, read_all(folder.file("scan_times.png")));
}

TEST_F(Pictures, of_a_session_without_truth_map_and_datum_are_still_drawn) {
  const ScratchFolder folder;
  make_session(folder.path(), false);
  std::filesystem::remove(folder.file("map.pcd"));
  std::filesystem::remove(folder.file("datum.yaml"));
  std::filesystem::remove(folder.file("gps_status.csv"));
  EXPECT_EQ(write_report(folder.path()).pictures.size(), 3U);
}

TEST(Report, does_not_leave_an_old_picture_where_none_can_be_drawn) {
  const ScratchFolder folder;
  make_session(folder.path());
  write_all(folder.file("scan_times.png"), "old");
  std::filesystem::remove(folder.file("scans.csv"));
  ReportOptions options;
  options.gnuplot = "false";  // draws nothing
  const auto result = write_report(folder.path(), options);
  EXPECT_THAT(result.problems, testing::Contains(HasSubstr("no scan to draw")));
  EXPECT_THAT(result.problems, testing::Contains(HasSubstr("gnuplot failed with exit code 1")));
  EXPECT_FALSE(std::filesystem::exists(folder.file("scan_times.png")));
}

}  // namespace
}  // namespace trigpoint::evaluation
