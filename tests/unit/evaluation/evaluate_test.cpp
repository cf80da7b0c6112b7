// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/evaluate.hpp"

#include "../export/scratch_folder.hpp"
#include "made_trajectories.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::evaluation {
namespace {

using test::helix;
using test::kStart_ns;
using test::kStep_ns;
using test::straight;
using test::transformed;
using ::testing::AllOf;
using ::testing::HasSubstr;
using trigpoint::test::error_of;
using trigpoint::test::ScratchFolder;

constexpr double kWritten_m = 2e-6;  // six decimals in each file

std::string write(const ScratchFolder& folder, const std::string& name, const Trajectory& poses) {
  exporter::TrajectoryWriter writer(folder.file(name), "test");
  for (const auto& [stamp_ns, pose] : poses) {
    writer.append(stamp_ns, pose);
  }
  return folder.file(name);
}

TEST(Evaluate, scores_the_three_alignments_of_two_files) {
  const ScratchFolder folder;
  const auto reference = helix(200);
  const auto tilted =
      transformed(Pose(from_roll_pitch_yaw({0.1, 0.0, 1.0}), {1.0, 2.0, 3.0}), reference);
  const auto result =
      evaluate_files(write(folder, "lio.tum", tilted), write(folder, "truth.tum", reference));
  EXPECT_EQ(result.pairs, 200U);
  EXPECT_EQ(result.coverage.whole, 1.0);
  EXPECT_GT(result.scores[0].error.position_m.rmse, 2.0);
  EXPECT_LT(result.scores[1].error.position_m.rmse, result.scores[0].error.position_m.rmse);
  EXPECT_LT(result.scores[2].error.position_m.max, kWritten_m);
  EXPECT_LT(result.end_to_end.error_m, 10 * kWritten_m);
}

TEST(Evaluate, tells_the_good_part_and_the_outage_apart) {
  const auto reference = straight(101, 1.0);
  Trajectory estimate = reference;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const bool in_outage = i > 40 && i < 70;
    estimate[i].pose.p.y() = in_outage ? 0.02 * static_cast<double>(i - 40) : 0.05;
  }
  EvaluationOptions options;
  options.outages = {{kStart_ns + 40 * kStep_ns, kStart_ns + 70 * kStep_ns}};
  const auto result = evaluate(estimate, reference, options);
  ASSERT_TRUE(result.good);
  EXPECT_NEAR(result.good->position_m.rmse, 0.05, 1e-9);
  ASSERT_EQ(result.outages.size(), 1U);
  EXPECT_NEAR(result.outages[0].end_m, 0.02 * 29, 1e-9);
}

TEST(Evaluate, prints_file_alignment_axes_and_coverage) {
  const ScratchFolder folder;
  const auto line = straight(101, 1.0);
  const auto text = print(
      evaluate_files(write(folder, "a.tum", straight(51, 1.0)), write(folder, "b.tum", line)));
  EXPECT_THAT(text,
              AllOf(HasSubstr("a.tum"),
                    HasSubstr("b.tum"),
                    HasSubstr("Alignment: none"),
                    HasSubstr("Alignment: yaw + translation"),
                    HasSubstr("Alignment: SE(3): not determined"),
                    HasSubstr("x (east)"),
                    HasSubstr("51.4 %")));  // 51 poses and one within the gap, of 101
}

TEST(Evaluate, says_that_two_files_have_no_moment_in_common) {
  const ScratchFolder folder;
  const auto estimate = write(folder, "a.tum", straight(5, 1.0, 1'000'000'000));
  const auto reference = write(folder, "b.tum", straight(5, 1.0));
  EXPECT_THAT(error_of([&] { evaluate_files(estimate, reference); }),
              AllOf(HasSubstr("a.tum"),
                    HasSubstr("b.tum"),
                    HasSubstr("1.000000000"),
                    HasSubstr("no moment in common")));
}

TEST(Evaluate, of_an_empty_trajectory_gives_no_numbers) {
  const auto result = evaluate({}, straight(5, 1.0));
  EXPECT_EQ(result.pairs, 0U);
  EXPECT_TRUE(std::isnan(result.scores[0].error.position_m.rmse));
  EXPECT_THAT(print(result), HasSubstr("| position [m]"));
}

}  // namespace
}  // namespace trigpoint::evaluation
