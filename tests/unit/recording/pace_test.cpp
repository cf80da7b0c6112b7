// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "pace.hpp"

#include <gtest/gtest.h>

namespace trigpoint::recording {
namespace {

using namespace std::chrono_literals;

LioStatus collecting(std::uint64_t received) {
  LioStatus status;
  status.health = LioHealth::kInit;
  status.scans_received = received;
  return status;
}

LioStatus working(std::uint64_t received, std::uint64_t used) {
  LioStatus status;
  status.health = LioHealth::kOk;
  status.scans_received = received;
  status.scans_used = used;
  return status;
}

TEST(Pace, does_not_wait_for_a_mapper_that_collects_sweeps_for_its_start) {
  Pace pace;
  pace.begin();
  pace.on_lio_status(collecting(3));
  EXPECT_TRUE(pace.wait_for_sweeps(3, 0ms));
  EXPECT_FALSE(pace.wait_for_sweeps(4, 0ms));
}

TEST(Pace, waits_for_the_sweeps_that_were_collected_once_they_are_worked_off) {
  Pace pace;
  pace.begin();
  pace.on_lio_status(collecting(9));
  for (std::uint64_t used = 1; used <= 9; ++used) {
    pace.on_lio_status(working(10, used));
    EXPECT_FALSE(pace.wait_for_sweeps(10, 0ms)) << used;
  }
  pace.on_lio_status(working(10, 10));
  EXPECT_TRUE(pace.wait_for_sweeps(10, 0ms));
  EXPECT_FALSE(pace.wait_for_sweeps(11, 0ms)) << "nobody may run ahead by what was collected";
}

TEST(Pace, counts_refused_sweeps_as_done) {
  Pace pace;
  pace.begin();
  LioStatus status = working(5, 3);
  status.scans_refused = {{"imu_gap", 1}, {"no_points", 1}};
  pace.on_lio_status(status);
  EXPECT_TRUE(pace.wait_for_sweeps(5, 0ms));
}

TEST(Pace, leaves_out_what_was_done_before_the_first_message) {
  Pace pace;
  pace.on_lio_status(working(20, 20));
  pace.begin();
  EXPECT_FALSE(pace.wait_for_sweeps(1, 0ms));
  pace.on_lio_status(working(21, 21));
  EXPECT_TRUE(pace.wait_for_sweeps(1, 0ms));
}

TEST(Pace, goes_on_counting_when_the_mapper_was_started_anew) {
  Pace pace;
  pace.begin();
  pace.on_lio_status(working(30, 30));
  pace.on_lio_status(working(2, 2));
  EXPECT_TRUE(pace.wait_for_sweeps(32, 0ms));
  EXPECT_FALSE(pace.wait_for_sweeps(33, 0ms));
}

}  // namespace
}  // namespace trigpoint::recording
