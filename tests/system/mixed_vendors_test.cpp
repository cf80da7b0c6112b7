// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The main job with its processes on different DDS vendors: always the map and trajectory of the
// offline run, and no message lost.
#include "trigpoint/evaluation/trajectory_error.hpp"
#include "trigpoint/export/session.hpp"

#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using tests::CommandResult;
using tests::run_command;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

constexpr double kDdsAgainstOffline_m = 0.05;  // as for a job on one vendor
constexpr double kSameMapSize = 0.02;          // of its points
const std::string kScenario = "short";
const std::vector<std::string> kPrograms{"trigpoint",
                                         "trigpoint_gps_ekf15",
                                         "trigpoint_gps_eskf18",
                                         "trigpoint_lio_mapper",
                                         "trigpoint_fusion_gate",
                                         "trigpoint_supervise"};

/// The programs of the vendor that this build is not for; nothing when there is none.
fs::path other_vendor() {
  for (const char* vendor : {"cyclonedds", "fastdds"}) {
    const fs::path folder = fs::path(TRIGPOINT_BIN_DIR) / vendor;
    if (fs::exists(folder / "trigpoint")) {
      return folder;
    }
  }
  return {};
}

struct Deployment {
  const char* name;
  std::vector<std::string> on_other_vendor;  ///< beginnings of program names
};

class MixedVendors : public ::testing::TestWithParam<Deployment> {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    const CommandResult result = run_command(
        {std::string(TRIGPOINT_BIN_DIR) + "/trigpoint", "map", kScenario, "--out", offline()},
        120s);
    ASSERT_EQ(result.exit_code, 0) << result.output;
  }

  static void TearDownTestSuite() { folder_.reset(); }

  static std::string offline() { return folder_->path("offline"); }

  /// A folder in which each program is that of its vendor.
  static std::string programs(const Deployment& deployment) {
    const fs::path bin = folder_->path(std::string("bin_") + deployment.name);
    fs::create_directory(bin);
    for (const std::string& program : kPrograms) {
      const bool other =
          std::any_of(deployment.on_other_vendor.begin(),
                      deployment.on_other_vendor.end(),
                      [&](const std::string& beginning) { return program.starts_with(beginning); });
      fs::create_symlink((other ? other_vendor() : fs::path(TRIGPOINT_BIN_DIR)) / program,
                         bin / program);
    }
    return bin.string();
  }

  static std::unique_ptr<TemporaryFolder> folder_;
};

std::unique_ptr<TemporaryFolder> MixedVendors::folder_;

TEST_P(MixedVendors, give_the_result_of_one) {
  if (other_vendor().empty()) {
    GTEST_SKIP() << "this build knows one DDS vendor only; install the other and configure again";
  }
  const std::string session = folder_->path(GetParam().name);
  const CommandResult job = run_command(
      {std::string(TRIGPOINT_SOURCE_DIR) + "/bringup/run",
       kScenario,
       "--no-build",
       "--out",
       session},
      240s,
      {{"ROS_DOMAIN_ID", tests::own_domain(80)}, {"TRIGPOINT_BIN", programs(GetParam())}});
  ASSERT_EQ(job.exit_code, 0) << job.output;
  EXPECT_THAT(tests::read_file(session + "/report.md"), HasSubstr("ALL ACCOUNTED FOR"));
  const auto association =
      evaluation::associate(exporter::read_trajectory(session + "/fused.tum"),
                            exporter::read_trajectory(offline() + "/fused.tum"));
  EXPECT_GT(association.coverage.whole, 0.95);
  EXPECT_LT(evaluation::absolute_error(association.pairs).position_m.max, kDdsAgainstOffline_m);
  const auto map_bytes = static_cast<double>(fs::file_size(session + "/map.pcd"));
  const auto offline_bytes = static_cast<double>(fs::file_size(offline() + "/map.pcd"));
  EXPECT_NEAR(map_bytes / offline_bytes, 1.0, kSameMapSize);
}

INSTANTIATE_TEST_SUITE_P(MainJob,
                         MixedVendors,
                         ::testing::Values(Deployment{"all_on_the_other", {"trigpoint"}},
                                           Deployment{"mapper_on_the_other",
                                                      {"trigpoint_lio_mapper"}},
                                           Deployment{"filter_and_gate_on_the_other",
                                                      {"trigpoint_gps", "trigpoint_fusion_gate"}}),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

}  // namespace
}  // namespace trigpoint
