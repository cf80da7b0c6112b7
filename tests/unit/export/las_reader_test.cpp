// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Needs node and, in the folder that TRIGPOINT_NODE_MODULES names, the package copc
// (npm install --prefix FOLDER copc); says that it skips without.
#include "cloud_file.hpp"
#include "run_command.hpp"
#include "scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

namespace trigpoint::exporter {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(LasFile, is_read_by_a_reader_of_another_house) {
  const char* modules = std::getenv("TRIGPOINT_NODE_MODULES");
  if (modules == nullptr || !std::filesystem::exists(std::string(modules) + "/copc")) {
    GTEST_SKIP() << "TRIGPOINT_NODE_MODULES names no folder that holds the npm package copc";
  }
  const test::ScratchFolder folder;
  const auto file =
      open_las(folder.file("a.las"), {"PROJCS[\"x\"]", {668000.0, 4867000.0, 0.0}, 257.0});
  file->append({{{668783.4862, 4867981.1828, 100.8064}, 1.0F}});
  file->append({{{667999.0, 4866999.9996, -3.25}, 255.0F}});
  file->finish();
  const auto result =
      tests::run_command({"node",
                          std::string(TRIGPOINT_SOURCE_DIR) + "/tests/unit/export/read_las.mjs",
                          modules,
                          folder.file("a.las")});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("version 1.4\n"),
                    HasSubstr("points 2\n"),
                    HasSubstr("wkt PROJCS[\"x\"]\n"),
                    HasSubstr("point 668783.486 4867981.183 100.806 257\n"),
                    HasSubstr("point 667999.000 4867000.000 -3.250 65535\n")));
}

}  // namespace
}  // namespace trigpoint::exporter
