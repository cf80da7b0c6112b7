// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "system_config.hpp"

#include "../export/scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::cli {
namespace {

using test::error_of;
using test::ScratchFolder;
using testing::AllOf;
using testing::HasSubstr;

TEST(SystemConfig, has_a_section_for_every_part) {
  const std::string text = print({});
  for (const char* section :
       {"robot:", "bus:", "gps_odometry:", "lio_mapper:", "fusion_gate:", "log:"}) {
    EXPECT_THAT(text, HasSubstr(std::string("\n") + section)) << section;
  }
}

TEST(SystemConfig, reads_back_what_it_prints) {
  const ScratchFolder folder;
  SystemConfig config;
  config.cores.robot.antenna_position_base_m = {0.1, -0.2, 1.5};
  config.cores.fusion_gate.mode = "lio";
  config.log.fix_rate_limit_hz = 1.0;
  config.log.elevation_correction_rad = -0.0035;
  test::write_all(folder.file("config.yaml"), print(config));
  SystemConfig read;
  load(read, {folder.file("config.yaml")});
  EXPECT_EQ(print(read), print(config));
  EXPECT_NE(print(read), print({}));
}

TEST(SystemConfig, takes_from_each_file_what_it_names_and_lets_later_files_win) {
  const ScratchFolder folder;
  test::write_all(folder.file("a.yaml"),
                  "log: {start_s: 3.0, duration_s: 10.0}\nfusion_gate: {mode: fusion}\n");
  test::write_all(folder.file("b.yaml"), "log: {duration_s: 20.0}\n");
  SystemConfig config;
  config.log.lead_in_s = 9.0;
  load(config, {folder.file("a.yaml"), folder.file("b.yaml")});
  EXPECT_EQ(config.log.start_s, 3.0);
  EXPECT_EQ(config.log.duration_s, 20.0);
  EXPECT_EQ(config.cores.fusion_gate.mode, "fusion");
  EXPECT_EQ(config.log.lead_in_s, 9.0) << "nobody named it";
  load(config, {folder.file("b.yaml"), folder.file("a.yaml")});
  EXPECT_EQ(config.log.duration_s, 10.0);
}

TEST(SystemConfig, refuses_a_wrong_key_or_value_with_file_line_and_key) {
  const ScratchFolder folder;
  SystemConfig config;
  test::write_all(folder.file("a.yaml"), "log:\n  durations_s: 10.0\n");
  EXPECT_THAT(error_of([&] { load(config, {folder.file("a.yaml")}); }),
              AllOf(HasSubstr("a.yaml:2"), HasSubstr("durations_s"), HasSubstr("duration_s")));
  test::write_all(folder.file("b.yaml"), "\nlog: {start_s: -1.0}\n");
  EXPECT_THAT(error_of([&] { load(config, {folder.file("b.yaml")}); }),
              AllOf(HasSubstr("b.yaml:2"), HasSubstr("start_s"), HasSubstr("-1")));
  EXPECT_THAT(error_of([&] { load(config, {folder.file("none.yaml")}); }), HasSubstr("none.yaml"));
}

TEST(SystemConfig, refuses_a_gate_whose_rows_the_mapper_would_find_too_old) {
  const ScratchFolder folder;
  SystemConfig config;
  test::write_all(folder.file("a.yaml"), "fusion_gate: {max_fix_age_s: 2.4}\n");
  EXPECT_THAT(error_of([&] { load(config, {folder.file("a.yaml")}); }),
              AllOf(HasSubstr("max_fix_age_s"), HasSubstr("history_s")));
  test::write_all(folder.file("b.yaml"), "lio_mapper: {rows: {history_s: 3.0}}\n");
  load(config, {folder.file("a.yaml"), folder.file("b.yaml")});
}

}  // namespace
}  // namespace trigpoint::cli
