// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/gps_odometry/config.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/gps_odometry/gps_odometry.hpp"

#include <gtest/gtest.h>

namespace trigpoint::gps_odometry {
namespace {

TEST(Config, is_printed_and_read_back) {
  Config written;
  written.rewind_s = 0.7;
  written.datum_latitude_deg = 49.0;
  const std::string text = print_config([&](ConfigFields& fields) { describe(written, fields); });
  Config read;
  load_config_text(text, "printed", [&](ConfigFields& fields) { describe(read, fields); });
  EXPECT_DOUBLE_EQ(read.rewind_s, 0.7);
  EXPECT_DOUBLE_EQ(read.datum_latitude_deg, 49.0);
  EXPECT_FALSE(read.use_configured_datum);
}

TEST(Config, refuses_a_datum_that_is_not_a_place) {
  Config config;
  config.use_configured_datum = true;
  config.datum_latitude_deg = 149.0;
  config.datum_longitude_deg = 8.0;
  config.datum_height_m = 100.0;
  EXPECT_THROW(GpsOdometry(config, RobotConfig{}), ConfigError);
}

TEST(Config, names_the_filter_that_runs) {
  for (const char* name : {"ekf15", "eskf18"}) {
    Config config;
    config.filter = name;
    EXPECT_EQ(GpsOdometry(config, RobotConfig{}).status().source, name);
  }
  Config config;
  config.filter = "kalman";
  EXPECT_THROW(GpsOdometry(config, RobotConfig{}), ConfigError);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
