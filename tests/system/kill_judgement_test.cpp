// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Every check of kill_table and restart_test can fail: drives that are wrong in one way each.
#include "kill_judgement.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace trigpoint::tests {
namespace {

using namespace std::chrono_literals;

constexpr double kInterval_s = 0.1;
constexpr double kDrive_s = 60.0;
constexpr Nanoseconds kBegin_ns = 1'000 * kNanosecondsPerSecond;  ///< on the stamps' clock

Clock::time_point moment(double drive_s) {
  return Clock::time_point(1h) +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(drive_s));
}

Nanoseconds stamp_ns(double drive_s) {
  return kBegin_ns + from_seconds(drive_s);
}

std::vector<Word> words_between(double from_s, double to_s, const std::string& writer) {
  std::vector<Word> words;
  for (double at_s = from_s; at_s <= to_s; at_s += kInterval_s) {
    words.push_back({moment(at_s), stamp_ns(at_s), writer});
  }
  return words;
}

void append(std::vector<Word>& words, const std::vector<Word>& more) {
  words.insert(words.end(), more.begin(), more.end());
}

/// The mapper is killed at 20 s, started again at 20.2 s and heard from 21 s on.
constexpr double kBlow_s = 20.0;

Struck killed_mapper() {
  return {{kBlow_s, kMapper, Kind::kKill}, moment(kBlow_s), moment(20.2), true, {}};
}

Words good_words() {
  Words words{{kMapper, words_between(0.0, kBlow_s - 0.05, "first mapper")},
              {kGate, words_between(0.0, kDrive_s, "gate")},
              {kFilter, words_between(0.0, kDrive_s, "filter")}};
  append(words[kMapper], words_between(21.0, kDrive_s, "second mapper"));
  return words;
}

BlowResult judged(const Words& words, const Struck& struck = killed_mapper()) {
  return judge_blow(struck, words, stamp_ns(kDrive_s), {});
}

DriveResult good_drive() {
  DriveResult drive;
  drive.scans_played = 600;
  drive.scans_done = 588;
  drive.scans_listed = 10;
  return drive;
}

TEST(KillJudgement, of_a_mapper_that_is_back_after_a_second_holds) {
  const BlowResult result = judged(good_words());
  EXPECT_TRUE(held(result));
  EXPECT_NEAR(result.down_s, 1.0, 0.01);
  EXPECT_NEAR(result.pick_up_s, 0.8, 0.01);
  EXPECT_LT(result.others_gap_s, 0.2);
}

TEST(KillJudgement, blames_a_neighbour_that_falls_silent_for_good_within_the_window) {
  Words words = good_words();
  words[kGate] = words_between(0.0, 22.0, "gate");
  EXPECT_NEAR(judged(words).others_gap_s, 8.0, 0.2);
  EXPECT_FALSE(held(judged(words)));
}

TEST(KillJudgement, blames_a_neighbour_that_never_speaks_after_the_blow_or_never_did) {
  Words words = good_words();
  words[kGate] = words_between(0.0, kBlow_s - 3.0, "gate");
  EXPECT_NEAR(judged(words).others_gap_s, kWatched_s, 0.01);
  words.erase(kGate);
  EXPECT_NEAR(judged(words).others_gap_s, kWatched_s, 0.01);
}

TEST(KillJudgement, blames_nobody_for_silence_after_the_end_of_the_drive) {
  const double end_s = kBlow_s + 4.0;
  Words words = good_words();
  for (auto& [process, spoken] : words) {
    std::erase_if(spoken, [&](const Word& word) { return word.at > moment(end_s); });
  }
  EXPECT_LT(judge_blow(killed_mapper(), words, stamp_ns(end_s), {}).others_gap_s, 0.3);
}

TEST(KillJudgement, bounds_the_silence_since_the_stop_of_a_hang_not_only_since_the_restart) {
  Struck struck = killed_mapper();
  struck.blow.kind = Kind::kHang;
  EXPECT_TRUE(held(judged(good_words(), struck)));
  Words words = good_words();
  std::erase_if(words[kMapper], [](const Word& word) {
    return word.at > moment(kBlow_s) && word.at < moment(kBlow_s + 4.95);
  });
  struck.returned = moment(kBlow_s + 4.5);
  const BlowResult result = judged(words, struck);
  EXPECT_LT(result.pick_up_s, kPickUp_s);
  EXPECT_NEAR(result.down_s, 5.0, 0.11);
  EXPECT_FALSE(held(result));
}

TEST(KillJudgement, takes_no_late_word_of_the_predecessor_for_one_of_the_successor) {
  Words words = good_words();
  words[kMapper] = words_between(0.0, 20.6, "first mapper");
  EXPECT_FALSE(held(judged(words)));
  append(words[kMapper], words_between(21.0, kDrive_s, "second mapper"));
  EXPECT_NEAR(judged(words).pick_up_s, 0.8, 0.01);
}

TEST(KillJudgement, tells_the_largest_error_of_the_five_seconds_after_the_blow) {
  std::vector<evaluation::PosePair> pairs;
  for (double at_s = 0.0; at_s < kDrive_s; at_s += kInterval_s) {
    const double error_m = std::abs(at_s - (kBlow_s + 2.0)) < 0.05 ? 0.6
                           : at_s > kBlow_s + 6.0                  ? 0.9
                           : at_s < kBlow_s - 1.0                  ? 0.8
                                                                   : 0.01;
    evaluation::PosePair pair;
    pair.stamp_ns = stamp_ns(at_s);
    pair.estimate.p = Eigen::Vector3d(error_m, 0.0, 0.0);
    pair.reference.p = Eigen::Vector3d::Zero();
    pairs.push_back(pair);
  }
  const Words words = good_words();
  EXPECT_NEAR(
      judge_blow(killed_mapper(), words, stamp_ns(kDrive_s), pairs).worst_after_m, 0.6, 1e-9);
  EXPECT_TRUE(std::isnan(judged(words).worst_after_m));
}

TEST(KillJudgement, wants_the_missed_scans_listed_all_and_no_others) {
  EXPECT_TRUE(missed_scans_are_listed(good_drive()));
  DriveResult drive = good_drive();
  drive.scans_listed = 5;
  EXPECT_FALSE(missed_scans_are_listed(drive));
  drive.scans_listed = 400;
  EXPECT_FALSE(missed_scans_are_listed(drive));
}

TEST(KillJudgement, wants_scans_to_have_been_played) {
  DriveResult drive = good_drive();
  drive.scans_played = 0;
  drive.scans_listed = 0;
  EXPECT_FALSE(missed_scans_are_listed(drive));
}

TEST(KillJudgement, excuses_what_fused_lacks_by_the_time_that_the_gate_was_down) {
  BlowResult gate;
  gate.blow = {kBlow_s, kGate, Kind::kKill};
  gate.down_s = 0.6;
  BlowResult mapper;
  mapper.blow = {40.0, kMapper, Kind::kKill};
  mapper.others_gap_s = 1.0;
  BlowResult filter;
  filter.blow = {60.0, kFilter, Kind::kKill};
  filter.down_s = 0.7;
  EXPECT_NEAR(least_covered_s(100.0, {gate, mapper, filter}), 95.0 - 0.6 - 1.0, 1e-9);
}

TEST(KillJudgement, does_not_excuse_a_gate_that_never_came_back) {
  BlowResult gate;
  gate.blow = {kBlow_s, kGate, Kind::kKill};
  EXPECT_NEAR(least_covered_s(100.0, {gate}), 95.0 - kDownAfterKill_s, 1e-9);
}

}  // namespace
}  // namespace trigpoint::tests
