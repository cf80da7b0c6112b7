// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/geodesy/local_frame.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace trigpoint::geodesy {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kMillimetre = 1e-3;

// The closed form, independent of GeographicLib: WGS 84 to ECEF, then turned to the datum's axes.
Eigen::Vector3d ecef_of(const Geographic& place) {
  constexpr double a = 6'378'137.0;
  constexpr double f = 1.0 / 298.257223563;
  constexpr double e2 = f * (2.0 - f);
  const double lat = place.latitude_deg * kDegree;
  const double lon = place.longitude_deg * kDegree;
  const double n = a / std::sqrt(1.0 - e2 * std::sin(lat) * std::sin(lat));
  return {(n + place.height_m) * std::cos(lat) * std::cos(lon),
          (n + place.height_m) * std::cos(lat) * std::sin(lon),
          (n * (1.0 - e2) + place.height_m) * std::sin(lat)};
}

// Rows: east, north, up in ECEF.
Eigen::Matrix3d R_enu_ecef(const Geographic& place) {
  const double lat = place.latitude_deg * kDegree;
  const double lon = place.longitude_deg * kDegree;
  Eigen::Matrix3d R;
  R << -std::sin(lon), std::cos(lon), 0.0,  //
      -std::sin(lat) * std::cos(lon), -std::sin(lat) * std::sin(lon), std::cos(lat),
      std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat);
  return R;
}

Eigen::Vector3d closed_form(const Geographic& origin, const Geographic& place) {
  return R_enu_ecef(origin) * (ecef_of(place) - ecef_of(origin));
}

Datum datum_at(const Geographic& place) {
  return {place.latitude_deg, place.longitude_deg, place.height_m, 0};
}

class LocalFramePlaces : public testing::TestWithParam<Geographic> {};

TEST_P(LocalFramePlaces, agrees_with_the_closed_form_within_a_kilometre_around) {
  const Geographic origin = GetParam();
  const LocalFrame frame(datum_at(origin));
  for (const double d : {-0.009, -0.001, 0.0, 0.002, 0.008}) {
    // Longitudes beyond the antimeridian are written the way receivers write them.
    const double lon = std::remainder(origin.longitude_deg + 0.7 * d, 360.0);
    const Geographic place{origin.latitude_deg - d, lon, origin.height_m + 1e4 * d};
    const auto position = frame.to_map(place);
    ASSERT_TRUE(position.has_value());
    EXPECT_LT((*position - closed_form(origin, place)).norm(), kMillimetre);
  }
}

TEST_P(LocalFramePlaces, comes_back_to_the_same_place) {
  const LocalFrame frame(datum_at(GetParam()));
  const Eigen::Vector3d position(412.5, -873.25, 12.75);
  const auto back = frame.to_map(frame.to_geographic(position));
  ASSERT_TRUE(back.has_value());
  EXPECT_LT((*back - position).norm(), kMillimetre);
}

TEST_P(LocalFramePlaces, turns_axes_as_the_closed_form_does) {
  const Geographic origin = GetParam();
  const Geographic place{origin.latitude_deg - 0.05, origin.longitude_deg - 0.05, 10.0};
  const Eigen::Matrix3d expected = R_enu_ecef(origin) * R_enu_ecef(place).transpose();
  const Eigen::Matrix3d R = LocalFrame(datum_at(origin)).R_map_enu(place);
  EXPECT_LT((R - expected).norm(), 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Earth,
                         LocalFramePlaces,
                         testing::Values(Geographic{49.011, 8.4167, 114.0},      // Karlsruhe
                                         Geographic{43.9456, -78.8968, 160.0},   // Oshawa
                                         Geographic{39.74, -104.99, 1600.0},     // Denver
                                         Geographic{0.0, 36.0, 1800.0},          // equator
                                         Geographic{-43.530955, 172.636645, 5},  // south
                                         Geographic{-17.0, 179.9999, 20.0},      // antimeridian
                                         Geographic{83.9, 30.0, 2000.0}));       // high north

TEST(LocalFrame, keeps_the_true_drop_of_the_ellipsoid_below_the_tangent_plane) {
  const LocalFrame frame(Datum{49.0, 8.4, 100.0, 0});
  const auto position = frame.to_map({49.0 + 1000.0 / 111'200.0, 8.4, 100.0});
  ASSERT_TRUE(position.has_value());
  EXPECT_NEAR(position->z(), -0.078, 0.002);
}

TEST(LocalFrame, refuses_a_datum_that_is_not_a_place) {
  EXPECT_THROW(LocalFrame(Datum{kNaN, 8.0, 0.0, 0}), std::invalid_argument);
  EXPECT_THROW(LocalFrame(Datum{95.0, 8.0, 0.0, 0}), std::invalid_argument);
  EXPECT_THROW(LocalFrame(Datum{0.0, 0.0, 0.0, 0}), std::invalid_argument);
}

TEST(LocalFrame, gives_no_position_for_what_is_not_a_place) {
  const LocalFrame frame(Datum{49.0, 8.4, 100.0, 0});
  EXPECT_FALSE(frame.to_map({95.0, 8.0, 0.0}));
  EXPECT_FALSE(frame.to_map({49.0, 541.0, 0.0}));
  EXPECT_FALSE(frame.to_map({kNaN, 8.0, 0.0}));
}

TEST(LocalFrame, gives_no_geographic_place_for_a_position_that_is_not_finite) {
  const LocalFrame frame(Datum{49.0, 8.4, 100.0, 0});
  EXPECT_TRUE(std::isnan(frame.to_geographic({kNaN, 0.0, 0.0}).latitude_deg));
}

TEST(LocalFrame, is_copied_with_its_datum) {
  const LocalFrame frame(Datum{49.0, 8.4, 100.0, 7});
  LocalFrame copy(Datum{10.0, 10.0, 0.0, 0});
  copy = frame;
  EXPECT_EQ(copy.datum().elected_ns, 7);
  EXPECT_LT(copy.to_map({49.0, 8.4, 100.0})->norm(), kMillimetre);
}

TEST(FindFault, says_nothing_about_a_good_place) {
  EXPECT_FALSE(find_fault({49.0, 8.4, 100.0}));
  EXPECT_FALSE(find_fault({0.0, 8.4, -400.0}));
}

TEST(FindFault, names_the_value_and_what_was_expected) {
  const auto fault = find_fault({-2e10, 8.4, 100.0});
  ASSERT_TRUE(fault.has_value());
  EXPECT_NE(fault->find("-2e+10"), std::string::npos);
  EXPECT_NE(fault->find("-90 to 90"), std::string::npos);
}

TEST(FindFault, finds_what_receivers_really_send) {
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(find_fault({0.0, 0.0, 0.0}));
  EXPECT_TRUE(find_fault({49.0, 8.4, kNaN}));
  EXPECT_TRUE(find_fault({inf, 8.4, 0.0}));
  EXPECT_TRUE(find_fault({49.0, -inf, 0.0}));
  EXPECT_TRUE(find_fault({49.0, 180.5, 0.0}));
  EXPECT_TRUE(find_fault({49.0, 8.4, 20'000.0}));
}

}  // namespace
}  // namespace trigpoint::geodesy
