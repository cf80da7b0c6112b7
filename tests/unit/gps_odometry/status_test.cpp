// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "status.hpp"

#include <gtest/gtest.h>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kSureHeading_rad = 0.05;

Track good_track() {
  Track track;
  track.phase = Phase::kRunning;
  track.accepted_ns = 100 * kNanosecondsPerSecond;
  track.fix_interval_s = 0.2;
  return track;
}

GpsHealth health_after(double age_s,
                       const Track& track = good_track(),
                       double yaw_sigma_rad = kSureHeading_rad) {
  const Surroundings around{track.accepted_ns + from_seconds(age_s), true, false, false};
  return health_of(track, yaw_sigma_rad, around, Config{});
}

TEST(Health, follows_the_age_of_the_last_accepted_fix) {
  EXPECT_EQ(health_after(0.3), GpsHealth::kOk);
  EXPECT_EQ(health_after(1.1), GpsHealth::kDeadReckoning);
  EXPECT_EQ(health_after(31.0), GpsHealth::kStale);
}

TEST(Health, does_not_call_a_slow_receiver_an_outage) {
  Track track = good_track();
  track.fix_interval_s = 1.0;
  EXPECT_EQ(health_after(1.5, track), GpsHealth::kOk);
  EXPECT_EQ(health_after(2.6, track), GpsHealth::kDeadReckoning);
}

TEST(Health, is_degraded_until_the_heading_has_converged) {
  EXPECT_EQ(health_after(0.3, good_track(), 0.3), GpsHealth::kDegraded);
}

TEST(Health, is_degraded_after_a_reset_a_refusal_and_with_an_assumed_covariance) {
  Track reset = good_track();
  reset.reset_ns = reset.accepted_ns;
  EXPECT_EQ(health_after(0.3, reset), GpsHealth::kDegraded);
  Track refused = good_track();
  refused.refused_ns = refused.accepted_ns;
  EXPECT_EQ(health_after(0.3, refused), GpsHealth::kDegraded);
  Track assumed = good_track();
  assumed.assumed_covariance = true;
  EXPECT_EQ(health_after(0.3, assumed), GpsHealth::kDegraded);
}

TEST(Health, is_initial_before_datum_imu_or_fix) {
  const Track track = good_track();
  const Surroundings no_datum{track.accepted_ns, false, false, false};
  EXPECT_EQ(health_of(track, kSureHeading_rad, no_datum, Config{}), GpsHealth::kInit);
  const Surroundings around{1, true, false, false};
  EXPECT_EQ(health_of(Track{}, kSureHeading_rad, around, Config{}), GpsHealth::kInit);
}

TEST(Health, tells_a_faulty_and_a_silent_imu) {
  const Track track = good_track();
  const Surroundings faulty{track.accepted_ns, true, true, false};
  EXPECT_EQ(health_of(track, kSureHeading_rad, faulty, Config{}), GpsHealth::kFault);
  const Surroundings silent{track.accepted_ns, true, false, true};
  EXPECT_EQ(health_of(track, kSureHeading_rad, silent, Config{}), GpsHealth::kStale);
}

TEST(Rejections, join_what_messages_and_what_the_filter_refused) {
  Track track;
  track.refused_gate = 3;
  Counters messages;
  messages.add("no_fix");
  const auto counts = rejections_of(track, messages);
  ASSERT_EQ(counts.size(), 2U);
  EXPECT_EQ(counts[0].name, "gate");
  EXPECT_EQ(counts[0].count, 3U);
  EXPECT_EQ(counts[1].name, "no_fix");
}

}  // namespace
}  // namespace trigpoint::gps_odometry
