// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/trajectory_formats.hpp"

#include "scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::exporter {
namespace {

using test::error_of;
using test::ScratchFolder;
using test::write_all;
using ::testing::AllOf;
using ::testing::HasSubstr;

// A turn by 90 degrees about z, then 1 2 3.
constexpr const char* kTurned = "0 -1 0 1  1 0 0 2  0 0 1 3\n";
constexpr const char* kIdentity = "1 0 0 0 0 1 0 0 0 0 1 0\n";
constexpr double kRounding = 1e-12;

TEST(Kitti, is_known_by_its_columns_and_read_with_its_times) {
  const ScratchFolder folder;
  write_all(folder.file("a.txt"), std::string(kIdentity) + kTurned);
  write_all(folder.file("times.txt"), "0.000000e+00\n1.037584e-01\n");
  EXPECT_EQ(format_of(folder.file("a.txt")), TrajectoryFormat::kKitti);
  EXPECT_EQ(times_file_of(folder.file("a.txt")), folder.file("times.txt"));
  const Trajectory read = read_kitti(folder.file("a.txt"), folder.file("times.txt"));
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[1].stamp_ns, 103'758'400);
  EXPECT_LT((read[1].pose * Eigen::Vector3d(1.0, 0.0, 0.0) - Eigen::Vector3d(1.0, 3.0, 3.0)).norm(),
            kRounding);
}

TEST(Kitti, keeps_every_digit_of_stamps_of_today_and_prefers_the_file_s_own_times) {
  const ScratchFolder folder;
  write_all(folder.file("fused.kitti.txt"), kIdentity);
  write_all(folder.file("fused.kitti_times.txt"), "1700000000.123456789\n");
  write_all(folder.file("times.txt"), "0\n");
  const std::string times = times_file_of(folder.file("fused.kitti.txt"));
  EXPECT_EQ(read_kitti(folder.file("fused.kitti.txt"), times).front().stamp_ns,
            1'700'000'000'123'456'789);
}

TEST(Kitti, without_times_has_made_up_ones) {
  const ScratchFolder folder;
  write_all(folder.file("a.txt"), std::string(kIdentity) + kTurned);
  EXPECT_EQ(times_file_of(folder.file("a.txt")), "");
  EXPECT_EQ(read_kitti(folder.file("a.txt"))[1].stamp_ns, 100'000'000);
}

TEST(Kitti, errors_name_file_line_and_cause) {
  const ScratchFolder folder;
  const std::string file = folder.file("a.txt");
  const auto error = [&](const std::string& text, const std::string& times) {
    write_all(file, text);
    write_all(folder.file("t.txt"), times);
    return error_of([&] { read_kitti(file, folder.file("t.txt")); });
  };
  EXPECT_THAT(error(std::string(kIdentity) + "1 2\n", "0\n1\n"),
              AllOf(HasSubstr("a.txt:2"), HasSubstr("2 columns")));
  EXPECT_THAT(error("1 0 0 0 0 1 0 0 0 0 2 0\n", "0\n"), HasSubstr("no rotation"));
  EXPECT_THAT(error("-1 0 0 0 0 1 0 0 0 0 1 0\n", "0\n"), HasSubstr("no rotation"));
  EXPECT_THAT(error("x 0 0 0 0 1 0 0 0 0 1 0\n", "0\n"), HasSubstr("'x' is not a finite number"));
  EXPECT_THAT(error(kIdentity, "0\n1\n"), HasSubstr("2 times for the 1 poses"));
  EXPECT_THAT(error(std::string(kIdentity) + kIdentity, "1\n1\n"), HasSubstr("t.txt:2"));
}

}  // namespace
}  // namespace trigpoint::exporter
