// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "datum_election.hpp"

#include "drive.hpp"
#include <gtest/gtest.h>

namespace trigpoint::gps_odometry {
namespace {

CheckedFix checked_at(const Eigen::Vector3d& position, double time_s) {
  return *check_fix(fix_at(position, time_s, 0.02), Config{}).fix;
}

TEST(DatumElection, elects_the_mean_of_ten_fixes) {
  DatumElection election{Config{}};
  std::optional<Datum> datum;
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(datum.has_value());
    datum = election.add(checked_at({static_cast<double>(i), 2.0, 3.0}, i));
  }
  ASSERT_TRUE(datum.has_value());
  const geodesy::LocalFrame frame(test_datum());
  const auto place = frame.to_map({datum->latitude_deg, datum->longitude_deg, datum->height_m});
  EXPECT_LT((*place - Eigen::Vector3d(4.5, 2.0, 3.0)).norm(), 1e-4);
  EXPECT_EQ(datum->elected_ns, stamp_of(9.0));
}

TEST(DatumElection, waits_for_somebody_elses_datum_first) {
  DatumElection election{Config{}};
  std::optional<double> elected_s;
  for (int i = 0; i < 60 && !elected_s; ++i) {
    if (election.add(checked_at({1.0, 2.0, 3.0}, 0.05 * i))) {
      elected_s = 0.05 * i;
    }
  }
  ASSERT_TRUE(elected_s.has_value());
  EXPECT_NEAR(*elected_s, 2.0, 0.051);  // datum_wait_s
}

TEST(DatumElection, starts_over_when_two_fixes_cannot_both_be_right) {
  DatumElection election{Config{}};
  for (int i = 0; i < 9; ++i) {
    ASSERT_FALSE(election.add(checked_at({5000.0, 0.0, 0.0}, i)));
  }
  for (int i = 9; i < 18; ++i) {
    ASSERT_FALSE(election.add(checked_at({0.0, 0.0, 0.0}, i)));
  }
  const auto datum = election.add(checked_at({0.0, 0.0, 0.0}, 18));
  ASSERT_TRUE(datum.has_value());
  EXPECT_NEAR(datum->latitude_deg, test_datum().latitude_deg, 1e-8);
}

TEST(Wins, the_older_election_wins_and_configuration_is_older_than_any) {
  const Datum configured{49.0, 8.0, 0.0, 0};
  const Datum early{49.0, 8.1, 0.0, 100};
  const Datum late{49.0, 8.2, 0.0, 200};
  EXPECT_TRUE(wins(early, late));
  EXPECT_FALSE(wins(late, early));
  EXPECT_TRUE(wins(configured, early));
}

TEST(Wins, two_elections_of_one_moment_are_decided_alike_everywhere) {
  const Datum one{49.0, 8.1, 0.0, 100};
  const Datum other{49.0, 8.2, 0.0, 100};
  EXPECT_NE(wins(one, other), wins(other, one));
}

}  // namespace
}  // namespace trigpoint::gps_odometry
