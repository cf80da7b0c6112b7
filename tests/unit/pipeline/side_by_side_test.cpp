// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/session.hpp"
#include "trigpoint/pipeline/map_log.hpp"

#include "../export/scratch_folder.hpp"
#include "stored_log.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace trigpoint::pipeline {
namespace {

using test::read_all;
using test::ScratchFolder;

RunOfMany run_in(const ScratchFolder& folder, const std::string& mode) {
  RunOfMany run{stored_drive().configs, {}};
  run.configs.fusion_gate.mode = mode;
  run.options.session = folder.path();
  run.options.config_text = "robot: {}\n";
  run.options.mode = mode;
  return run;
}

void expect_the_same_files(const ScratchFolder& a, const ScratchFolder& b) {
  for (const char* name : {"fused.tum", "lio.tum", "gps.tum", "gate.csv", "fixes.csv"}) {
    const std::string bytes = read_all(a.file(name));
    EXPECT_FALSE(bytes.empty()) << name;
    EXPECT_TRUE(bytes == read_all(b.file(name))) << name;
  }
}

TEST(SideBySide, leaves_the_bytes_that_each_run_leaves_alone) {
  const ScratchFolder alone;
  const ScratchFolder other;
  const ScratchFolder beside;
  const RunOfMany smooth = run_in(alone, "smooth");
  StoredLog first(stored_drive().entries);
  map_log(first, smooth.configs, smooth.options);
  StoredLog second(stored_drive().entries);
  const auto results =
      map_log_side_by_side(second, {run_in(other, "literal"), run_in(beside, "smooth")}, {});
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(results[0].sweeps_used, results[1].sweeps_used);
  EXPECT_GT(results[0].sweeps_used, 0U);
  expect_the_same_files(alone, beside);
  EXPECT_FALSE(read_all(other.file("gate.csv")) == read_all(beside.file("gate.csv")));
}

TEST(SideBySide, gives_withheld_fixes_to_nobody_of_the_run_that_withholds_them) {
  const ScratchFolder fed;
  const ScratchFolder withheld;
  RunOfMany run = run_in(withheld, "smooth");
  run.options.withhold = recording::FixWithholding(5.0, 2.0);
  StoredLog log(stored_drive().entries);
  map_log_side_by_side(log, {run_in(fed, "smooth"), run}, {});
  std::size_t expected = 0;
  const auto fixes = exporter::read_fixes(withheld.file("fixes.csv"));
  for (const auto& logged : fixes) {
    const double into_s =
        std::fmod(to_seconds(logged.fix.stamp_ns - fixes.front().fix.stamp_ns), 5.0);
    EXPECT_EQ(logged.withheld, into_s >= 3.0) << into_s;
    expected += logged.withheld ? 1 : 0;
  }
  EXPECT_GT(expected, 5U);
  for (const auto& status : exporter::read_gate_log(withheld.file("gate.csv"))) {
    for (const auto& logged : fixes) {
      EXPECT_FALSE(logged.withheld && status.verdict.fix_stamp_ns == logged.fix.stamp_ns);
    }
  }
  for (const auto& logged : exporter::read_fixes(fed.file("fixes.csv"))) {
    EXPECT_FALSE(logged.withheld);
  }
}

TEST(SideBySide, stops_all_runs_when_it_is_asked_to) {
  const ScratchFolder a;
  const ScratchFolder b;
  StoredLog log(stored_drive().entries);
  int asked = 0;
  const auto results = map_log_side_by_side(
      log, {run_in(a, "lio"), run_in(b, "hard")}, {{}, {}, [&] { return ++asked == 200; }});
  for (const MapLogResult& result : results) {
    EXPECT_TRUE(result.stopped);
    EXPECT_LT(result.data_s, 3.0);
  }
  EXPECT_TRUE(exporter::read_run(a.file("run.yaml")).interrupted);
}

TEST(SideBySide, tells_a_log_that_breaks_off_in_every_run) {
  const ScratchFolder a;
  const ScratchFolder b;
  StoredLog log(stored_drive().entries, 300);
  for (const MapLogResult& result :
       map_log_side_by_side(log, {run_in(a, "lio"), run_in(b, "hard")}, {})) {
    EXPECT_EQ(result.log_error, "stored: torn off");
  }
}

TEST(FixWithholding, is_the_last_part_of_every_period_by_the_stamps_alone) {
  recording::FixWithholding withholding(10.0, 3.0);
  const Nanoseconds first_ns = 1'700'000'000'000'000'000;
  EXPECT_FALSE(withholding.withholds(first_ns));
  EXPECT_FALSE(withholding.withholds(first_ns + from_seconds(6.999)));
  EXPECT_TRUE(withholding.withholds(first_ns + from_seconds(7.0)));
  EXPECT_TRUE(withholding.withholds(first_ns + from_seconds(99.9)));
  EXPECT_FALSE(withholding.withholds(first_ns + from_seconds(100.0)));
  EXPECT_TRUE(withholding.withholds(first_ns - from_seconds(0.2)));  // late and older
  EXPECT_FALSE(withholding.withholds(first_ns - from_seconds(3.2)));
  recording::FixWithholding nothing;
  EXPECT_FALSE(nothing.withholds(first_ns + from_seconds(7.0)));
}

}  // namespace
}  // namespace trigpoint::pipeline
