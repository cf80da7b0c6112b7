// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// map by way of UTM against GeographicLib's LocalCartesian and Geodesic, which share nothing with
// it but the projection.
#include "trigpoint/geodesy/local_frame.hpp"

#include <GeographicLib/Geodesic.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace trigpoint::geodesy {
namespace {

constexpr double kPlaneMillimetre = 1e-3;
constexpr double kKilometre_m = 1000.0;
constexpr double kUtmEnd_deg = 84.0;

Datum plane_datum_at(const Geographic& place) {
  return {place.latitude_deg, place.longitude_deg, place.height_m, 0};
}

/// The place at a distance and azimuth on the ellipsoid.
Geographic at(const Geographic& origin, double distance_m, double azimuth_deg, double rise_m) {
  Geographic place;
  GeographicLib::Geodesic::WGS84().Direct(origin.latitude_deg,
                                          origin.longitude_deg,
                                          azimuth_deg,
                                          distance_m,
                                          place.latitude_deg,
                                          place.longitude_deg);
  place.height_m = origin.height_m + rise_m;
  return place;
}

class UtmPlaces : public testing::TestWithParam<Geographic> {
 protected:
  double worst_m(double distance_m) const {
    const LocalFrame enu(plane_datum_at(GetParam()));
    const LocalFrame utm(plane_datum_at(GetParam()), Projection::kUtm);
    double worst = 0.0;
    for (int i = 0; i < 16; ++i) {
      const Geographic place = at(GetParam(), distance_m, 22.5 * i, 5.0 * i - 40.0);
      if (std::abs(place.latitude_deg) > kUtmEnd_deg) {
        continue;
      }
      const auto through_utm = utm.to_map(place);
      EXPECT_TRUE(through_utm.has_value());
      worst = std::max(worst, (through_utm.value() - enu.to_map(place).value()).norm());
    }
    return worst;
  }
};

TEST_P(UtmPlaces, give_the_same_map_within_a_millimetre_at_a_kilometre) {
  EXPECT_LT(worst_m(kKilometre_m), kPlaneMillimetre);
  EXPECT_LT(worst_m(100.0), kPlaneMillimetre);
}

TEST_P(UtmPlaces, give_the_same_map_within_a_millimetre_at_ten_kilometres) {
  EXPECT_LT(worst_m(10.0 * kKilometre_m), kPlaneMillimetre);
}

TEST_P(UtmPlaces, keep_distance_and_azimuth_of_the_geodesic) {
  Geographic origin = GetParam();
  origin.height_m = 0.0;
  const LocalFrame frame(plane_datum_at(origin), Projection::kUtm);
  for (const double azimuth_deg : {10.0, 100.0, 190.0, 280.0}) {
    const auto p = frame.to_map(at(origin, kKilometre_m, azimuth_deg, 0.0));
    ASSERT_TRUE(p.has_value());
    // The chord of an arc of a kilometre is 1 micrometre shorter.
    EXPECT_NEAR(p->norm(), kKilometre_m, kPlaneMillimetre);
    const double azimuth = azimuth_deg * std::numbers::pi / 180.0;
    const double across = p->x() * std::cos(azimuth) - p->y() * std::sin(azimuth);
    EXPECT_NEAR(across, 0.0, kPlaneMillimetre);
  }
}

TEST_P(UtmPlaces, come_back_to_the_same_place) {
  const LocalFrame frame(plane_datum_at(GetParam()), Projection::kUtm);
  const Eigen::Vector3d position(412.5, -873.25, 12.75);
  const auto back = frame.to_map(frame.to_geographic(position));
  ASSERT_TRUE(back.has_value());
  EXPECT_LT((*back - position).norm(), kPlaneMillimetre);
}

INSTANTIATE_TEST_SUITE_P(Earth,
                         UtmPlaces,
                         testing::Values(Geographic{49.011, 8.4167, 114.0},   // Karlsruhe
                                         Geographic{39.74, -104.99, 1600.0},  // Denver
                                         Geographic{45.0, 5.9999, 2000.0},    // zone's edge
                                         Geographic{45.0, 6.0001, 2000.0},    // its other side
                                         Geographic{0.002, 35.999, 2000.0},   // equator
                                         Geographic{-0.002, 36.001, 0.0},     // its south
                                         Geographic{-17.0, 179.9999, 20.0},   // antimeridian
                                         Geographic{-17.0, -179.9999, 20.0},  // its other side
                                         Geographic{60.0, 11.9, 100.0},       // wide zone 32V
                                         Geographic{83.99, 30.0, 2000.0},     // high north
                                         Geographic{-79.9, 5.999, 2000.0}));  // high south

TEST(UtmPlane, takes_out_more_than_half_a_metre_a_kilometre) {
  // Denver, height 1600 m: what the printed (6)-(7) leave is 0.6 m a kilometre.
  const Geographic origin{39.74, -104.99, 1600.0};
  const UtmZone zone = utm_zone_of(plane_datum_at(origin));
  const Geographic place = at(origin, kKilometre_m, 90.0, 0.0);
  const auto from = to_utm(origin, zone);
  const auto to = to_utm(place, zone);
  ASSERT_TRUE(from && to);
  const double grid_m =
      std::hypot(to->easting_m - from->easting_m, to->northing_m - from->northing_m);
  const double map_m =
      LocalFrame(plane_datum_at(origin), Projection::kUtm).to_map(place).value().head<2>().norm();
  EXPECT_GT(map_m - grid_m, 0.5);
}

TEST(UtmPlane, does_not_exist_beyond_84_degrees) {
  EXPECT_THROW(LocalFrame(Datum{84.5, 30.0, 0.0, 0}, Projection::kUtm), std::invalid_argument);
  const LocalFrame frame(Datum{83.999, 30.0, 0.0, 0}, Projection::kUtm);
  EXPECT_FALSE(frame.to_map({84.01, 30.0, 0.0}));
}

TEST(UtmPlane, is_told_by_its_frame) {
  const Datum datum{49.0, 8.4, 100.0, 0};
  EXPECT_EQ(LocalFrame(datum, Projection::kUtm).projection(), Projection::kUtm);
  EXPECT_EQ(LocalFrame(datum).projection(), Projection::kEnu);
}

TEST(FromUtm, is_the_way_back_on_both_sides_of_the_equator) {
  for (const double datum_latitude : {0.5, -0.5}) {
    const UtmZone zone = utm_zone_of(Datum{datum_latitude, 36.5, 0.0, 0});
    for (const double latitude : {0.01, -0.01}) {
      const auto utm = to_utm({latitude, 36.5, 7.0}, zone);
      ASSERT_TRUE(utm.has_value());
      const auto back = from_utm(utm->easting_m, utm->northing_m, utm->height_m, zone);
      ASSERT_TRUE(back.has_value());
      EXPECT_NEAR(back->latitude_deg, latitude, 1e-11);
      EXPECT_NEAR(back->longitude_deg, 36.5, 1e-11);
      EXPECT_EQ(back->height_m, 7.0);
    }
  }
}

TEST(FromUtm, gives_no_place_for_what_is_not_on_the_grid) {
  EXPECT_FALSE(from_utm(kNaN, 0.0, 0.0, UtmZone{32, true}));
  EXPECT_FALSE(from_utm(5e7, 0.0, 0.0, UtmZone{32, true}));
  EXPECT_FALSE(from_utm(5e5, 5e6, 0.0, UtmZone{61, true}));
}

}  // namespace
}  // namespace trigpoint::geodesy
