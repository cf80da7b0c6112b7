// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/map.hpp"

#include "scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>

namespace trigpoint::exporter {
namespace {

using test::error_of;
using test::ScratchFolder;
using test::write_all;
using ::testing::HasSubstr;

// read_pcd is PCL's reader, so these check our writer against PCL.

TEST(Pcd, is_read_by_pcl_with_the_same_bits) {
  const ScratchFolder folder;
  const PointCloud cloud{{1.5F, -2.25F, 1e6F, 0.5F}, {0.1F, 0.2F, 0.3F, 255.0F}};
  write_pcd(folder.file("cloud.pcd"), cloud);
  const auto read = read_pcd(folder.file("cloud.pcd"));
  ASSERT_EQ(read.size(), cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(read[i].position(), cloud[i].position());
    EXPECT_EQ(read[i].intensity, cloud[i].intensity);
  }
}

TEST(Pcd, of_a_cloud_without_intensity_reads_zero) {
  const ScratchFolder folder;
  write_all(folder.file("a.pcd"),
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\n"
            "HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n1 2 3\n");
  const auto read = read_pcd(folder.file("a.pcd"));
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read[0].position(), Eigen::Vector3f(1.0F, 2.0F, 3.0F));
  EXPECT_EQ(read[0].intensity, 0.0F);
}

TEST(Pcd, is_visited_in_parts_as_it_is_read_whole) {
  const ScratchFolder folder;
  PointCloud cloud(200'000);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud[i] = {static_cast<float>(i), 1.0F, 2.0F, 3.0F};
  }
  cloud[7].x = std::numeric_limits<float>::quiet_NaN();  // is left out
  write_pcd(folder.file("a.pcd"), cloud);
  PointCloud visited;
  int parts = 0;
  double last_share = 0.0;
  visit_pcd(folder.file("a.pcd"), [&](const PointCloud& points, double share) {
    visited.insert(visited.end(), points.begin(), points.end());
    ++parts;
    last_share = share;
  });
  ASSERT_EQ(visited.size(), cloud.size() - 1);
  EXPECT_EQ(visited[7].x, 8.0F);
  EXPECT_EQ(visited.back().x, 199'999.0F);
  EXPECT_GT(parts, 2);
  EXPECT_EQ(last_share, 1.0);
}

TEST(Pcd, of_other_fields_and_storages_is_visited_as_pcl_reads_it) {
  const ScratchFolder folder;
  const std::string fields =
      "# .PCD v0.7\nVERSION 0.7\nFIELDS rgb normal x y z intensity\nSIZE 2 4 4 4 4 4\n"
      "TYPE U F F F F F\nCOUNT 1 3 1 1 1 1\nWIDTH 1\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\n";
  std::string point(2 + 3 * 4, '\7');
  for (const float value : {1.5F, 2.5F, 3.5F, 4.5F}) {
    point.append(reinterpret_cast<const char*>(&value), sizeof(value));
  }
  write_all(folder.file("binary.pcd"), fields + "DATA binary\n" + point);
  write_all(folder.file("ascii.pcd"), fields + "DATA ascii\n7 0 0 0 1.5 2.5 3.5 4.5\n");
  for (const char* name : {"binary.pcd", "ascii.pcd"}) {
    PointCloud visited;
    visit_pcd(folder.file(name), [&](const PointCloud& points, double) { visited = points; });
    const PointCloud read = read_pcd(folder.file(name));
    ASSERT_EQ(visited.size(), 1U) << name;
    ASSERT_EQ(read.size(), 1U) << name;
    EXPECT_EQ(visited[0].position(), Eigen::Vector3f(1.5F, 2.5F, 3.5F)) << name;
    EXPECT_EQ(visited[0].position(), read[0].position()) << name;
    EXPECT_EQ(visited[0].intensity, 4.5F) << name;
  }
}

TEST(Pcd, that_is_none_is_named) {
  const ScratchFolder folder;
  write_all(folder.file("text.pcd"), "this is no cloud\n");
  write_all(folder.file("cut.pcd"), "VERSION 0.7\nFIELDS x y z\nSIZE 4 4\n");
  write_all(folder.file("vast.pcd"),
            "FIELDS x y z w\nSIZE 4 4 4 8\nTYPE F F F F\nCOUNT 1 1 1 2305843009213693952\n"
            "POINTS 9\nDATA binary\n");
  for (const char* name : {"text.pcd", "cut.pcd", "vast.pcd"}) {
    EXPECT_THAT(error_of([&] { visit_pcd(folder.file(name), [](const auto&, double) {}); }),
                testing::AllOf(HasSubstr(name), HasSubstr("not a readable PCD")));
    EXPECT_THAT(error_of([&] { read_pcd(folder.file(name)); }), HasSubstr("not a readable PCD"));
  }
}

TEST(Pcd, that_ends_too_early_is_an_error_with_the_numbers) {
  const ScratchFolder folder;
  write_pcd(folder.file("a.pcd"), PointCloud(10));
  std::filesystem::resize_file(folder.file("a.pcd"),
                               std::filesystem::file_size(folder.file("a.pcd")) - 1);
  EXPECT_THAT(error_of([&] { visit_pcd(folder.file("a.pcd"), [](const auto&, double) {}); }),
              testing::AllOf(HasSubstr("a.pcd"), HasSubstr("10 points")));
}

TEST(Pcd, errors_name_the_file) {
  const ScratchFolder folder;
  EXPECT_THAT(error_of([&] { read_pcd(folder.file("missing.pcd")); }), HasSubstr("missing.pcd"));
  EXPECT_THAT(error_of([] { write_pcd("/nowhere/cloud.pcd", {}); }),
              testing::AllOf(HasSubstr("/nowhere/cloud.pcd"), HasSubstr("No such file")));
}

}  // namespace
}  // namespace trigpoint::exporter
