// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "cloud_file.hpp"

#include "scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pcl/PCLPointCloud2.h>
#include <pcl/io/ply_io.h>
#include <sys/resource.h>

#include <cstring>
#include <filesystem>
#include <limits>

namespace trigpoint::exporter {
namespace {

using test::error_of;
using test::read_all;
using test::ScratchFolder;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

std::vector<std::string> files_in(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.push_back(entry.path().filename());
  }
  return names;
}

TEST(PlyFile, is_read_by_pcl_with_the_same_doubles_whatever_the_number_of_appends) {
  const ScratchFolder folder;
  const auto file = open_ply(folder.file("a.ply"), {"EPSG:32617"});
  std::vector<Eigen::Vector3d> written;
  for (int i = 0; i < 12; ++i) {
    written.push_back({4.8e6 + i / 3.0, -i / 7.0, i / 11.0});
    file->append({{written.back(), static_cast<float>(i)}});
  }
  EXPECT_EQ(file->finish(), 12U);
  pcl::PCLPointCloud2 cloud;
  ASSERT_EQ(pcl::PLYReader().read(folder.file("a.ply"), cloud), 0);
  ASSERT_EQ(cloud.width * cloud.height, 12U);
  for (std::size_t i = 0; i < written.size(); ++i) {
    Eigen::Vector3d p;
    std::memcpy(p.data(), cloud.data.data() + i * cloud.point_step, sizeof(double) * 3);
    EXPECT_EQ(p, written[i]);
  }
}

TEST(CloudFile, that_was_not_finished_leaves_nothing) {
  const ScratchFolder folder;
  open_ply(folder.file("a.ply"), {})->append({{Eigen::Vector3d::Zero(), 0.0F}});
  open_las(folder.file("a.las"), {})->append({{Eigen::Vector3d::Zero(), 0.0F}});
  EXPECT_THAT(files_in(folder.path()), UnorderedElementsAre());
}

TEST(CloudFile, names_the_file_that_cannot_be_written) {
  EXPECT_THAT(error_of([] { open_ply("/nowhere/a.ply", {}); }), HasSubstr("/nowhere/a.ply"));
}

TEST(LasFile, keeps_intensities_in_its_range_and_refuses_what_its_steps_cannot_hold) {
  const ScratchFolder folder;
  const auto file = open_las(folder.file("a.las"), {"", {0.0, 0.0, 0.0}, 10.0});
  file->append({{Eigen::Vector3d::Zero(), 1e6F},
                {Eigen::Vector3d::Zero(), -3.0F},
                {Eigen::Vector3d::Zero(), std::numeric_limits<float>::quiet_NaN()},
                {Eigen::Vector3d::Zero(), 12.34F}});
  EXPECT_THAT(error_of([&] {
                file->append({{{3e6, 0.0, 0.0}, 0.0F}});
              }),
              testing::AllOf(HasSubstr("a.las"), HasSubstr("2147 km")));
  file->finish();
  const std::string las = read_all(folder.file("a.las"));
  std::uint32_t data = 0;
  std::memcpy(&data, las.data() + 96, sizeof(data));
  std::vector<std::uint16_t> intensities(4);
  for (std::size_t i = 0; i < 4; ++i) {
    std::memcpy(&intensities[i], las.data() + data + 30 * i + 12, sizeof(std::uint16_t));
  }
  EXPECT_THAT(intensities, testing::ElementsAre(65535, 0, 0, 123));
}

TEST(CloudTiles, hold_each_point_once_in_the_tile_that_their_name_tells) {
  const ScratchFolder folder;
  CloudTiles tiles(50.0,
                   [&](const std::string& corner) { return open_ply(folder.file(corner), {}); });
  tiles.append({{{0.0, 0.0, 9.0}, 0.0F}, {{49.9, 49.9, -9.0}, 0.0F}, {{50.0, 0.0, 0.0}, 0.0F}});
  tiles.append({{{-0.1, 120.0, 0.0}, 0.0F}, {{1.0, 1.0, 0.0}, 0.0F}});
  EXPECT_EQ(tiles.finish(), 5U);
  EXPECT_THAT(files_in(folder.path()), UnorderedElementsAre("0_0", "50_0", "-50_100"));
  EXPECT_THAT(read_all(folder.file("0_0")), HasSubstr("element vertex 3\n"));
}

TEST(CloudTiles, may_be_more_than_a_process_can_have_open) {
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &limit), 0);
  const rlimit old = limit;
  limit.rlim_cur = 64;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
  const ScratchFolder folder;
  CloudTiles tiles(1.0,
                   [&](const std::string& corner) { return open_ply(folder.file(corner), {}); });
  for (int i = 0; i < 200; ++i) {
    tiles.append({{{i + 0.5, 0.5, 0.0}, 0.0F}});
  }
  EXPECT_EQ(tiles.finish(), 200U);
  EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &old), 0);
  EXPECT_EQ(files_in(folder.path()).size(), 200U);
}

}  // namespace
}  // namespace trigpoint::exporter
