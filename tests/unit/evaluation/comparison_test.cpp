// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/comparison.hpp"

#include "trigpoint/base/config.hpp"

#include "made_session.hpp"
#include "made_trajectories.hpp"
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace trigpoint::evaluation {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using tests::TemporaryFolder;

constexpr const char* kIdentity = "1 0 0 0 0 1 0 0 0 0 1 0\n";
constexpr const char* kOneAhead = "1 0 0 1 0 1 0 0 0 0 1 0\n";

std::string error_of(const ComparisonInput& input) {
  try {
    compare(input);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

std::vector<std::string> names_of(const ComparisonBlock& block) {
  std::vector<std::string> names;
  for (const Compared& compared : block.compared) {
    names.push_back(compared.evaluation.estimate_name);
  }
  return names;
}

TEST(Comparison, of_a_session_scores_every_trajectory_against_truth_and_both_kinds_of_fixes) {
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  const Comparison comparison = compare({folder.path("s"), "", "", ""});
  ASSERT_EQ(comparison.blocks.size(), 3U);
  EXPECT_THAT(names_of(comparison.blocks[0]), AllOf(Contains("fused.tum"), Contains("lio.tum")));
  const Evaluation& fused = comparison.blocks[0].compared[0].evaluation;
  ASSERT_EQ(fused.outages.size(), 1U);
  constexpr double kMillimetre = 1e-3;
  EXPECT_NEAR(fused.outages[0].max_m, test::kOutageEndError_m, 5.0 * kMillimetre);
  EXPECT_NEAR(fused.good->axes_m[0].median, test::kFusedEastError_m, kMillimetre);
  EXPECT_TRUE(fused.step->relative_to_lio);
  const std::string text = print(comparison);
  EXPECT_THAT(
      text,
      AllOf(HasSubstr("Alignment: SE(3)"), HasSubstr("Circular"), HasSubstr("lives in odom")));
}

TEST(Comparison, takes_a_session_as_the_reference_of_a_file_with_its_lever_arm_and_outages) {
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  const Comparison whole = compare({folder.path("s"), "", "", ""});
  const Comparison file = compare({folder.path("s") + "/fused.tum", folder.path("s"), "", ""});
  ASSERT_EQ(file.blocks.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(file.blocks[i].compared[0].evaluation.scores[0].error.position_m.rmse,
              whole.blocks[i].compared[0].evaluation.scores[0].error.position_m.rmse);
  }
  EXPECT_EQ(file.blocks[0].compared[0].evaluation.outages.size(), 1U);
}

TEST(Comparison, takes_the_same_gap_for_fixes_as_for_poses) {
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  const Trajectory fused = exporter::read_trajectory(folder.path("s") + "/fused.tum");
  {
    exporter::TrajectoryWriter sparse(folder.path("sparse.tum"), "base_link in map");
    for (std::size_t i = 5; i < fused.size(); i += 10) {  // 0.5 s from each fix
      sparse.append(fused[i].stamp_ns, fused[i].pose);
    }
  }
  ComparisonInput input{folder.path("sparse.tum"), folder.path("s"), "", ""};
  EXPECT_EQ(compare(input).blocks.size(), 1U) << "no fix has a pose nearer than 0.1 s";
  input.largest_gap_ns = 500'000'000;
  const Comparison wide = compare(input);
  ASSERT_EQ(wide.blocks.size(), 3U);
  EXPECT_GT(wide.blocks[2].compared[0].evaluation.pairs, 80U);
}

TEST(Comparison, of_a_session_without_truth_says_so) {
  const TemporaryFolder folder;
  test::make_session(folder.path("s"), false);
  const Comparison comparison = compare({folder.path("s"), "", "", ""});
  EXPECT_THAT(comparison.remarks, Contains(HasSubstr("no truth.tum")));
  EXPECT_EQ(comparison.blocks.front().reference_name, "withheld fixes");
}

TEST(Comparison, of_kitti_files_without_times_goes_pose_by_pose) {
  const TemporaryFolder folder;
  tests::write_file(folder.path("r.txt"), std::string(kIdentity) + kIdentity + kIdentity);
  tests::write_file(folder.path("e.txt"), std::string(kOneAhead) + kOneAhead + kOneAhead);
  const Comparison comparison = compare({folder.path("e.txt"), folder.path("r.txt"), "", ""});
  const Evaluation& evaluation = comparison.blocks[0].compared[0].evaluation;
  EXPECT_EQ(evaluation.pairs, 3U);
  EXPECT_EQ(evaluation.scores[0].error.axes_m[0].rmse, 1.0);
  tests::write_file(folder.path("short.txt"), kIdentity);
  EXPECT_THAT(error_of({folder.path("short.txt"), folder.path("r.txt"), "", ""}),
              AllOf(HasSubstr("1 poses"), HasSubstr("hold no times")));
}

TEST(Comparison, of_kitti_with_tum_goes_by_the_times_beside_the_file) {
  const TemporaryFolder folder;
  tests::write_file(folder.path("e.txt"), std::string(kOneAhead) + kOneAhead);
  tests::write_file(folder.path("r.tum"), "5.0 0 0 0 0 0 0 1\n5.1 0 0 0 0 0 0 1\n");
  EXPECT_THAT(error_of({folder.path("e.txt"), folder.path("r.tum"), "", ""}),
              HasSubstr("hold no times"));
  tests::write_file(folder.path("e_times.txt"), "5.02\n5.08\n");
  const Comparison comparison = compare({folder.path("e.txt"), folder.path("r.tum"), "", ""});
  EXPECT_EQ(comparison.blocks[0].compared[0].evaluation.pairs, 2U);
}

TEST(Comparison, tells_why_there_is_nothing_to_compare) {
  const TemporaryFolder folder;
  tests::write_file(folder.path("a.tum"), "1.0 0 0 0 0 0 0 1\n");
  tests::write_file(folder.path("b.tum"), "9.0 0 0 0 0 0 0 1\n");
  tests::write_file(folder.path("empty.tum"), "# nothing\n");
  EXPECT_THAT(error_of({folder.path("a.tum"), folder.path("b.tum"), "", ""}),
              AllOf(HasSubstr("no moment in common"), HasSubstr("9.000000000")));
  EXPECT_THAT(error_of({folder.path("a.tum"), folder.path("empty.tum"), "", ""}),
              HasSubstr("holds no pose"));
  EXPECT_THAT(error_of({folder.path("a.tum"), "", "", ""}), HasSubstr("needs a reference"));
}

TEST(Comparison, of_a_session_with_kitti_needs_times_too) {
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  tests::write_file(folder.path("e.txt"), kIdentity);
  EXPECT_THAT(error_of({folder.path("e.txt"), folder.path("s"), "", ""}),
              AllOf(HasSubstr("(a session)"), HasSubstr("hold no times")));
}

TEST(Comparison, of_a_session_without_any_reference_is_an_error_unless_that_is_allowed) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path("s"));
  tests::write_file(folder.path("s/lio.tum"), "1.0 0 0 0 0 0 0 1\n");
  ComparisonInput input;
  input.estimate = folder.path("s");
  EXPECT_THAT(error_of(input), AllOf(HasSubstr("nothing to compare"), HasSubstr("no datum")));
  input.may_be_empty = true;
  EXPECT_TRUE(compare(input).blocks.empty());
}

TEST(Comparison, is_drawn_for_each_reference) {
  if (!std::filesystem::exists("/usr/bin/gnuplot")) {
    GTEST_SKIP() << "gnuplot is not installed";
  }
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  const auto pictures = draw(compare({folder.path("s"), "", "", ""}), folder.path("pictures"));
  EXPECT_EQ(pictures.size(), 9U);
  tests::write_file(folder.path("bob's.tum"), tests::read_file(folder.path("s/fused.tum")));
  EXPECT_EQ(draw(compare({folder.path("bob's.tum"), folder.path("bob's.tum"), "", ""}),
                 folder.path("quoted"))
                .size(),
            3U);
  for (const std::string& picture : pictures) {
    EXPECT_GT(std::filesystem::file_size(picture), 5000U) << picture;
  }
}

TEST(Comparison, of_a_session_names_what_it_left_out) {
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  tests::write_file(folder.path("s") + "/fused.tum", "nonsense\n");
  tests::write_file(folder.path("s") + "/config.yaml", "robot: [1\n");
  std::filesystem::remove(folder.path("s") + "/gps.tum");
  const Comparison comparison = compare({folder.path("s"), "", "", ""});
  EXPECT_THAT(comparison.damaged,
              testing::UnorderedElementsAre(HasSubstr("fused.tum:1"), HasSubstr("config.yaml: ")));
  EXPECT_THAT(comparison.remarks,
              AllOf(Contains(HasSubstr("No error of fused.tum")),
                    Contains(HasSubstr("No error of gps.tum"))));
}

TEST(Comparison, of_a_session_tells_a_value_of_its_configuration_that_is_no_number) {
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  tests::write_file(folder.path("s") + "/config.yaml",
                    "robot:\n  geoid_undulation_m: [30]\n  antenna_position_base_m: [0, 0, 0]\n");
  EXPECT_THAT(compare({folder.path("s"), "", "", ""}).damaged,
              testing::ElementsAre(
                  HasSubstr("config.yaml: robot.geoid_undulation_m must be a number; is [30]")));
}

TEST(Comparison, is_drawn_with_the_names_of_what_was_left_out) {
  if (!std::filesystem::exists("/usr/bin/gnuplot")) {
    GTEST_SKIP() << "gnuplot is not installed";
  }
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  const auto scripts = [&](const std::string& pictures) {
    std::vector<std::string> texts;
    for (const std::string& png :
         draw(compare({folder.path("s"), "", "", ""}), folder.path(pictures))) {
      const std::filesystem::path path(png);
      texts.push_back(
          tests::read_file(folder.path(pictures) + "/plots/" + path.stem().string() + ".gp"));
    }
    return texts;
  };
  EXPECT_THAT(scripts("whole"), testing::Each(testing::Not(HasSubstr("Left out"))));
  tests::write_file(folder.path("s") + "/gps.tum", "nonsense\n");
  EXPECT_THAT(scripts("damaged"),
              AllOf(testing::Not(testing::IsEmpty()),
                    testing::Each(HasSubstr("'Left out, cannot be read: gps.tum'"))));
}

TEST(Comparison, of_a_file_with_nothing_is_wrong_usage) {
  const TemporaryFolder folder;
  test::make_session(folder.path("s"));
  EXPECT_THROW(compare({folder.path("s") + "/fused.tum", "", "", ""}), ConfigError);
}

}  // namespace
}  // namespace trigpoint::evaluation
