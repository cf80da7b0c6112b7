// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// trigpoint_supervise as a program, over small shell scripts.
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <thread>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using tests::Command;
using tests::CommandResult;
using tests::TemporaryFolder;

class Supervise : public ::testing::Test {
 protected:
  /// `script` is run by sh; it may count its lives in the file "lives".
  std::vector<std::string> command(const std::string& script,
                                   const std::vector<std::string>& options = {}) const {
    std::vector<std::string> all{std::string(TRIGPOINT_BIN_DIR) + "/trigpoint_supervise",
                                 "--name",
                                 "patient",
                                 "--log",
                                 folder_.path("log"),
                                 "--records",
                                 folder_.path("records"),
                                 "--pid-file",
                                 folder_.path("pid")};
    all.insert(all.end(), options.begin(), options.end());
    all.insert(all.end(),
               {"--", "sh", "-c", "cd " + folder_.path() + "; echo life >> lives; " + script});
    return all;
  }

  std::ptrdiff_t lives() const {
    const std::string text = tests::read_file(folder_.path("lives"));
    return std::count(text.begin(), text.end(), '\n');
  }

  bool wait_for_lives(std::ptrdiff_t n) const {
    for (int i = 0; i < 1000 && lives() < n; ++i) {
      std::this_thread::sleep_for(10ms);
    }
    return lives() >= n;
  }

  pid_t child() const { return std::stoi(tests::read_file(folder_.path("pid"))); }

  TemporaryFolder folder_;
};

/// Says READY=1 once, then does something else. systemd-notify is not everywhere; python3 is, for
/// the architecture tests.
std::string promise_and(const std::string& deed) {
  return "python3 -c 'import os,socket; s=socket.socket(socket.AF_UNIX,socket.SOCK_DGRAM); "
         "s.sendto(b\"READY=1\",\"\\0\"+os.environ[\"NOTIFY_SOCKET\"][1:])'; " +
         deed;
}

TEST_F(Supervise, starts_again_what_was_killed_and_says_so_everywhere) {
  Command supervisor(command("exec sleep 60"));
  ASSERT_TRUE(wait_for_lives(1));
  std::this_thread::sleep_for(100ms);
  kill(child(), SIGKILL);
  ASSERT_TRUE(wait_for_lives(2));
  supervisor.signal(SIGTERM);
  const CommandResult ended = supervisor.wait(10s);
  EXPECT_THAT(ended.output, HasSubstr("patient was killed by signal 9"));
  EXPECT_THAT(tests::read_file(folder_.path("log")), HasSubstr("] error patient was killed by"));
  EXPECT_THAT(tests::read_file(folder_.path("records")),
              AllOf(HasSubstr("unix_s,program,restarted"), HasSubstr(",patient,1,")));
}

TEST_F(Supervise, gives_up_what_fails_at_once_each_time) {
  const CommandResult ended = tests::run_command(command("exit 3"), 30s);
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_EQ(lives(), 6);
  EXPECT_THAT(ended.output, HasSubstr("in quick succession; giving up"));
  EXPECT_THAT(tests::read_file(folder_.path("records")), HasSubstr(",patient,0,"));
}

TEST_F(Supervise, does_not_start_again_what_ended_well_or_was_configured_wrongly) {
  EXPECT_EQ(tests::run_command(command("exit 0"), 10s).exit_code, 0);
  EXPECT_EQ(lives(), 1);
  EXPECT_EQ(tests::run_command(command("exit 2"), 10s).exit_code, 2);
  EXPECT_EQ(lives(), 2);
}

TEST_F(Supervise, kills_and_restarts_what_promised_to_answer_and_does_not) {
  Command supervisor(command(promise_and("exec sleep 60"), {"--watchdog", "0.5"}));
  ASSERT_TRUE(wait_for_lives(2)) << supervisor.output_so_far();
  EXPECT_THAT(supervisor.output_so_far(), HasSubstr("has not answered for 0.5 s: killing it"));
}

TEST_F(Supervise, finds_out_sooner_about_what_stands_still) {
  Command supervisor(command(promise_and("exec sleep 60"), {"--watchdog", "50", "--still", "0.5"}));
  ASSERT_TRUE(wait_for_lives(2)) << supervisor.output_so_far();
  EXPECT_THAT(supervisor.output_so_far(), HasSubstr("has not answered for 0.5 s: killing it"));
}

TEST_F(Supervise, finds_out_sooner_about_what_was_stopped) {
  Command supervisor(
      command(promise_and("while :; do :; done"), {"--watchdog", "50", "--still", "0.5"}));
  ASSERT_TRUE(wait_for_lives(1));
  std::this_thread::sleep_for(1s);
  kill(child(), SIGSTOP);
  ASSERT_TRUE(wait_for_lives(2)) << supervisor.output_so_far();
}

TEST_F(Supervise, has_more_patience_with_what_works) {
  Command supervisor(
      command(promise_and("while :; do :; done"), {"--watchdog", "50", "--still", "0.5"}));
  ASSERT_TRUE(wait_for_lives(1));
  std::this_thread::sleep_for(3s);
  EXPECT_EQ(lives(), 1) << supervisor.output_so_far();
}

TEST_F(Supervise, has_as_much_patience_as_it_is_asked_for) {
  const std::string ask =
      "python3 -c 'import os,socket; s=socket.socket(socket.AF_UNIX,socket.SOCK_DGRAM); "
      "s.sendto(b\"WATCHDOG_USEC=30000000\\nWATCHDOG=1\",\"\\0\"+os.environ[\"NOTIFY_SOCKET\"][1:])"
      "'; "
      "exec sleep 60";
  Command supervisor(command(ask, {"--watchdog", "0.3", "--still", "0.2"}));
  ASSERT_TRUE(wait_for_lives(1));
  std::this_thread::sleep_for(2s);
  EXPECT_EQ(lives(), 1) << supervisor.output_so_far();
}

TEST_F(Supervise, leaves_alone_what_never_promised_to_answer) {
  Command supervisor(command("exec sleep 60", {"--watchdog", "0.3"}));
  ASSERT_TRUE(wait_for_lives(1));
  std::this_thread::sleep_for(1s);
  EXPECT_EQ(lives(), 1);
}

TEST_F(Supervise, hands_sigterm_on_waits_and_returns_the_programs_code) {
  Command supervisor(
      command("trap 'sleep 0.3; echo closed >> done; exit 7' TERM; while :; do sleep 0.05; done"));
  ASSERT_TRUE(wait_for_lives(1));
  std::this_thread::sleep_for(300ms);
  supervisor.signal(SIGTERM);
  EXPECT_EQ(supervisor.wait(10s).exit_code, 7);
  EXPECT_EQ(tests::read_file(folder_.path("done")), "closed\n");
}

TEST_F(Supervise, ends_what_does_not_stop_also_when_it_hangs) {
  Command supervisor(
      command("trap '' TERM; while :; do sleep 0.05; done", {"--stop-timeout", "0.5"}));
  ASSERT_TRUE(wait_for_lives(1));
  std::this_thread::sleep_for(300ms);
  supervisor.signal(SIGTERM);
  const CommandResult ended = supervisor.wait(10s);
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_THAT(ended.output, HasSubstr("does not stop: killing it"));
}

TEST_F(Supervise, takes_its_program_along_when_it_is_killed_itself) {
  Command supervisor(command("exec sleep 60"));
  ASSERT_TRUE(wait_for_lives(1));
  std::this_thread::sleep_for(200ms);
  const pid_t patient = child();
  supervisor.signal(SIGKILL);
  bool gone = false;
  for (int i = 0; i < 500 && !gone; ++i) {
    // Whoever inherits it may never reap it: a zombie counts as gone.
    const std::string stat = tests::read_file("/proc/" + std::to_string(patient) + "/stat");
    gone = stat.empty() || stat.find(") Z ") != std::string::npos;
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_TRUE(gone);
}

TEST_F(Supervise, says_what_cannot_be_started) {
  const CommandResult ended = tests::run_command(
      {std::string(TRIGPOINT_BIN_DIR) + "/trigpoint_supervise", "--", "/no/such/program"}, 10s);
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_THAT(ended.output, AllOf(HasSubstr("No such file"), HasSubstr("cannot be started")));
  EXPECT_EQ(tests::run_command({std::string(TRIGPOINT_BIN_DIR) + "/trigpoint_supervise"}).exit_code,
            2);
}

// As containers with the host's network do: one network, and everybody is process 1.
TEST_F(Supervise, runs_beside_another_one_of_the_same_number) {
  const std::vector<std::string> apart{"unshare", "--pid", "--fork", "--kill-child"};
  std::vector<std::string> probe = apart;
  probe.emplace_back("true");
  if (tests::run_command(probe).exit_code != 0) {
    GTEST_SKIP() << "no process numbers of one's own here (unshare --pid, by root)";
  }
  std::vector<std::string> first = apart;
  const std::vector<std::string> patient = command("exec sleep 60");
  first.insert(first.end(), patient.begin(), patient.end());
  const Command running(first);
  ASSERT_TRUE(wait_for_lives(1));
  std::vector<std::string> second = apart;
  const std::vector<std::string> quick = command("exit 0");
  second.insert(second.end(), quick.begin(), quick.end());
  const CommandResult ended = tests::run_command(second);
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
}

}  // namespace
}  // namespace trigpoint
