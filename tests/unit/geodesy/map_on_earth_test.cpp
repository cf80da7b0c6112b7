// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Against PROJ: tests/unit/export/landmark_test.cpp.
#include "trigpoint/geodesy/map_on_earth.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::geodesy {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(MapOnEarth, is_the_inverse_of_the_frame_that_the_filters_use) {
  const Datum datum{43.9456, -78.8968, 100.0};
  const MapOnEarth earth(datum);
  const Eigen::Vector3d p_map_m(3000.0, -2000.0, 50.0);
  const auto back = LocalFrame(datum).to_map(earth.geographic(p_map_m));
  ASSERT_TRUE(back);
  EXPECT_LT((*back - p_map_m).norm(), 1e-6);
}

TEST(MapOnEarth, tells_the_zone_by_number_and_in_words) {
  const MapOnEarth oshawa({43.9456, -78.8968, 100.0});
  EXPECT_EQ(epsg_of(oshawa.zone()), 32617);
  EXPECT_THAT(wkt_of(oshawa.zone()),
              AllOf(HasSubstr("central_meridian\",-81]"), HasSubstr("false_northing\",0]")));
  const MapOnEarth sydney({-33.8568, 151.2153, 20.0});
  EXPECT_EQ(epsg_of(sydney.zone()), 32756);
  EXPECT_THAT(wkt_with_height_of(sydney.zone()),
              AllOf(HasSubstr("false_northing\",10000000]"), HasSubstr("2002")));
}

TEST(MapOnEarth, has_no_utm_at_the_poles) {
  const MapOnEarth pole({88.0, 10.0, 0.0});
  EXPECT_FALSE(pole.has_utm());
  EXPECT_FALSE(pole.utm(Eigen::Vector3d::Zero()));
  EXPECT_NEAR(pole.geographic(Eigen::Vector3d::Zero()).latitude_deg, 88.0, 1e-12);
}

}  // namespace
}  // namespace trigpoint::geodesy
