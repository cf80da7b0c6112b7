// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/session.hpp"

#include "scratch_folder.hpp"
#include "small_disk.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace trigpoint::exporter {
namespace {

using test::error_of;
using test::read_all;
using test::ScratchFolder;
using test::write_all;
using ::testing::HasSubstr;

constexpr double kWrittenDigits_m = 0.5e-6 + 1e-12;
constexpr const char* kGoodLine = "1.000000000 0 0 0 0 0 0 1\n";

TEST(Trajectory, keeps_nineteen_digits_of_a_stamp) {
  const ScratchFolder folder;
  const std::vector<Nanoseconds> stamps{-1'500'000'001,
                                        -1,
                                        0,
                                        1,
                                        999'999'999,
                                        1'317'377'394'123'456'789,
                                        std::numeric_limits<Nanoseconds>::max()};
  {
    TrajectoryWriter writer(folder.file("t.tum"), "base_link in map");
    for (const auto stamp_ns : stamps) {
      EXPECT_TRUE(writer.append(stamp_ns, Pose{}));
    }
  }
  const auto read = read_trajectory(folder.file("t.tum"));
  ASSERT_EQ(read.size(), stamps.size());
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    EXPECT_EQ(read[i].stamp_ns, stamps[i]);
  }
  EXPECT_THAT(read_all(folder.file("t.tum")), HasSubstr("\n1317377394.123456789 "));
  EXPECT_THAT(read_all(folder.file("t.tum")), HasSubstr("\n-1.500000001 "));
}

TEST(Trajectory, returns_the_poses_that_were_written) {
  const ScratchFolder folder;
  const Pose pose({std::cos(0.3), 0.0, 0.0, std::sin(0.3)}, {1234.567891, -0.25, 99.0});
  {
    TrajectoryWriter writer(folder.file("t.tum"), "base_link in odom");
    writer.append(5, pose);
  }
  const auto read = read_trajectory(folder.file("t.tum"));
  ASSERT_EQ(read.size(), 1U);
  EXPECT_LT((read[0].pose.p - pose.p).cwiseAbs().maxCoeff(), kWrittenDigits_m);
  EXPECT_LT(read[0].pose.q.angularDistance(pose.q), 1e-8);
  EXPECT_THAT(read_all(folder.file("t.tum")), testing::StartsWith("# base_link in odom"));
}

TEST(Trajectory, writer_refuses_poses_that_are_not_finite_or_not_later) {
  const ScratchFolder folder;
  TrajectoryWriter writer(folder.file("t.tum"), "base_link in map");
  Pose broken;
  broken.p.y() = std::nan("");
  EXPECT_FALSE(writer.append(1, broken));
  EXPECT_TRUE(writer.append(2, Pose{}));
  EXPECT_FALSE(writer.append(2, Pose{}));
  EXPECT_FALSE(writer.append(1, Pose{}));
  EXPECT_EQ(read_trajectory(folder.file("t.tum")).size(), 1U);
}

TEST(Trajectory, is_on_disk_line_by_line_while_the_writer_lives) {
  const ScratchFolder folder;
  TrajectoryWriter writer(folder.file("t.tum"), "base_link in map");
  for (Nanoseconds i = 1; i <= 3; ++i) {
    writer.append(i, Pose{});
    EXPECT_EQ(read_trajectory(folder.file("t.tum")).size(), static_cast<std::size_t>(i));
  }
}

TEST(Trajectory, continues_after_a_torn_line_and_never_back_in_time) {
  const ScratchFolder folder;
  write_all(folder.file("t.tum"), std::string("# comment\n") + kGoodLine + "2.000000000 0 0 0");
  {
    TrajectoryWriter writer(folder.file("t.tum"), "again", Opening::kContinue);
    EXPECT_FALSE(writer.append(1'000'000'000, Pose{}));
    EXPECT_TRUE(writer.append(3'000'000'000, Pose{}));
  }
  const auto read = read_trajectory(folder.file("t.tum"));
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[1].stamp_ns, 3'000'000'000);
}

TEST(Trajectory, says_that_the_disk_is_full) {
  EXPECT_THAT(error_of([] { TrajectoryWriter writer("/dev/full", "base_link in map"); }),
              testing::AllOf(HasSubstr("/dev/full"), HasSubstr("No space left on device")));
}

TEST(Trajectory, takes_back_a_line_that_did_not_fit_and_goes_on_when_there_is_room) {
  const ScratchFolder folder;
  TrajectoryWriter writer(folder.file("t.tum"), "base_link in map");
  Nanoseconds written = 0;
  {
    const tests::SmallDisk disk(500);
    const auto error = error_of([&] {
      while (writer.append(written + 1, Pose{})) {
        ++written;
      }
    });
    EXPECT_THAT(error, testing::AllOf(HasSubstr("t.tum"), HasSubstr("too large")));
  }
  EXPECT_EQ(read_all(folder.file("t.tum")).back(), '\n');
  writer.append(written + 1, Pose{});
  EXPECT_EQ(read_trajectory(folder.file("t.tum")).size(), static_cast<std::size_t>(written + 1));
}

TEST(Trajectory, says_which_folder_is_missing) {
  EXPECT_THAT(error_of([] { TrajectoryWriter writer("/nowhere/t.tum", "base_link in map"); }),
              testing::AllOf(HasSubstr("/nowhere/t.tum"), HasSubstr("No such file")));
  EXPECT_THAT(error_of([] { read_trajectory("/nowhere/t.tum"); }), HasSubstr("/nowhere/t.tum"));
}

TEST(Trajectory, reads_foreign_stamps_without_decimals_or_with_exponent) {
  const ScratchFolder folder;
  write_all(folder.file("t.tum"), "7 0 0 0 0 0 0 1\n7.25 0 0 0 0 0 0 1\n1.5e+09 0 0 0 0 0 0 1\n");
  const auto read = read_trajectory(folder.file("t.tum"));
  ASSERT_EQ(read.size(), 3U);
  EXPECT_EQ(read[0].stamp_ns, 7'000'000'000);
  EXPECT_EQ(read[1].stamp_ns, 7'250'000'000);
  EXPECT_EQ(read[2].stamp_ns, 1'500'000'000'000'000'000);
}

struct Malformed {
  std::string line;
  std::string complaint;
};

class MalformedTrajectory : public testing::TestWithParam<Malformed> {};

TEST_P(MalformedTrajectory, is_refused_with_file_and_line) {
  const ScratchFolder folder;
  write_all(folder.file("t.tum"), kGoodLine + GetParam().line + "\n");
  const auto error = error_of([&] { read_trajectory(folder.file("t.tum")); });
  EXPECT_THAT(error, HasSubstr("t.tum:2: "));
  EXPECT_THAT(error, HasSubstr(GetParam().complaint));
}

INSTANTIATE_TEST_SUITE_P(Lines,
                         MalformedTrajectory,
                         testing::Values(Malformed{"2 0 0 0 0 0 0", "7 columns"},
                                         Malformed{"2 0 0 0 0 0 0 1 9", "9 columns"},
                                         Malformed{"two 0 0 0 0 0 0 1", "'two'"},
                                         Malformed{"2.1.2 0 0 0 0 0 0 1", "'2.1.2'"},
                                         Malformed{"2 0 x 0 0 0 0 1", "'x'"},
                                         Malformed{"2 nan 0 0 0 0 0 1", "'nan'"},
                                         Malformed{"2 0 0 0 0 0 0 0.5", "length is 0.5"},
                                         Malformed{"1 0 0 0 0 0 0 1", "not later"}));

}  // namespace
}  // namespace trigpoint::exporter
