// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Every figure of `trigpoint evaluate --json` against second_implementation.py (numpy, other
// formulas), to 1e-6. Says that it skips where Debian's python3-numpy is not installed.
#include "trigpoint/evaluation/comparison.hpp"

#include "made_session.hpp"
#include "made_trajectories.hpp"
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <regex>

namespace trigpoint::evaluation {
namespace {

using tests::CommandResult;
using tests::run_command;
using tests::TemporaryFolder;

constexpr const char* kPython = "/usr/bin/python3";  // Debian's, which Debian's numpy is for

bool there_is_numpy() {
  return run_command({kPython, "-c", "import numpy"}).exit_code == 0;
}

void write(const std::string& file, const Trajectory& trajectory) {
  exporter::TrajectoryWriter writer(file, "made");
  for (const StampedPose& pose : trajectory) {
    writer.append(pose.stamp_ns, pose.pose);
  }
}

CommandResult check(const Comparison& comparison, std::vector<std::string> arguments) {
  const TemporaryFolder folder;
  tests::write_file(folder.path("result.json"), to_json(comparison));
  arguments.insert(
      arguments.begin(),
      {kPython,
       std::string(TRIGPOINT_SOURCE_DIR) + "/tests/unit/evaluation/second_implementation.py",
       folder.path("result.json")});
  return run_command(arguments);
}

int figures_in(const std::string& output) {
  std::smatch match;
  return std::regex_search(output, match, std::regex("(\\d+) figures")) ? std::stoi(match[1]) : 0;
}

/// 150 s at 10 Hz round a rising helix of 1.5 km, and the same at other stamps with noise, a gap, a
/// turn and a tilt.
Trajectory reference() {
  Trajectory trajectory;
  for (StampedPose pose : test::helix(1500)) {
    pose.pose.p *= 10.0;
    trajectory.push_back(pose);
  }
  return trajectory;
}

Trajectory estimate(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise;
  const Trajectory truth = reference();
  const Pose moved(from_roll_pitch_yaw({0.01, -0.02, 0.7}), {12.0, -7.0, 1.5});
  Trajectory trajectory;
  for (Nanoseconds t = truth.front().stamp_ns - 1'000'000'000; t < truth.back().stamp_ns;
       t += 73'456'789) {
    const auto pose = pose_at(truth, t);
    const bool in_gap = t > truth[700].stamp_ns && t < truth[760].stamp_ns;
    if (!pose || in_gap) {
      continue;
    }
    const Eigen::Vector3d turn(noise(random), noise(random), noise(random));
    const Eigen::Vector3d shift(noise(random), noise(random), noise(random));
    trajectory.push_back({t, moved * *pose * Pose(so3_exp(0.01 * turn), 0.2 * shift)});
  }
  return trajectory;
}

TEST(SecondImplementation, finds_the_same_figures_for_two_files) {
  if (!there_is_numpy()) {
    GTEST_SKIP() << "the Debian package python3-numpy is not installed";
  }
  for (const unsigned seed : {1U, 2U, 3U}) {
    const TemporaryFolder folder;
    write(folder.path("r.tum"), reference());
    write(folder.path("e.tum"), estimate(seed));
    ComparisonInput input;
    input.estimate = folder.path("e.tum");
    input.reference = folder.path("r.tum");
    const CommandResult result = check(compare(input), {input.estimate, input.reference});
    EXPECT_EQ(result.exit_code, 0) << result.output;
    EXPECT_GT(figures_in(result.output), 100) << result.output;
  }
}

TEST(SecondImplementation, finds_the_same_figures_for_a_session) {
  if (!there_is_numpy()) {
    GTEST_SKIP() << "the Debian package python3-numpy is not installed";
  }
  const TemporaryFolder folder;
  const std::string session = folder.path("session");
  test::make_session(session);
  ComparisonInput input;
  input.estimate = session;
  const Comparison comparison = compare(input);
  std::vector<std::string> references;
  for (const ComparisonBlock& block : comparison.blocks) {
    references.push_back(block.reference_name);
  }
  EXPECT_THAT(references, testing::ElementsAre("truth.tum", "withheld fixes", "all fixes"));
  const CommandResult result = check(comparison, {session});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_GT(figures_in(result.output), 500) << result.output;
}

TEST(SecondImplementation, notices_a_figure_that_is_off_by_two_micrometres) {
  if (!there_is_numpy()) {
    GTEST_SKIP() << "the Debian package python3-numpy is not installed";
  }
  const TemporaryFolder folder;
  write(folder.path("r.tum"), reference());
  write(folder.path("e.tum"), estimate(1));
  ComparisonInput input;
  input.estimate = folder.path("e.tum");
  input.reference = folder.path("r.tum");
  Comparison comparison = compare(input);
  comparison.blocks[0].compared[0].evaluation.scores[2].error.position_m.median += 2e-6;
  const CommandResult result = check(comparison, {input.estimate, input.reference});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, testing::HasSubstr("position_m.median"));
}

}  // namespace
}  // namespace trigpoint::evaluation
