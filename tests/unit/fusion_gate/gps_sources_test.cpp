// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/gps_sources.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::fusion_gate {
namespace {

GpsStatus status_at(double stamp_s, GpsHealth health, double accepted_s = 1.0) {
  GpsStatus status;
  status.stamp_ns = from_seconds(stamp_s);
  status.health = health;
  status.last_accepted_fix_ns = from_seconds(accepted_s);
  return status;
}

TEST(GpsSources, follow_nobody_before_somebody_is_heard) {
  GpsSources sources{Config{}};
  EXPECT_FALSE(sources.select(0));
  EXPECT_EQ(sources.followed(), "");
}

TEST(GpsSources, prefer_health_over_the_newer_fix) {
  GpsSources sources{Config{}};
  sources.on_status(status_at(10.0, GpsHealth::kDegraded, 9.9), "a");
  sources.on_status(status_at(10.0, GpsHealth::kOk, 9.0), "b");
  sources.select(from_seconds(10.0));
  EXPECT_EQ(sources.followed(), "b");
}

TEST(GpsSources, prefer_the_newer_fix_at_equal_health) {
  GpsSources sources{Config{}};
  sources.on_status(status_at(10.0, GpsHealth::kOk, 9.0), "a");
  sources.on_status(status_at(10.0, GpsHealth::kOk, 9.5), "b");
  sources.select(from_seconds(10.0));
  EXPECT_EQ(sources.followed(), "b");
}

TEST(GpsSources, do_not_flap_between_equals) {
  GpsSources sources{Config{}};
  int changes = 0;
  for (int k = 0; k < 100; ++k) {
    const double now_s = 10.0 + 0.1 * k;
    sources.on_status(status_at(now_s, GpsHealth::kOk, now_s), k % 2 == 0 ? "a" : "b");
    changes += sources.select(from_seconds(now_s)) ? 1 : 0;
  }
  EXPECT_EQ(changes, 1);
}

TEST(GpsSources, change_over_when_the_followed_one_goes_silent) {
  GpsSources sources{Config{}};
  sources.on_status(status_at(10.0, GpsHealth::kOk, 10.0), "a");
  sources.on_status(status_at(10.0, GpsHealth::kDegraded, 10.0), "b");
  sources.select(from_seconds(10.0));
  EXPECT_EQ(sources.followed(), "a");
  sources.on_status(status_at(11.5, GpsHealth::kDegraded, 11.5), "b");
  EXPECT_TRUE(sources.select(from_seconds(11.5)));
  EXPECT_EQ(sources.followed(), "b");
}

TEST(GpsSources, change_over_to_a_healthier_one_only_after_the_hold_time) {
  GpsSources sources{Config{}};
  sources.on_status(status_at(10.0, GpsHealth::kOk), "a");
  sources.select(from_seconds(10.0));
  sources.on_status(status_at(10.1, GpsHealth::kDeadReckoning), "a");
  sources.on_status(status_at(10.1, GpsHealth::kOk), "b");
  EXPECT_FALSE(sources.select(from_seconds(10.1)));
  EXPECT_TRUE(sources.select(from_seconds(10.7)));
  EXPECT_EQ(sources.followed(), "b");
}

constexpr double kHandOver_s = 0.5;  // issue: when it dies, stalls or degrades

/// Speaks as the filters do: odometry each time, a status with each fix (5 Hz), when health changes
/// and once a second.
class Speaker {
 public:
  Speaker(GpsSources& sources, std::string name) : sources_(sources), name_(std::move(name)) {}

  void say(double now_s, GpsHealth health, double sigma_m = 0.1) {
    const bool is_fix = health != GpsHealth::kDeadReckoning && now_s > next_fix_s_ - 1e-9;
    if (is_fix) {
      accepted_s_ = now_s;
      next_fix_s_ = now_s + 0.2;
    }
    Odometry odometry;
    odometry.stamp_ns = from_seconds(now_s);
    odometry.pose_covariance.diagonal().head<3>().setConstant(sigma_m * sigma_m);
    sources_.on_odometry(odometry, name_);
    if (is_fix || health != told_ || now_s > told_s_ + 1.0 - 1e-9) {
      sources_.on_status(status_at(now_s, health, accepted_s_), name_);
      told_ = health;
      told_s_ = now_s;
    }
  }

 private:
  GpsSources& sources_;
  std::string name_;
  double accepted_s_{0.0};
  double next_fix_s_{0.0};
  GpsHealth told_{GpsHealth::kInit};
  double told_s_{0.0};
};

/// Two filters at 50 Hz, `a` is followed. At 20 s something happens to it.
class TwoFilters : public ::testing::Test {
 protected:
  enum class Event { kDies, kRepeatsItself, kDegrades, kReckonsDead, kGrowsUncertain };

  /// Seconds until `b` is followed; NaN when it never was.
  double hand_over_s(Event event, double filter_hz = 50.0, double sigma_of_b_m = 0.1) {
    GpsSources sources{Config{}};
    Speaker a{sources, "a"};
    Speaker b{sources, "b"};
    for (int k = 0; k < 1200; ++k) {
      const double now_s = 10.0 + k / filter_hz;
      if (now_s < kHappens_s) {
        a.say(now_s, GpsHealth::kOk);
      } else if (event != Event::kDies) {
        const bool repeats = event == Event::kRepeatsItself;
        a.say(repeats ? kHappens_s : now_s,
              event == Event::kDegrades      ? GpsHealth::kDegraded
              : event == Event::kReckonsDead ? GpsHealth::kDeadReckoning
                                             : GpsHealth::kOk,
              event == Event::kGrowsUncertain ? 0.6 : 0.1);
      }
      sources.select(from_seconds(now_s));
      if (sources.followed() == "b") {
        return now_s - kHappens_s;
      }
      if (k > 0) {
        b.say(now_s, GpsHealth::kOk, sigma_of_b_m);
      }
    }
    return kNaN;
  }

  void expect_hand_over_in_time(Event event) {
    EXPECT_GE(hand_over_s(event), 0.0);
    EXPECT_LT(hand_over_s(event), kHandOver_s);
  }

  static constexpr double kHappens_s = 20.0;
};

TEST_F(TwoFilters, change_over_within_half_a_second_when_the_followed_one_dies) {
  expect_hand_over_in_time(Event::kDies);
}

TEST_F(TwoFilters, change_over_within_half_a_second_when_the_followed_one_stalls) {
  expect_hand_over_in_time(Event::kRepeatsItself);
}

TEST_F(TwoFilters, change_over_within_half_a_second_when_the_followed_one_degrades) {
  expect_hand_over_in_time(Event::kDegrades);
}

TEST_F(TwoFilters, change_over_within_half_a_second_when_the_followed_one_says_dead_reckoning) {
  expect_hand_over_in_time(Event::kReckonsDead);
}

TEST_F(TwoFilters,
       change_over_within_half_a_second_when_only_the_followed_ones_sigma_is_too_large) {
  expect_hand_over_in_time(Event::kGrowsUncertain);
}

TEST_F(TwoFilters, stay_where_they_are_when_both_sigmas_are_too_large) {
  EXPECT_TRUE(std::isnan(hand_over_s(Event::kGrowsUncertain, 50.0, 0.6)));
}

TEST_F(TwoFilters, that_speak_once_a_second_are_not_taken_for_dead_between_two_words) {
  EXPECT_GT(hand_over_s(Event::kDies, 1.0), 0.5);
}

TEST(GpsSources, do_not_take_a_first_stamp_of_zero_for_a_usual_gap) {
  GpsSources sources{Config{}};
  sources.on_status(status_at(0.0, GpsHealth::kInit), "a");
  for (int k = 0; k < 500; ++k) {
    const double now_s = 1.7e9 + 0.02 * k;
    sources.on_status(status_at(now_s, GpsHealth::kOk, now_s), "a");
    sources.on_status(status_at(now_s, GpsHealth::kDegraded, now_s), "b");
    sources.select(from_seconds(now_s));
  }
  ASSERT_EQ(sources.followed(), "a");
  const double later_s = 1.7e9 + 10.0 + kHandOver_s;
  sources.on_status(status_at(later_s, GpsHealth::kDegraded, later_s), "b");
  EXPECT_TRUE(sources.select(from_seconds(later_s)));
}

TEST(GpsSources, do_not_leave_a_silent_one_for_one_that_is_of_no_use) {
  GpsSources sources{Config{}};
  sources.on_status(status_at(10.0, GpsHealth::kOk), "a");
  sources.select(from_seconds(10.0));
  sources.on_status(status_at(10.6, GpsHealth::kStale), "b");
  EXPECT_FALSE(sources.select(from_seconds(10.6)));
  EXPECT_EQ(sources.followed(), "a");
}

TEST(GpsSources, forget_writers_that_died_long_ago) {
  GpsSources sources{Config{}};
  sources.on_status(status_at(10.0, GpsHealth::kOk), "dead");
  sources.on_status(status_at(100.0, GpsHealth::kOk), "alive");
  sources.select(from_seconds(100.0));
  EXPECT_EQ(sources.find("dead"), nullptr);
  EXPECT_NE(sources.find("alive"), nullptr);
}

TEST(GpsSources, follow_nobody_when_all_are_silent) {
  GpsSources sources{Config{}};
  sources.on_status(status_at(10.0, GpsHealth::kOk), "a");
  sources.select(from_seconds(10.0));
  EXPECT_TRUE(sources.select(from_seconds(12.0)));
  EXPECT_EQ(sources.followed(), "");
}

TEST(GpsSources, refuse_odometry_that_is_not_finite_or_goes_back) {
  GpsSources sources{Config{}};
  Odometry odometry;
  odometry.stamp_ns = from_seconds(10.0);
  EXPECT_FALSE(sources.on_odometry(odometry, "a"));
  odometry.stamp_ns = from_seconds(9.0);
  EXPECT_TRUE(sources.on_odometry(odometry, "a"));
  odometry.stamp_ns = from_seconds(11.0);
  odometry.T_frame_child.p.x() = std::nan("");
  EXPECT_TRUE(sources.on_odometry(odometry, "a"));
}

}  // namespace
}  // namespace trigpoint::fusion_gate
