// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/geodesy/local_frame.hpp"

#include <GeographicLib/UTMUPS.hpp>

#include <cmath>
#include <stdexcept>

namespace trigpoint::geodesy {

namespace {

// UTM ends here; beyond it GeographicLib would go over to the polar system (UPS) in silence.
constexpr double kUtmLimit_deg = 84.0;

// UTM adds this to northings in the southern hemisphere.
constexpr double kSouthFalseNorthing_m = 10'000'000.0;

}  // namespace

UtmZone utm_zone_of(const Datum& datum) {
  const Geographic place = place_of(datum);
  if (const auto fault = find_fault(place)) {
    throw std::invalid_argument("The datum has no UTM zone: " + *fault + ".");
  }
  const int zone = GeographicLib::UTMUPS::StandardZone(
      datum.latitude_deg, datum.longitude_deg, GeographicLib::UTMUPS::UTM);
  return {zone, datum.latitude_deg >= 0.0};
}

std::optional<UtmPosition> to_utm(const Geographic& place, const UtmZone& zone) {
  if (find_fault(place) || std::abs(place.latitude_deg) > kUtmLimit_deg || zone.zone < 1 ||
      zone.zone > 60) {
    return std::nullopt;
  }
  UtmPosition utm;
  try {
    int used_zone = 0;
    bool north = true;
    GeographicLib::UTMUPS::Forward(place.latitude_deg,
                                   place.longitude_deg,
                                   used_zone,
                                   north,
                                   utm.easting_m,
                                   utm.northing_m,
                                   utm.convergence_deg,
                                   utm.scale,
                                   zone.zone);
    // The hemisphere stays the datum's, so that northing is continuous across the equator.
    if (north && !zone.north) {
      utm.northing_m += kSouthFalseNorthing_m;
    } else if (!north && zone.north) {
      utm.northing_m -= kSouthFalseNorthing_m;
    }
  } catch (const std::exception&) {
    return std::nullopt;  // too far from the pinned zone's central meridian
  }
  utm.height_m = place.height_m;
  if (!std::isfinite(utm.easting_m) || !std::isfinite(utm.northing_m)) {
    return std::nullopt;
  }
  return utm;
}

std::optional<Geographic> from_utm(double easting_m,
                                   double northing_m,
                                   double height_m,
                                   const UtmZone& zone) {
  if (!std::isfinite(easting_m) || !std::isfinite(northing_m) || zone.zone < 1 || zone.zone > 60) {
    return std::nullopt;
  }
  // The northern hemisphere's equations hold on both sides of the equator.
  const double northing = zone.north ? northing_m : northing_m - kSouthFalseNorthing_m;
  Geographic place;
  place.height_m = height_m;
  try {
    GeographicLib::UTMUPS::Reverse(zone.zone,
                                   northing >= 0.0,
                                   easting_m,
                                   northing >= 0.0 ? northing : northing + kSouthFalseNorthing_m,
                                   place.latitude_deg,
                                   place.longitude_deg);
  } catch (const std::exception&) {
    return std::nullopt;  // too far from the zone
  }
  if (find_fault(place)) {
    return std::nullopt;
  }
  return place;
}

}  // namespace trigpoint::geodesy
