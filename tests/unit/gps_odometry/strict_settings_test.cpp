// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The published filter with its own settings and with LIO-SAM's.
#include "drive.hpp"
#include "strict_filter.hpp"
#include <gtest/gtest.h>

#include <string>

namespace trigpoint::gps_odometry {
namespace {

Recorded drive_with(const std::string& filter_name, double datum_below_m = 0.0) {
  const auto truth = drive(circle(2.0, 0.1, 2.0), 20.0);
  const Sensors sensors;
  Config config = config_with_datum(filter_name);
  config.datum_height_m -= datum_below_m;
  GpsOdometry filter(config, sensors.robot);
  return run(filter, sense(truth, sensors, 1), truth);
}

TEST(StrictSettings, are_the_published_ones_and_those_that_lio_sam_ships) {
  EXPECT_EQ(published_settings().process_noise_per_s, published_process_noise());
  EXPECT_EQ(published_settings().rate_hz, 30.0);
  EXPECT_EQ(lio_sam_settings().rate_hz, 50.0);
  EXPECT_EQ(lio_sam_settings().process_noise_per_s(2), 10.0);
  EXPECT_EQ(lio_sam_settings().process_noise_per_s(11), 0.5);
}

TEST(StrictSettings, of_lio_sam_claim_less_of_the_position) {
  const auto published = drive_with("ekf15_strict").samples.back();
  const auto lio_sam = drive_with("ekf15_lio_sam").samples.back();
  EXPECT_GT(lio_sam.sigma_m.x(), 1.2 * published.sigma_m.x());
}

TEST(StrictSettings, of_lio_sam_put_every_fix_at_the_datum_s_height) {
  constexpr double kRaised_m = 5.0;
  constexpr double kNear_m = 0.5;
  const auto height_m = [&](const std::string& filter) {
    return drive_with(filter, kRaised_m).odometry.back().T_frame_child.p.z();
  };
  EXPECT_NEAR(height_m("ekf15_strict"), kRaised_m, kNear_m);
  EXPECT_NEAR(height_m("ekf15_lio_sam"), 0.0, kNear_m);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
