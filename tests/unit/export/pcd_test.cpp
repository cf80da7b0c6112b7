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
