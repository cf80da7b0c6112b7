// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_garbage.hpp"

#include <limits>

namespace trigpoint::simulator {

namespace {

constexpr double kUnset = -2e10;  ///< "do not use" of a receiver, passed on (research/gps C1)
constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

void GpsGarbage::describe(ConfigFields& fields) {
  fields.choice("kind",
                kind_,
                "what is written over the message",
                {"nan",
                 "zero",
                 "out_of_range",
                 "infinite",
                 "nan_height",
                 "negative_variance",
                 "nan_variance"});
  fields.number("share", share_, "of the fixes", {0.0, 1.0});
}

void GpsGarbage::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  if (!moment.each.chance(share_)) {
    return;
  }
  GnssReport& report = epoch.report;
  const auto place = [&report](double degrees, double height_m) {
    report.latitude_deg = degrees;
    report.longitude_deg = degrees;
    report.altitude_m = height_m;
  };
  if (kind_ == "nan") {
    place(kNaN, kNaN);
  } else if (kind_ == "zero") {
    place(0.0, 0.0);
  } else if (kind_ == "out_of_range") {
    place(kUnset, kUnset);
  } else if (kind_ == "infinite") {
    place(kInfinity, kInfinity);
  } else if (kind_ == "nan_height") {
    report.altitude_m = kNaN;
  } else if (kind_ == "negative_variance") {
    report.variance_enu_m2 = Eigen::Vector3d::Constant(-1.0);
  } else {
    report.variance_enu_m2 = Eigen::Vector3d::Constant(kNaN);
  }
}

}  // namespace trigpoint::simulator
