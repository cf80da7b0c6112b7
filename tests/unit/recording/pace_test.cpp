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
  pace.on_lio_status(collecting(3), "mapper");
  EXPECT_TRUE(pace.wait_for_sweeps(3, 0ms));
  EXPECT_FALSE(pace.wait_for_sweeps(4, 0ms));
}

TEST(Pace, waits_for_the_sweeps_that_were_collected_once_they_are_worked_off) {
  Pace pace;
  pace.begin();
  pace.on_lio_status(collecting(9), "mapper");
  for (std::uint64_t used = 1; used <= 9; ++used) {
    pace.on_lio_status(working(10, used), "mapper");
    EXPECT_FALSE(pace.wait_for_sweeps(10, 0ms)) << used;
  }
  pace.on_lio_status(working(10, 10), "mapper");
  EXPECT_TRUE(pace.wait_for_sweeps(10, 0ms));
  EXPECT_FALSE(pace.wait_for_sweeps(11, 0ms)) << "nobody may run ahead by what was collected";
}

TEST(Pace, counts_refused_sweeps_as_done) {
  Pace pace;
  pace.begin();
  LioStatus status = working(5, 3);
  status.scans_refused = {{"imu_gap", 1}, {"no_points", 1}};
  pace.on_lio_status(status, "mapper");
  EXPECT_TRUE(pace.wait_for_sweeps(5, 0ms));
}

TEST(Pace, leaves_out_what_was_done_before_the_first_message) {
  Pace pace;
  pace.on_lio_status(working(20, 20), "mapper");
  pace.begin();
  EXPECT_FALSE(pace.wait_for_sweeps(1, 0ms));
  pace.on_lio_status(working(21, 21), "mapper");
  EXPECT_TRUE(pace.wait_for_sweeps(1, 0ms));
}

TEST(Pace, waits_for_nothing_that_a_mapper_took_along_when_it_died_and_for_all_that_comes_after) {
  Pace pace;
  pace.begin();
  pace.on_lio_status(working(29, 29), "mapper");
  EXPECT_FALSE(pace.wait_for_sweeps(30, 0ms));
  pace.on_lio_status(working(28, 28), "resumed");  // from its checkpoint
  EXPECT_TRUE(pace.wait_for_sweeps(30, 0ms));
  EXPECT_FALSE(pace.wait_for_sweeps(31, 0ms));
  pace.on_lio_status(working(29, 29), "resumed");
  EXPECT_TRUE(pace.wait_for_sweeps(31, 0ms));
}

TEST(Pace, goes_on_counting_when_a_mapper_begins_from_zero) {
  Pace pace;
  pace.begin();
  pace.on_lio_status(working(30, 30), "mapper");
  EXPECT_TRUE(pace.wait_for_sweeps(30, 0ms));
  pace.on_lio_status(working(0, 0), "anew");
  EXPECT_FALSE(pace.wait_for_sweeps(31, 0ms));
  pace.on_lio_status(working(1, 1), "anew");
  EXPECT_TRUE(pace.wait_for_sweeps(31, 0ms));
}

GpsStatus filtered(std::uint64_t received) {
  GpsStatus status;
  status.fixes_received = received;
  return status;
}

TEST(Pace, takes_the_answer_of_one_of_two_gps_filters_and_keeps_their_counts_apart) {
  Pace pace;
  pace.on_gps_status(filtered(3), "a");
  pace.on_gps_status(filtered(0), "b");
  pace.begin();
  EXPECT_FALSE(pace.wait_for_fixes(1, 0ms));
  pace.on_gps_status(filtered(4), "a");
  EXPECT_TRUE(pace.wait_for_fixes(1, 0ms));
  pace.on_gps_status(filtered(1), "b");
  EXPECT_FALSE(pace.wait_for_fixes(2, 0ms));
}

}  // namespace
}  // namespace trigpoint::recording
