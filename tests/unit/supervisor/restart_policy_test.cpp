// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/supervisor/restart_policy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <vector>

namespace trigpoint::supervisor {
namespace {

using ::testing::HasSubstr;
using What = Decision::What;

Ending killed_after(double lived_s) {
  return {0, SIGKILL, lived_s, false};
}

Ending ended_with(int code) {
  return {code, 0, 1.0, false};
}

TEST(RestartPolicy, restarts_what_was_killed_and_says_by_which_signal) {
  const Decision decision = RestartPolicy().on_end(killed_after(30.0));
  EXPECT_EQ(decision.what, What::kRestart);
  EXPECT_DOUBLE_EQ(decision.after_s, 0.1);
  EXPECT_THAT(decision.why, HasSubstr("signal 9"));
}

TEST(RestartPolicy, does_not_restart_what_ended_well_or_for_its_configuration) {
  EXPECT_EQ(RestartPolicy().on_end(ended_with(0)).what, What::kEnd);
  EXPECT_EQ(RestartPolicy().on_end(ended_with(2)).what, What::kGiveUp);
  EXPECT_EQ(RestartPolicy().on_end(ended_with(127)).what, What::kGiveUp);
  EXPECT_EQ(RestartPolicy().on_end(ended_with(1)).what, What::kRestart);
}

TEST(RestartPolicy, waits_twice_as_long_after_each_failure_in_quick_succession_and_then_gives_up) {
  RestartPolicy policy;
  std::vector<double> delays_s;
  Decision decision;
  while ((decision = policy.on_end(killed_after(1.0))).what == What::kRestart) {
    delays_s.push_back(decision.after_s);
  }
  EXPECT_EQ(delays_s, (std::vector<double>{0.1, 0.2, 0.4, 0.8, 1.6}));
  EXPECT_EQ(decision.what, What::kGiveUp);
}

TEST(RestartPolicy, never_gives_up_on_what_lives_for_long_between_two_failures) {
  RestartPolicy policy;
  for (int k = 0; k < 100; ++k) {
    const Decision decision = policy.on_end(killed_after(20.0));
    EXPECT_EQ(decision.what, What::kRestart);
    EXPECT_DOUBLE_EQ(decision.after_s, 0.1);
  }
}

TEST(RestartPolicy, takes_no_exit_code_for_an_answer_of_what_hung) {
  const Decision decision = RestartPolicy().on_end({0, SIGKILL, 60.0, true});
  EXPECT_EQ(decision.what, What::kRestart);
  EXPECT_THAT(decision.why, HasSubstr("no longer answered"));
}

}  // namespace
}  // namespace trigpoint::supervisor
