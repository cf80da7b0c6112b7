// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/geodesy/map_on_earth.hpp"

#include <sstream>

namespace trigpoint::geodesy {

namespace {

/// "WGS 84 / UTM zone 17N"
std::string name_of(const UtmZone& zone) {
  return "WGS 84 / UTM zone " + std::to_string(zone.zone) + (zone.north ? "N" : "S");
}

}  // namespace

MapOnEarth::MapOnEarth(const Datum& datum) : frame_(datum), zone_(utm_zone_of(datum)) {}

bool MapOnEarth::has_utm() const {
  return to_utm(place_of(datum()), zone_).has_value();
}

Geographic MapOnEarth::geographic(const Eigen::Vector3d& position_map_m) const {
  return frame_.to_geographic(position_map_m);
}

std::optional<Eigen::Vector3d> MapOnEarth::utm(const Eigen::Vector3d& position_map_m) const {
  return utm(geographic(position_map_m));
}

std::optional<Eigen::Vector3d> MapOnEarth::utm(const Geographic& place) const {
  const auto utm = to_utm(place, zone_);
  if (!utm) {
    return std::nullopt;
  }
  return Eigen::Vector3d(utm->easting_m, utm->northing_m, utm->height_m);
}

int epsg_of(const UtmZone& zone) {
  return (zone.north ? 32600 : 32700) + zone.zone;
}

std::string wkt_of(const UtmZone& zone) {
  std::ostringstream text;
  text << "PROJCS[\"" << name_of(zone) << "\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\","
       << R"(SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],)"
       << R"(AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],)"
       << R"(UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],)"
       << R"(AUTHORITY["EPSG","4326"]],PROJECTION["Transverse_Mercator"],)"
       << R"(PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",)"
       << 6 * zone.zone - 183 << R"(],PARAMETER["scale_factor",0.9996],)"
       << R"(PARAMETER["false_easting",500000],PARAMETER["false_northing",)"
       << (zone.north ? 0 : 10'000'000) << R"(],UNIT["metre",1,AUTHORITY["EPSG","9001"]],)"
       << R"(AXIS["Easting",EAST],AXIS["Northing",NORTH],AUTHORITY["EPSG",")" << epsg_of(zone)
       << "\"]]";
  return text.str();
}

std::string wkt_with_height_of(const UtmZone& zone) {
  return "COMPD_CS[\"" + name_of(zone) + " + ellipsoidal height\"," + wkt_of(zone) +
         R"(,VERT_CS["WGS 84 ellipsoidal height",VERT_DATUM["WGS 84 ellipsoid",2002],)" +
         R"(UNIT["metre",1,AUTHORITY["EPSG","9001"]],AXIS["Up",UP]]])";
}

}  // namespace trigpoint::geodesy
