// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/geodesy/local_frame.hpp"

#include "trigpoint/base/sentence.hpp"

#include "utm_plane.hpp"
#include <GeographicLib/LocalCartesian.hpp>

#include <cmath>
#include <stdexcept>
#include <vector>

namespace trigpoint::geodesy {

namespace {

// Beyond this no vehicle that maps the ground can be.
constexpr double kHighestHeight_m = 20'000.0;

}  // namespace

Geographic place_of(const Datum& datum) {
  return {datum.latitude_deg, datum.longitude_deg, datum.height_m};
}

std::optional<std::string> find_fault(const Geographic& place) {
  if (!std::isfinite(place.latitude_deg)) {
    return sentence("latitude is %g, expected a finite number of degrees", place.latitude_deg);
  }
  if (!std::isfinite(place.longitude_deg)) {
    return sentence("longitude is %g, expected a finite number of degrees", place.longitude_deg);
  }
  if (!std::isfinite(place.height_m)) {
    return sentence("height is %g, expected a finite number of metres", place.height_m);
  }
  if (std::abs(place.latitude_deg) > 90.0) {
    return sentence("latitude %.9g degrees, expected -90 to 90", place.latitude_deg);
  }
  if (std::abs(place.longitude_deg) > 180.0) {
    return sentence("longitude %.9g degrees, expected -180 to 180", place.longitude_deg);
  }
  if (std::abs(place.height_m) >= kHighestHeight_m) {
    return sentence("height %.9g m, expected less than 20000 m above or below the ellipsoid",
                    place.height_m);
  }
  if (place.latitude_deg == 0.0 && place.longitude_deg == 0.0) {
    return "latitude and longitude are exactly 0, which receivers send when they have no position";
  }
  return std::nullopt;
}

struct LocalFrame::Impl {
  Impl(const Datum& d, Projection projection)
      : datum(d), cartesian(d.latitude_deg, d.longitude_deg, d.height_m) {
    if (projection == Projection::kUtm) {
      utm.emplace(d);
    }
  }

  std::optional<Eigen::Vector3d> forward(const Geographic& place) const {
    if (utm) {
      return utm->to_map(place);
    }
    Eigen::Vector3d position_map_m;
    cartesian.Forward(place.latitude_deg,
                      place.longitude_deg,
                      place.height_m,
                      position_map_m.x(),
                      position_map_m.y(),
                      position_map_m.z());
    return position_map_m;
  }

  Geographic reverse(const Eigen::Vector3d& position_map_m) const {
    Geographic place;
    cartesian.Reverse(position_map_m.x(),
                      position_map_m.y(),
                      position_map_m.z(),
                      place.latitude_deg,
                      place.longitude_deg,
                      place.height_m);
    return place;
  }

  Datum datum;
  GeographicLib::LocalCartesian cartesian;
  std::optional<UtmPlane> utm;
};

LocalFrame::LocalFrame(const Datum& datum, Projection projection) {
  if (const auto fault = find_fault(place_of(datum))) {
    throw std::invalid_argument("The datum is not a place: " + *fault + ".");
  }
  impl_ = std::make_unique<Impl>(datum, projection);
}

LocalFrame::~LocalFrame() = default;

LocalFrame::LocalFrame(const LocalFrame& other) : impl_(std::make_unique<Impl>(*other.impl_)) {}

LocalFrame& LocalFrame::operator=(const LocalFrame& other) {
  impl_ = std::make_unique<Impl>(*other.impl_);
  return *this;
}

LocalFrame::LocalFrame(LocalFrame&&) noexcept = default;
LocalFrame& LocalFrame::operator=(LocalFrame&&) noexcept = default;

const Datum& LocalFrame::datum() const {
  return impl_->datum;
}

Projection LocalFrame::projection() const {
  return impl_->utm ? Projection::kUtm : Projection::kEnu;
}

std::optional<Eigen::Vector3d> LocalFrame::to_map(const Geographic& place) const {
  // Checked before, because GeographicLib wraps silly longitudes without a word, and after, because
  // LocalCartesian answers NaN without throwing.
  if (find_fault(place)) {
    return std::nullopt;
  }
  const std::optional<Eigen::Vector3d> position_map_m = impl_->forward(place);
  if (!position_map_m || !position_map_m->allFinite()) {
    return std::nullopt;
  }
  return position_map_m;
}

Geographic LocalFrame::to_geographic(const Eigen::Vector3d& position_map_m) const {
  if (!position_map_m.allFinite()) {
    return {};
  }
  Geographic place = impl_->reverse(position_map_m);
  if (impl_->utm) {
    // The two projections differ by millimetres in a kilometre: one correction makes it exact.
    if (const auto there = to_map(place)) {
      place = impl_->reverse(2.0 * position_map_m - *there);
    }
  }
  return place;
}

Eigen::Matrix3d LocalFrame::R_map_enu(const Geographic& place) const {
  // GeographicLib: row-major M with v_map = M v_enu, columns the ENU axes at `place` in map.
  std::vector<double> rotation(9);
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
  impl_->cartesian.Forward(
      place.latitude_deg, place.longitude_deg, place.height_m, x, y, z, rotation);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation.data());
}

}  // namespace trigpoint::geodesy
