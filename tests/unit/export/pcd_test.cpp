// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/map.hpp"

#include "scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

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

TEST(Pcd, errors_name_the_file) {
  const ScratchFolder folder;
  EXPECT_THAT(error_of([&] { read_pcd(folder.file("missing.pcd")); }), HasSubstr("missing.pcd"));
  EXPECT_THAT(error_of([] { write_pcd("/nowhere/cloud.pcd", {}); }),
              testing::AllOf(HasSubstr("/nowhere/cloud.pcd"), HasSubstr("No such file")));
}

}  // namespace
}  // namespace trigpoint::exporter
