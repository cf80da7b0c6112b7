// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Vectors: robot_localization, test/test_navsat_conversions.cpp (BSD-3), numbers only.
#include "trigpoint/geodesy/local_frame.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace trigpoint::geodesy {
namespace {

constexpr double kVectorTolerance_m = 2e-3;  // the vectors are printed to the millimetre
constexpr double kVectorTolerance_deg = 1e-3;

TEST(Utm, agrees_with_the_published_northern_vector) {
  const UtmZone zone = utm_zone_of(Datum{51.423964, 5.494271, 0.0, 0});
  EXPECT_EQ(zone.zone, 31);
  EXPECT_TRUE(zone.north);
  const auto utm = to_utm({51.423964, 5.494271, 12.0}, zone);
  ASSERT_TRUE(utm.has_value());
  EXPECT_NEAR(utm->easting_m, 673'409.989, kVectorTolerance_m);
  EXPECT_NEAR(utm->northing_m, 5'699'924.709, kVectorTolerance_m);
  EXPECT_NEAR(utm->convergence_deg, 1.950, kVectorTolerance_deg);
  EXPECT_DOUBLE_EQ(utm->height_m, 12.0);
}

TEST(Utm, agrees_with_the_published_southern_convergence) {
  const UtmZone zone = utm_zone_of(Datum{-43.530955, 172.636645, 0.0, 0});
  EXPECT_EQ(zone.zone, 59);
  EXPECT_FALSE(zone.north);
  const auto utm = to_utm({-43.530955, 172.636645, 0.0}, zone);
  ASSERT_TRUE(utm.has_value());
  EXPECT_NEAR(utm->convergence_deg, -1.127, kVectorTolerance_deg);
}

TEST(Utm, is_continuous_across_the_edge_of_the_pinned_zone) {
  const UtmZone zone = utm_zone_of(Datum{50.0, 5.99, 0.0, 0});
  const auto west = to_utm({50.0, 5.99999, 0.0}, zone);
  const auto east = to_utm({50.0, 6.00001, 0.0}, zone);
  ASSERT_TRUE(west && east);
  EXPECT_NEAR(std::hypot(east->easting_m - west->easting_m, east->northing_m - west->northing_m),
              1.434,
              0.01);
}

TEST(Utm, is_continuous_across_the_equator_from_either_side) {
  for (const double latitude : {0.001, -0.001}) {
    const UtmZone zone = utm_zone_of(Datum{latitude, 36.5, 0.0, 0});
    const auto north = to_utm({1e-5, 36.5, 0.0}, zone);
    const auto south = to_utm({-1e-5, 36.5, 0.0}, zone);
    ASSERT_TRUE(north && south);
    EXPECT_NEAR(north->northing_m - south->northing_m, 2.211, 0.01);
  }
}

TEST(Utm, has_the_scale_of_the_central_meridian) {
  const auto utm = to_utm({49.0, 9.0, 0.0}, UtmZone{32, true});
  ASSERT_TRUE(utm.has_value());
  EXPECT_NEAR(utm->scale, 0.9996, 1e-9);
  EXPECT_NEAR(utm->easting_m, 500'000.0, 1e-6);
}

TEST(Utm, does_not_project_what_lies_outside_it) {
  EXPECT_FALSE(to_utm({84.5, 9.0, 0.0}, UtmZone{32, true}));
  EXPECT_FALSE(to_utm({49.0, 190.0, 0.0}, UtmZone{32, true}));
  EXPECT_FALSE(to_utm({49.0, -170.0, 0.0}, UtmZone{32, true}));
  EXPECT_FALSE(to_utm({49.0, 9.0, 0.0}, UtmZone{0, true}));
}

TEST(Utm, has_no_zone_for_a_datum_that_is_not_a_place) {
  EXPECT_THROW(utm_zone_of(Datum{kNaN, 9.0, 0.0, 0}), std::invalid_argument);
}

}  // namespace
}  // namespace trigpoint::geodesy
