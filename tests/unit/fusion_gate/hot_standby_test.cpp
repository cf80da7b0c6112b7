// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Two GPS filters at once, and GPS alone carries fusion/odometry: what the change between them
// shows to who follows it. Where LIO carries, a filter never moves fusion/odometry but by its rows.
#include "trigpoint/fusion_gate/fusion_gate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

namespace trigpoint::fusion_gate {
namespace {

constexpr double kStandbyHandOver_s = 0.5;  // issue
constexpr double kSpeed_mps = 3.0;
constexpr double kRate_hz = 50.0;
constexpr double kApart_m = 0.4;  ///< of the two filters' estimates; less than a filter set anew
constexpr double kDies_s = 20.0;
/// What fusion/odometry may move between two messages beyond the drive: the hand-over's rate.
constexpr double kStep_m = 0.3 / kRate_hz + 1e-6;

class TwoFiltersWithoutLio : public ::testing::Test {
 protected:
  void say(const std::string& writer, double now_s, double north_m, double climb_mps = 0.0) {
    Odometry odometry;
    odometry.stamp_ns = from_seconds(1000.0 + now_s);
    odometry.frame_id = "map";
    odometry.child_frame_id = "base_link";
    odometry.T_frame_child.p = {kSpeed_mps * now_s, north_m, 0.0};
    odometry.pose_covariance = PoseCovariance::Identity() * 0.01;
    odometry.linear_mps = {kSpeed_mps, 0.0, climb_mps};
    GpsStatus status;
    status.stamp_ns = odometry.stamp_ns;
    status.source = writer;
    status.health = GpsHealth::kOk;
    status.datum_id = datum_.id();
    status.last_accepted_fix_ns = odometry.stamp_ns;
    take(gate_.on_gps_status(status, writer), now_s);
    take(gate_.on_gps_odometry(odometry, writer), now_s);
  }

  void take(const Output& out, double now_s) {
    if (out.selected && now_s > kDies_s && out.selected->T_frame_child.p.y() > 0.5 * kApart_m) {
      handed_over_s_ = std::min(handed_over_s_, now_s - kDies_s);
    }
    if (!out.fused) {
      return;
    }
    highest_m_ = std::max(highest_m_, std::abs(out.fused->T_frame_child.p.z()));
    if (last_) {
      const double dt_s = to_seconds(out.fused->stamp_ns - last_->stamp_ns);
      const Eigen::Vector3d moved_m = out.fused->T_frame_child.p - last_->T_frame_child.p;
      const Eigen::Vector3d driven_m(kSpeed_mps * dt_s, 0.0, 0.0);
      worst_step_per_message_m_ = std::max(
          worst_step_per_message_m_, (moved_m - driven_m).norm() / std::max(1.0, dt_s * kRate_hz));
    }
    last_ = out.fused;
  }

  Datum datum_{49.0, 8.0, 100.0, 0};
  FusionGate gate_{Config{}, RobotConfig{}};
  std::optional<Odometry> last_;
  double worst_step_per_message_m_{0.0};
  double highest_m_{0.0};  ///< the drive is level
  double handed_over_s_{1e9};
};

TEST_F(TwoFiltersWithoutLio, hands_over_within_half_a_second_and_without_a_step) {
  gate_.on_datum(datum_);
  for (int k = 0; k < 30 * static_cast<int>(kRate_hz); ++k) {
    const double now_s = k / kRate_hz;
    if (now_s < kDies_s) {
      say("a", now_s, 0.0);
    }
    say("b", now_s, kApart_m);
  }
  ASSERT_TRUE(last_);
  EXPECT_LT(handed_over_s_, kStandbyHandOver_s);
  EXPECT_LT(worst_step_per_message_m_, kStep_m);
  EXPECT_NEAR(last_->T_frame_child.p.y(), kApart_m, 1e-3) << "the new one is followed in the end";
}

TEST_F(TwoFiltersWithoutLio,
       hand_over_and_back_at_once_without_taking_their_difference_for_motion) {
  gate_.on_datum(datum_);
  for (int k = 0; k < 25 * static_cast<int>(kRate_hz); ++k) {
    const double now_s = k / kRate_hz;
    if (now_s < kDies_s || now_s > kDies_s + 0.3) {
      say("a", now_s, 0.0);
    }
    if (now_s < kDies_s + 0.29) {
      say("b", now_s, kApart_m);
    }
  }
  EXPECT_LT(handed_over_s_, kStandbyHandOver_s);
  EXPECT_LT(worst_step_per_message_m_, kStep_m);
}

TEST_F(TwoFiltersWithoutLio, are_not_led_astray_by_the_last_twist_of_the_one_that_fails) {
  gate_.on_datum(datum_);
  for (int k = 0; k < 25 * static_cast<int>(kRate_hz); ++k) {
    const double now_s = k / kRate_hz;
    const bool last_word = now_s >= kDies_s - 1.5 / kRate_hz;
    if (now_s < kDies_s) {
      say("a", now_s, 0.0, last_word ? 10.0 : 0.0);
    }
    say("b", now_s, kApart_m);
  }
  EXPECT_LT(handed_over_s_, kStandbyHandOver_s);
  EXPECT_LT(highest_m_, 0.01);
}

}  // namespace
}  // namespace trigpoint::fusion_gate
