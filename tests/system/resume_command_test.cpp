// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What `trigpoint map --resume` and `--localize` leave of the stored session, found or not.
#include "run_command.hpp"
#include "wait_until.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::CommandResult;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

/// One attempt at finding the place is enough to fail.
constexpr const char* kQuick = "lio_mapper: {recovery: {attempts: 1}}\n";

/// A drive of a few seconds that became a session, for all tests: each takes a copy.
class StoredSession : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    tests::write_file(folder_->path("quick.yaml"), kQuick);
    const CommandResult made = map({"short", "--duration", "8", "--out", folder_->path("session")});
    ASSERT_EQ(made.exit_code, 0) << made.output;
  }

  static void TearDownTestSuite() { folder_.reset(); }

  void SetUp() override {
    fs::copy(folder_->path("session"), session(), fs::copy_options::recursive);
    before_ = bytes_of(session());
  }

  static std::vector<std::string> map_command(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {std::string(TRIGPOINT_BIN_DIR) + "/trigpoint", "map"});
    arguments.insert(arguments.end(), {"--config", folder_->path("quick.yaml")});
    return arguments;
  }

  static CommandResult map(const std::vector<std::string>& arguments) {
    return tests::run_command(map_command(arguments), 120s);
  }

  /// By name within the folder.
  static std::map<std::string, std::string> bytes_of(const std::string& folder) {
    std::map<std::string, std::string> bytes;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file()) {
        bytes[fs::relative(entry.path(), folder).string()] = tests::read_file(entry.path());
      }
    }
    return bytes;
  }

  void expect_as_it_was() const {
    const auto after = bytes_of(session());
    EXPECT_EQ(after.size(), before_.size());
    for (const auto& [name, bytes] : before_) {
      EXPECT_TRUE(after.contains(name) && after.at(name) == bytes) << name;
    }
  }

  std::string session() const { return own_.path("s"); }

  /// Another world: the map shows another place.
  static std::vector<std::string> drive_elsewhere() {
    return {"short", "--seed", "2", "--day", "1", "--duration", "8"};
  }

  TemporaryFolder own_;

 private:
  static std::unique_ptr<TemporaryFolder> folder_;
  std::map<std::string, std::string> before_;
};

std::unique_ptr<TemporaryFolder> StoredSession::folder_;

std::vector<std::string> with(std::vector<std::string> arguments,
                              const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST_F(StoredSession, stays_as_it_is_when_the_next_drive_does_not_find_its_place_in_it) {
  const CommandResult first = map(with(drive_elsewhere(), {"--resume", session()}));
  EXPECT_EQ(first.exit_code, 1) << first.output;
  expect_as_it_was();
  const std::string apart = session() + ".not_resumed";
  EXPECT_THAT(first.output,
              AllOf(HasSubstr("was not found in the stored map"),
                    HasSubstr("was not found in the map of " + session() + ", which is as it was"),
                    HasSubstr("trigpoint merge " + session() + " " + apart)));
  EXPECT_TRUE(fs::exists(apart + "/keyframes.sqlite"));
  EXPECT_TRUE(fs::exists(apart + "/map.pcd"));
  // The same again, beside what the first one left.
  const CommandResult second = map(with(drive_elsewhere(), {"--resume", session()}));
  EXPECT_EQ(second.exit_code, 1) << second.output;
  expect_as_it_was();
  EXPECT_TRUE(fs::exists(apart + "-2/keyframes.sqlite"));
}

/// What comes after it may be interrupted.
TEST_F(StoredSession, is_told_to_be_as_it_was_before_the_drive_that_was_not_found_is_mapped) {
  tests::Command mapping(map_command(with(drive_elsewhere(), {"--resume", session()})));
  const std::string told = session() +
                           " is as it was; the new drive becomes a session of its own, about the "
                           "same datum: " +
                           session() + ".not_resumed";
  const auto is_told = [&] { return mapping.output_so_far().find(told) != std::string::npos; };
  EXPECT_TRUE(tests::wait_until([&] { return is_told() || !mapping.running(); }, 60s));
  mapping.signal(SIGINT);
  const CommandResult interrupted = mapping.wait(60s);
  EXPECT_EQ(interrupted.exit_code, 130) << interrupted.output;
  EXPECT_THAT(interrupted.output, HasSubstr(told));
  expect_as_it_was();
}

TEST_F(StoredSession, goes_on_when_the_next_drive_finds_its_place_after_one_that_did_not) {
  ASSERT_EQ(map(with(drive_elsewhere(), {"--resume", session()})).exit_code, 1);
  const CommandResult found =
      map({"short", "--day", "1", "--duration", "8", "--resume", session()});
  EXPECT_EQ(found.exit_code, 0) << found.output;
  EXPECT_THAT(found.output, AllOf(HasSubstr("lio_resumed"), Not(HasSubstr("is as it was"))));
  EXPECT_FALSE(fs::exists(session() + ".not_resumed-2"));
  EXPECT_GT(fs::file_size(session() + "/lio.tum"),
            3 * fs::file_size(session() + ".not_resumed/lio.tum") / 2);
}

TEST_F(StoredSession, is_never_changed_by_who_is_localized_in_it_found_or_not) {
  const CommandResult found = map(
      {"short", "--day", "1", "--duration", "8", "--localize", session(), "--out", own_.path("a")});
  EXPECT_EQ(found.exit_code, 0) << found.output;
  expect_as_it_was();
  const CommandResult lost =
      map(with(drive_elsewhere(), {"--localize", session(), "--out", own_.path("b")}));
  EXPECT_EQ(lost.exit_code, 1) << lost.output;
  EXPECT_THAT(lost.output,
              AllOf(HasSubstr("was not found in the map of " + session() + ", which is as it was"),
                    HasSubstr("what came out in " + own_.path("b"))));
  expect_as_it_was();
}

}  // namespace
}  // namespace trigpoint
