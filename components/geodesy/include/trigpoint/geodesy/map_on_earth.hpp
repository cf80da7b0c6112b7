// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Where a position in `map` lies on the Earth: the one way that every written file takes.
#pragma once

#include "trigpoint/geodesy/local_frame.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>

namespace trigpoint::geodesy {

class MapOnEarth {
 public:
  /// Throws std::invalid_argument with the reason when the datum is not a place.
  explicit MapOnEarth(const Datum& datum);

  const Datum& datum() const { return frame_.datum(); }

  const UtmZone& zone() const { return zone_; }

  /// False at the poles, where `utm` has no answer.
  bool has_utm() const;

  Geographic geographic(const Eigen::Vector3d& position_map_m) const;

  /// Easting, northing, height above the ellipsoid (m), in the datum's zone.
  std::optional<Eigen::Vector3d> utm(const Eigen::Vector3d& position_map_m) const;
  std::optional<Eigen::Vector3d> utm(const Geographic& place) const;

 private:
  LocalFrame frame_;
  UtmZone zone_;
};

/// 32617 for zone 17 north.
int epsg_of(const UtmZone& zone);

/// Well-known text of the zone, version 1 (OGC 01-009) as LAS 1.4 asks for: east and north only.
std::string wkt_of(const UtmZone& zone);

/// The same joined with heights above the ellipsoid (vertical datum type 2002).
std::string wkt_with_height_of(const UtmZone& zone);

}  // namespace trigpoint::geodesy
