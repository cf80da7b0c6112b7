// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Mode smooth against receivers that lie; bounds are those of the project's goals for a drive.
#include "lying_drive.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::fusion_gate {
namespace {

using testing::HasSubstr;

constexpr double kLargestStep_m = 0.05;  // in 100 ms

class SmoothMode : public testing::TestWithParam<std::uint64_t> {
 protected:
  SmoothMode() {
    settings.seed = GetParam();
    settings.config.mode = "smooth";
    const double direction_rad = 2.4 * static_cast<double>(GetParam());
    aside = {std::cos(direction_rad), std::sin(direction_rad), 0.0};
  }

  LyingDriveSettings settings;
  Eigen::Vector3d aside;  // of unit length, level
};

double smooth_step(double share) {
  const double u = std::clamp(share, 0.0, 1.0);
  return u * u * (3.0 - 2.0 * u);
}

/// The newest status at a time.
const FusionStatus& status_at(const LyingDrive& drive, double at_s) {
  const auto later =
      std::find_if(drive.statuses.begin(), drive.statuses.end(), [&](const FusionStatus& status) {
        return to_seconds(status.stamp_ns) - 1000.0 > at_s;
      });
  return later == drive.statuses.begin() ? drive.statuses.front() : *std::prev(later);
}

TEST_P(SmoothMode, uses_every_fix_of_a_receiver_that_is_as_good_as_it_says) {
  LyingDrive drive(settings);
  drive.run();
  EXPECT_GT(drive.share_used(0, 10.0, 149.0), 0.99);
  EXPECT_GT(drive.share_used(2, 10.0, 149.0), 0.99);
  EXPECT_LT(drive.rms(0, 2), 0.06);
  EXPECT_LT(drive.largest_step_m(), kLargestStep_m);
}

TEST_P(SmoothMode, refuses_a_wrong_fix_at_once_and_says_why) {
  const double size_m = 2.0 + static_cast<double>(GetParam() % 4) * 2.0;
  settings.lie_enu_m = [=, this](double at_s) {
    return Eigen::Vector3d((at_s >= 70.0 && at_s < 100.0 ? size_m : 0.0) * aside);
  };
  LyingDrive drive(settings);
  drive.run();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(drive.share_used(axis, 70.0, 100.0), 0.0) << axis;
  }
  EXPECT_GT(drive.share_used(0, 112.0, 149.0), 0.99);
  EXPECT_LT(drive.worst(0, 2), 0.3);
  EXPECT_LT(drive.largest_step_m(), kLargestStep_m);
  const FusionStatus& lying = status_at(drive, 85.0);
  EXPECT_EQ(lying.axes[0].source, AxisSource::kLio);
  EXPECT_THAT(lying.axes[0].reason, HasSubstr("is off by"));
  EXPECT_THAT(lying.verdict.reason, HasSubstr("is off by"));
}

TEST_P(SmoothMode, takes_back_what_a_wandering_fix_did_before_it_was_found_out) {
  for (const double way_s : {20.0, 40.0}) {
    settings.lie_enu_m = [=, this](double at_s) {
      const double share =
          smooth_step((at_s - 50.0) / way_s) - smooth_step((at_s - 50.0 - way_s) / way_s);
      return Eigen::Vector3d(5.0 * share * aside);
    };
    LyingDrive drive(settings);
    drive.run();
    EXPECT_LT(drive.worst(0, 2), 0.5) << way_s;
    EXPECT_LT(drive.worst(0, 1, 145.0), 0.15) << way_s;  // believed again
    EXPECT_TRUE(drive.has_event("gps_doubted"));
    EXPECT_TRUE(drive.has_event("gps_readmitted"));
    EXPECT_LT(drive.largest_step_m(), kLargestStep_m);
  }
}

TEST_P(SmoothMode, keeps_east_and_north_when_only_the_height_lies) {
  for (const double rate_mps : {0.0, 0.1}) {
    settings.lie_enu_m = [=](double at_s) {
      const double step_m = rate_mps > 0.0 ? rate_mps * (at_s - 60.0) : 30.0;
      return Eigen::Vector3d(0.0, 0.0, at_s >= 60.0 ? step_m : 0.0);
    };
    LyingDrive drive(settings);
    drive.run();
    EXPECT_LT(drive.rms(0, 1), 0.08);
    EXPECT_GT(drive.share_used(0, 60.0, 149.0), 0.99);
    EXPECT_EQ(drive.share_used(2, 75.0, 149.0), 0.0);
    for (const DriveSample& sample : drive.samples) {
      ASSERT_LT(std::abs(sample.error_m.z()), 0.003 * sample.distance_m + 0.1) << sample.at_s;
    }
    EXPECT_LT(drive.largest_step_m(), kLargestStep_m);
  }
}

TEST_P(SmoothMode, aligns_anew_within_20_m_after_a_wrong_fix_at_the_start) {
  settings.lie_enu_m = [this](double at_s) {
    return Eigen::Vector3d((at_s < 30.0 ? 5.0 : 0.0) * aside);
  };
  LyingDrive drive(settings);
  drive.run();
  EXPECT_TRUE(drive.has_event("realigned"));
  for (const DriveSample& sample : drive.samples) {
    if (sample.at_s > 30.0 + 20.0 / settings.speed_mps) {
      ASSERT_LT(sample.raw_error_m.norm(), 0.2) << sample.at_s;
    }
  }
  EXPECT_LT(drive.worst(0, 2, 30.0 + 5.0 / 0.3 + 20.0 / settings.speed_mps), 0.2);
  EXPECT_LT(drive.largest_step_m(), kLargestStep_m);
}

TEST_P(SmoothMode, keeps_a_young_alignment_that_fixes_confirmed_after_an_outage) {
  settings.duration_s = 80.0;
  settings.has_fix = [](double at_s) { return at_s < 15.0 || at_s >= 25.0; };
  settings.lie_enu_m = [this](double at_s) {
    return Eigen::Vector3d((at_s >= 32.0 && at_s < 60.0 ? 3.0 : 0.0) * aside);
  };
  LyingDrive drive(settings);
  drive.run();
  EXPECT_FALSE(drive.has_event("realigned"));
  EXPECT_LT(drive.worst(0, 2), 0.3);
}

TEST_P(SmoothMode, does_not_follow_a_wanderer_that_stands_still_while_the_alignment_is_young) {
  settings.duration_s = 80.0;
  settings.has_fix = [](double at_s) { return at_s < 20.0 || at_s >= 35.0; };
  settings.lie_enu_m = [this](double at_s) {
    return Eigen::Vector3d(5.0 * smooth_step((at_s - 25.0) / 25.0) * aside);
  };
  LyingDrive drive(settings);
  drive.run();
  EXPECT_FALSE(drive.has_event("realigned"));
  EXPECT_LT(drive.worst(0, 2), 0.4);
}

TEST_P(SmoothMode, does_not_follow_a_slow_creeper_while_the_alignment_is_young) {
  settings.duration_s = 120.0;
  settings.lie_enu_m = [this](double at_s) {
    const double share = std::clamp((at_s - 25.0) / 40.0, 0.0, 1.0);
    return Eigen::Vector3d(2.0 * share * aside);
  };
  LyingDrive drive(settings);
  drive.run();
  EXPECT_TRUE(drive.has_event("taken_back"));
  EXPECT_FALSE(drive.has_event("realigned"));
  EXPECT_LT(drive.worst(0, 1, 0.0, 65.0), 0.7);  // while it creeps
}

TEST_P(SmoothMode, is_back_in_5_s_when_gps_returns_after_an_outage_with_half_a_percent_of_drift) {
  settings.speed_mps = 1.2;
  settings.duration_s = 190.0;
  settings.has_fix = [](double at_s) { return at_s < 45.0 || at_s >= 165.0; };
  settings.lio_jump_at_s = 100.0;
  settings.lio_jump_m = 0.005 * 1.2 * 120.0 * aside;
  LyingDrive drive(settings);
  drive.run();
  EXPECT_LT(drive.worst(0, 2, 45.0, 165.0), 0.5 / 100.0 * 1.2 * 120.0 + 0.4);
  EXPECT_LT(drive.worst(0, 1, 170.2), 0.1);
  EXPECT_THAT(status_at(drive, 120.0).axes[1].reason, HasSubstr("no accepted fix for"));
}

TEST_P(SmoothMode, lets_gps_carry_the_axis_along_which_lio_is_blind) {
  settings.is_blind = [](double at_s) { return at_s >= 60.0 && at_s < 90.0; };
  settings.speed_blind_share = 0.06;  // as measured in components/simulator's tunnel
  settings.claimed_sigma_m = 0.3;     // twice that is above the threshold
  settings.duration_s = 120.0;
  LyingDrive drive(settings);
  drive.run();
  EXPECT_LT(drive.worst(0, 1, 60.0, 90.0), 0.4);
  settings.config.mode = "hard";
  LyingDrive hard(settings);
  hard.run();
  EXPECT_GT(hard.worst(0, 1, 60.0, 90.0), 1.0);
}

TEST_P(SmoothMode, coasts_and_says_so_where_lio_is_blind_and_gps_is_away) {
  settings.is_blind = [](double at_s) { return at_s >= 60.0 && at_s < 80.0; };
  settings.has_fix = [](double at_s) { return at_s < 60.0 || at_s >= 80.0; };
  settings.T_map_odom.yaw_rad = 0.0;
  settings.duration_s = 100.0;
  LyingDrive drive(settings);
  drive.run();
  EXPECT_THAT(status_at(drive, 70.0).axes[0].reason, HasSubstr("coasting"));
  EXPECT_GT(drive.share_used(0, 82.0, 99.0), 0.9);
}

/// A receiver that wanders by a metre at a stated centimetre is found out where LIO sees; where LIO
/// is blind it is still worth that metre, and LIO slides by more.
TEST_P(SmoothMode, is_carried_by_a_receiver_that_lies_by_less_than_lio_slides) {
  settings.is_blind = [](double at_s) { return at_s >= 70.0 && at_s < 130.0; };
  settings.speed_blind_share = 0.2;
  settings.lie_enu_m = [](double at_s) {
    const double size_m = at_s < 50.0 ? 0.0 : 1.2;
    return Eigen::Vector3d(size_m * std::sin(0.5 * at_s), size_m * std::cos(0.4 * at_s), 0.0);
  };
  LyingDrive drive(settings);
  drive.run();
  EXPECT_TRUE(drive.has_event("gps_doubted"));
  EXPECT_LT(drive.share_used(0, 55.0, 70.0), 0.05) << "LIO sees";
  EXPECT_THAT(status_at(drive, 100.0).axes[0].reason, HasSubstr("LIO is blind along it"));
  EXPECT_LT(drive.worst(0, 1, 70.0, 130.0), 8.0);
  double most_sigmas = 0.0;
  for (const DriveSample& sample : drive.samples) {
    if (sample.at_s >= 70.0 && sample.at_s < 130.0) {
      most_sigmas =
          std::max(most_sigmas, sample.error_m.head<2>().norm() / sample.sigma_m.head<2>().norm());
    }
  }
  EXPECT_LT(most_sigmas, 3.0);
  std::printf(
      "a liar and a blind LIO: %.2f m, %.1f sigma\n", drive.worst(0, 1, 70.0, 130.0), most_sigmas);
}

TEST_P(SmoothMode, does_not_lock_itself_out_after_a_drift_of_one_percent) {
  settings.has_fix = [](double at_s) { return at_s < 60.0 || at_s >= 110.0; };
  settings.lio_jump_at_s = 80.0;
  settings.lio_jump_m = 0.01 * 3.0 * 50.0 * aside;
  LyingDrive drive(settings);
  drive.run();
  EXPECT_LT(drive.worst(0, 1, 130.0), 0.1);
}

/// LIO slides 3 m along its blind axis; the mapper is sure of itself, as the real one is, and gives
/// rows no weight.
LyingDriveSettings slides_without_gps(LyingDriveSettings settings) {
  settings.mapper_walk_m_per_sqrt_m = 0.005;
  settings.mapper_knows_blindness = false;
  settings.is_blind = [](double at_s) { return at_s >= 60.0 && at_s < 80.0; };
  settings.lio_jump_at_s = 70.0;
  settings.lio_jump_m = {3.0, 0.0, 0.0};
  settings.has_fix = [](double at_s) { return at_s < 55.0 || at_s >= 85.0; };
  return settings;
}

double worst_raw_m(const LyingDrive& drive, double from_s) {
  double worst_m = 0.0;
  for (const DriveSample& sample : drive.samples) {
    worst_m =
        sample.at_s < from_s ? worst_m : std::max(worst_m, sample.raw_error_m.head<2>().norm());
  }
  return worst_m;
}

TEST_P(SmoothMode, is_placed_anew_after_lio_slid_without_gps_where_it_was_blind) {
  LyingDrive drive(slides_without_gps(settings));
  drive.run();
  ASSERT_GT(drive.worst(0, 1, 80.0, 85.0), 1.0) << "LIO did slide";
  EXPECT_TRUE(drive.has_event("placed_anew"));
  EXPECT_LT(worst_raw_m(drive, 85.0 + 2.0), 0.15);
  EXPECT_LT(drive.worst(0, 1, 102.0), 0.15);
  EXPECT_GT(drive.share_used(0, 90.0, 149.0), 0.95);
  EXPECT_LT(drive.largest_step_m(80.0), kLargestStep_m);
}

/// However the fixes come back, T_map_odom goes where they say and not past it.
TEST_P(SmoothMode, is_not_thrown_past_the_truth_after_a_slide_by_late_fixes_or_slow_receivers) {
  LyingDriveSettings late = slides_without_gps(settings);
  late.delay_s = [](std::size_t) { return 0.5; };
  LyingDriveSettings silent = slides_without_gps(settings);
  silent.sends_no_fix = true;
  LyingDriveSettings slow = slides_without_gps(settings);
  slow.fix_interval_s = 1.0;
  for (LyingDriveSettings variant : {late, silent, slow}) {
    const double settled_s = 85.0 + 5.0 * variant.fix_interval_s + 1.7;
    for (const bool honest : {false, true}) {
      SCOPED_TRACE(testing::Message() << "interval " << variant.fix_interval_s << ", no-fix "
                                      << variant.sends_no_fix << ", honest mapper " << honest);
      variant.mapper_knows_blindness = honest;
      LyingDrive drive(variant);
      drive.run();
      EXPECT_LT(worst_raw_m(drive, settled_s), 0.2);
      EXPECT_TRUE(!honest || !drive.has_event("placed_anew"));
    }
  }
}

TEST_P(SmoothMode, recovers_from_wrong_fixes_that_placed_it_anew_after_a_slide) {
  LyingDriveSettings wrong = slides_without_gps(settings);
  const Eigen::Vector3d along_blind_axis = wrong.T_map_odom.pose().q * Eigen::Vector3d::UnitX();
  wrong.lie_enu_m = [=](double at_s) {
    return Eigen::Vector3d((at_s >= 85.0 && at_s < 95.0 ? 8.0 : 0.0) * along_blind_axis);
  };
  LyingDrive drive(wrong);
  drive.run();
  EXPECT_TRUE(drive.has_event("placed_anew"));
  EXPECT_TRUE(drive.has_event("realigned"));
  EXPECT_LT(worst_raw_m(drive, 95.0 + 20.0 / wrong.speed_mps), 0.25);
}

TEST_P(SmoothMode, does_not_take_a_wrong_fix_for_a_slide_when_gps_comes_back_with_it) {
  settings.has_fix = [](double at_s) { return at_s < 60.0 || at_s >= 75.0; };
  settings.lie_enu_m = [this](double at_s) {
    return Eigen::Vector3d((at_s >= 70.0 && at_s < 100.0 ? 3.0 : 0.0) * aside);
  };
  LyingDrive drive(settings);
  drive.run();
  EXPECT_FALSE(drive.has_event("placed_anew"));
  EXPECT_LT(drive.worst(0, 2), 0.3);
}

TEST_P(SmoothMode, aligns_anew_when_a_silence_follows_soon_on_the_end_of_a_wrong_fix) {
  settings.lie_enu_m = [this](double at_s) {
    return Eigen::Vector3d((at_s < 30.0 ? 5.0 : 0.0) * aside);
  };
  settings.has_fix = [](double at_s) { return at_s < 32.0 || at_s >= 45.0; };
  LyingDrive drive(settings);
  drive.run();
  EXPECT_TRUE(drive.has_event("realigned"));
  for (const DriveSample& sample : drive.samples) {
    if (sample.at_s > 45.0 + 20.0 / settings.speed_mps) {
      ASSERT_LT(sample.raw_error_m.norm(), 0.25) << sample.at_s;
    }
  }
}

/// As eskf18 does: the first fixes after a jump are refused by the filter, the next ones absorbed.
TEST_P(SmoothMode, counts_what_the_filter_refused_when_it_aligns_anew) {
  settings.speed_mps = 2.3;
  settings.lie_enu_m = [this](double at_s) {
    return Eigen::Vector3d((at_s < 29.95 ? 5.0 : 0.0) * aside);
  };
  settings.is_refused = [](double at_s) { return at_s > 29.95 && at_s < 30.75; };
  settings.has_fix = [](double at_s) { return at_s < 34.5; };
  settings.duration_s = 40.0;
  LyingDrive drive(settings);
  drive.run();
  EXPECT_TRUE(drive.has_event("realigned"));
}

/// What LIO cannot have drifted and says that it did not slide.
TEST_P(SmoothMode, gives_in_to_fixes_that_agree_for_five_minutes_however_long_it_was_right) {
  settings.duration_s = 600.0;
  settings.has_fix = [](double at_s) { return at_s < 200.0 || at_s >= 210.0; };
  settings.lio_jump_at_s = 205.0;
  settings.lio_jump_m = 12.0 * aside;
  LyingDrive drive(settings);
  drive.run();
  EXPECT_TRUE(drive.has_event("realigned"));
  EXPECT_LT(drive.worst(0, 1, 560.0), 0.15);
}

TEST_P(SmoothMode, does_not_give_in_to_a_few_fixes_before_and_after_a_long_silence) {
  settings.duration_s = 620.0;
  settings.has_fix = [](double at_s) {
    return at_s < 200.0 || (at_s >= 210.0 && at_s < 240.0) || at_s >= 560.0;
  };
  settings.lio_jump_at_s = 205.0;
  settings.lio_jump_m = 12.0 * aside;
  LyingDrive drive(settings);
  drive.run();
  EXPECT_FALSE(drive.has_event("realigned"));
}

/// Late by half a second, three in ten by up to as much again.
double shuffling_delay_s(std::size_t fix) {
  return 0.5 + (fix % 10 < 3 ? 0.1 + 0.17 * static_cast<double>(fix % 4) : 0.0);
}

/// Fixes of whose verdict or rows the two drives do not agree.
std::size_t judged_otherwise(const LyingDrive& a, const LyingDrive& b, double until_s) {
  std::size_t count = 0;
  for (const auto& [stamp_ns, verdict] : a.verdicts) {
    const double at_s = to_seconds(stamp_ns) - 1000.0;
    const auto other = b.verdicts.find(stamp_ns);
    const long long tick = std::llround(at_s / 0.01);
    const auto rows_of = [&](const LyingDrive& drive) {
      const auto found = drive.used.find(tick);
      return found == drive.used.end() ? std::array<bool, 3>{} : found->second;
    };
    if (at_s < until_s && (other == b.verdicts.end() || other->second.used != verdict.used ||
                           rows_of(a) != rows_of(b))) {
      ++count;
    }
  }
  return count;
}

TEST_P(SmoothMode, judges_late_and_shuffled_fixes_as_it_judges_sorted_ones) {
  settings.lie_enu_m = [=, this](double at_s) {
    return Eigen::Vector3d((at_s >= 70.0 && at_s < 100.0 ? 4.0 : 0.0) * aside);
  };
  LyingDrive sorted(settings);
  sorted.run();
  settings.delay_s = shuffling_delay_s;
  LyingDrive shuffled(settings);
  shuffled.run();
  const double end_s = settings.duration_s - 3.0;
  EXPECT_GT(sorted.verdicts.size(), 700U);
  EXPECT_EQ(judged_otherwise(sorted, shuffled, end_s), 0U);
  EXPECT_EQ(shuffled.count("behind_newer_fix"), 0U);
  // A filter that tells of its newest accepted fix only cannot be judged so.
  settings.with_records = false;
  LyingDrive newest_only(settings);
  newest_only.run();
  EXPECT_GT(judged_otherwise(sorted, newest_only, end_s), 50U);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SmoothMode, testing::Values(11, 12, 13));

}  // namespace
}  // namespace trigpoint::fusion_gate
