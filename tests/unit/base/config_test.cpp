// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"

#include "trigpoint/base/robot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

namespace trigpoint {
namespace {

using ::testing::HasSubstr;

struct Sample {
  double gain{2.5};
  std::int64_t count{3};
  bool on{true};
  std::string name{"abc"};
  std::string mode{"hard"};
  Eigen::Vector3d arm_m{1.0, 2.0, 3.0};
  std::vector<std::string> topics{"a", "b"};
  double inner_s{0.1};
};

void describe(Sample& s, ConfigFields& fields) {
  fields.section("sample", "for the tests", [&s](ConfigFields& f) {
    f.number("gain", s.gain, "a gain", kPositive);
    f.integer("count", s.count, "a count", {1, 10});
    f.flag("on", s.on, "a switch");
    f.text("name", s.name, "a name");
    f.choice("mode", s.mode, "a mode", {"hard", "smooth"});
    f.vector3("arm_m", s.arm_m, "an arm");
    f.texts("topics", s.topics, "a list");
    f.section("inner", "below", [&s](ConfigFields& g) {
      g.number("inner_s", s.inner_s, "time", {0.0, 1.0});
    });
  });
}

std::function<void(ConfigFields&)> document(Sample& s) {
  return [&s](ConfigFields& fields) { describe(s, fields); };
}

std::string error_of(const std::string& yaml) {
  Sample s;
  try {
    load_config_text(yaml, "file.yaml", document(s));
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Config, what_the_text_names_is_read_and_the_rest_keeps_its_default) {
  Sample s;
  load_config_text(
      "sample:\n  gain: 4\n  arm_m: [7, 8.5, 9]\n  topics: [x]\n  inner: {inner_s: 0.5}\n",
      "t",
      document(s));
  EXPECT_EQ(s.gain, 4.0);
  EXPECT_EQ(s.arm_m, Eigen::Vector3d(7.0, 8.5, 9.0));
  EXPECT_EQ(s.topics, std::vector<std::string>{"x"});
  EXPECT_EQ(s.inner_s, 0.5);
  EXPECT_EQ(s.count, 3);
}

TEST(Config, a_mistyped_key_is_refused_with_file_line_and_the_nearest_key) {
  const std::string error = error_of("sample:\n  on: true\n  gian: 4\n");
  EXPECT_THAT(error,
              HasSubstr("file.yaml:3: sample.gian is not a known key; did you mean 'gain'?"));
}

TEST(Config, an_unknown_section_is_refused) {
  EXPECT_THAT(error_of("sampel: {}\n"), HasSubstr("did you mean 'sample'?"));
}

TEST(Config, a_value_out_of_its_bounds_is_refused_with_the_rule) {
  EXPECT_THAT(error_of("sample: {gain: 0}\n"), HasSubstr("must be more than 0; is 0"));
  EXPECT_THAT(error_of("sample: {count: 11}\n"), HasSubstr("must be between 1 and 10; is 11"));
  EXPECT_THAT(error_of("sample: {gain: .nan}\n"), HasSubstr("must be finite"));
}

TEST(Config, a_wrong_type_is_refused) {
  EXPECT_THAT(error_of("sample: {gain: fast}\n"), HasSubstr("must be a number; is 'fast'"));
  EXPECT_THAT(error_of("sample: {arm_m: [1, 2]}\n"), HasSubstr("must be three numbers"));
  EXPECT_THAT(error_of("sample: {mode: soft}\n"),
              HasSubstr("must be one of hard, smooth; is 'soft'"));
  EXPECT_THAT(error_of("sample: 3\n"), HasSubstr("sample must be a mapping"));
  EXPECT_THAT(error_of("a: [\n"), HasSubstr("is not YAML"));
}

TEST(Config, the_print_reads_back_as_the_same_values) {
  Sample changed;
  changed.gain = 0.1 + 0.2;
  changed.count = 9;
  changed.on = false;
  changed.name = "with: colon # and hash";
  changed.mode = "smooth";
  changed.arm_m = {1e-9, -3.25, 1e6};
  changed.topics = {"points raw", "imu"};
  Sample read;
  load_config_text(print_config(document(changed)), "print", document(read));
  EXPECT_EQ(read.gain, changed.gain);
  EXPECT_EQ(read.count, changed.count);
  EXPECT_EQ(read.on, changed.on);
  EXPECT_EQ(read.name, changed.name);
  EXPECT_EQ(read.mode, changed.mode);
  EXPECT_EQ(read.arm_m, changed.arm_m);
  EXPECT_EQ(read.topics, changed.topics);
}

TEST(Config, what_is_not_known_prints_as_null_and_null_leaves_the_default) {
  Sample unknown;
  unknown.gain = std::numeric_limits<double>::quiet_NaN();
  const std::string print = print_config(document(unknown));
  EXPECT_THAT(print, HasSubstr("gain: ~"));
  Sample read;
  load_config_text(print, "print", document(read));
  EXPECT_EQ(read.gain, Sample().gain);
}

TEST(Config, a_missing_file_is_named) {
  Sample s;
  try {
    load_config({"/no/such/file.yaml"}, document(s));
    FAIL() << "no error";
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/no/such/file.yaml"));
  }
}

TEST(RobotConfig, names_the_topics_without_which_there_is_nothing_to_do) {
  const auto error_of_robot = [](const std::string& yaml) -> std::string {
    RobotConfig robot;
    try {
      load_config_text("robot: {" + yaml + "}", "file.yaml", [&](ConfigFields& fields) {
        fields.section("robot", "", [&](ConfigFields& section) { describe(robot, section); });
      });
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "no error";
  };
  for (const char* topic : {"points_topic", "imu_topic", "fix_topic"}) {
    for (const char* empty : {"''", "'  '", "/"}) {
      EXPECT_THAT(error_of_robot(std::string(topic) + ": " + empty),
                  HasSubstr(std::string("robot.") + topic + " must name a topic"))
          << empty;
    }
  }
  EXPECT_EQ(error_of_robot("twist_topic: '', yaw_topic: '', points_topic: /points"), "no error");
}

TEST(RobotConfig, the_lidar_s_pose_follows_from_its_angles) {
  RobotConfig robot;
  robot.lidar_position_base_m = {0.5, 0.0, 1.0};
  robot.lidar_roll_pitch_yaw_base_rad = {0.0, 0.0, 1.5707963267948966};
  const Eigen::Vector3d ahead_of_lidar = robot.T_base_lidar() * Eigen::Vector3d(1.0, 0.0, 0.0);
  EXPECT_LT((ahead_of_lidar - Eigen::Vector3d(0.5, 1.0, 1.0)).norm(), 1e-12);
}

TEST(Config, a_key_that_is_given_twice_is_refused_with_both_lines) {
  const std::string inner = error_of("sample:\n  gain: 1.0\n  count: 2\n  gain: 3.0\n");
  EXPECT_THAT(inner, HasSubstr("file.yaml:4: sample.gain is given twice, first in line 2"));
  EXPECT_THAT(error_of("sample: {count: 2}\nsample: {count: 3}\n"),
              HasSubstr("file.yaml:2: sample is given twice, first in line 1"));
  EXPECT_EQ(error_of("sample: {count: 2, inner: {inner_s: 0.5}}\n"), "no error");
}

TEST(Config, a_folder_in_place_of_a_file_is_named) {
  Sample s;
  try {
    load_config({"/tmp"}, document(s));
    FAIL() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/tmp: is a folder"));
  }
}

TEST(Config, a_second_document_is_refused_since_its_keys_would_count_for_nothing) {
  EXPECT_THAT(error_of("sample: {count: 2}\n---\nsample: {count: 3}\n"),
              HasSubstr("file.yaml:3: a second document"));
  EXPECT_EQ(error_of("---\nsample: {count: 2}\n"), "no error");
  EXPECT_EQ(error_of(""), "no error");
}

}  // namespace
}  // namespace trigpoint
