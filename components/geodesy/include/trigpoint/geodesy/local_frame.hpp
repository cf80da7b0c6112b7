// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Places on the Earth and places in `map`. One transform for everything: the filter, the gate, the
// writers of files.
#pragma once

#include "trigpoint/base/messages.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace trigpoint::geodesy {

struct Geographic {
  double latitude_deg{kNaN};
  double longitude_deg{kNaN};
  double height_m{kNaN};  ///< above the WGS 84 ellipsoid
};

/// Where `map` has its origin.
Geographic place_of(const Datum& datum);

/// Why a place cannot be used, as a sentence with the value and what was expected; nullopt when it
/// can. Ranges: research/gps E (|lat| <= 90, |lon| <= 180, |h| < 20 km, finite, not exactly 0, 0).
std::optional<std::string> find_fault(const Geographic& place);

/// How a place becomes a position in map. Both give the same east-north-up axes and true metres.
enum class Projection : std::uint8_t {
  kEnu,  ///< GeographicLib LocalCartesian
  kUtm   ///< through UTM, the paper's (6)-(7), with convergence, scale and height taken out
};

/// `map`: east-north-up tangent plane at the datum, true z.
class LocalFrame {
 public:
  /// Throws std::invalid_argument with the reason when the datum is not a place, or has no UTM zone
  /// where UTM is asked for.
  explicit LocalFrame(const Datum& datum, Projection projection = Projection::kEnu);
  ~LocalFrame();
  LocalFrame(const LocalFrame&);
  LocalFrame& operator=(const LocalFrame&);
  LocalFrame(LocalFrame&&) noexcept;
  LocalFrame& operator=(LocalFrame&&) noexcept;

  const Datum& datum() const;
  Projection projection() const;

  /// Position in map (m), or nullopt when the place has a fault or the result is not finite.
  std::optional<Eigen::Vector3d> to_map(const Geographic& place) const;

  Geographic to_geographic(const Eigen::Vector3d& position_map_m) const;

  /// Columns: the axes of the local ENU at `place`, in map. Turns a fix's covariance into map's
  /// axes.
  Eigen::Matrix3d R_map_enu(const Geographic& place) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct UtmZone {
  int zone{0};
  bool north{true};
};

/// UTM coordinates with the zone and hemisphere pinned by the datum, for export and for fidelity to
/// the paper's equations (6)-(7).
struct UtmPosition {
  double easting_m{0.0};
  double northing_m{0.0};
  double height_m{0.0};
  double convergence_deg{0.0};  ///< grid north from true north, clockwise
  double scale{1.0};            ///< grid distance over true distance on the ellipsoid
};

UtmZone utm_zone_of(const Datum& datum);

/// nullopt when the place has a fault or cannot be projected (|lat| > 84).
std::optional<UtmPosition> to_utm(const Geographic& place, const UtmZone& zone);

/// The way back; nullopt where there is none. Convergence and scale come with `to_utm`.
std::optional<Geographic> from_utm(double easting_m,
                                   double northing_m,
                                   double height_m,
                                   const UtmZone& zone);

}  // namespace trigpoint::geodesy
