// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fix_checks.hpp"

#include "trigpoint/base/sentence.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Variances that say "no idea" (1 km and more).
constexpr double kHugeVariance_m2 = 1e6;
// No receiver on a vehicle is better than this; keeps R regular.
constexpr double kLeastSigma_m = 0.005;
constexpr double kVerticalFactor = 2.0;
// Receivers with nothing to say send places within 0.1 m of 0, 0.
constexpr double kNullIsland_deg = 1e-6;

FixVerdict refuse(const std::string& reason, const std::string& text) {
  return {std::nullopt, reason, text};
}

double default_sigma_m(FixStatus status, const Config& config) {
  switch (status) {
    case FixStatus::kSbas:
      return config.default_sigma_sbas_m;
    case FixStatus::kGbas:
      return config.default_sigma_float_m;
    default:
      return config.default_sigma_code_m;
  }
}

Matrix3d default_covariance(FixStatus status, const Config& config) {
  const double sigma = default_sigma_m(status, config);
  return Vector3d(sigma, sigma, kVerticalFactor * sigma).cwiseAbs2().asDiagonal();
}

/// Status cannot tell RTK fixed from float; the covariance can (research/gps C1).
GnssClass class_of(FixStatus status, double sigma_m, bool assumed, const Config& config) {
  if (!assumed && sigma_m < config.default_sigma_fixed_m) {
    return GnssClass::kFixed;
  }
  if (!assumed && sigma_m < 10.0 * config.default_sigma_fixed_m) {
    return GnssClass::kFloat;
  }
  if (assumed && status == FixStatus::kGbas) {
    return GnssClass::kFloat;
  }
  if (status == FixStatus::kUnknown) {
    return GnssClass::kUnknown;
  }
  return status == FixStatus::kSbas ? GnssClass::kSbas : GnssClass::kCode;
}

/// What was done to a covariance before it could be used.
struct Repair {
  Matrix3d covariance_m2;
  bool assumed{false};
  std::string reason;
  std::string text;
};

Repair repair_covariance(const GnssFix& fix, const Config& config) {
  const Matrix3d reported = 0.5 * (fix.covariance_enu_m2 + fix.covariance_enu_m2.transpose());
  if (fix.covariance_type == CovarianceType::kUnknown || reported.diagonal().minCoeff() <= 0.0) {
    return {default_covariance(fix.status, config),
            true,
            "used_with_default_covariance",
            sentence("The fix came with a variance of %g m^2 or of unknown type, expected a "
                     "positive one; the default of its class is used.",
                     reported.diagonal().minCoeff())};
  }
  if (reported(2, 2) > kHugeVariance_m2) {
    // The height is not known, its position is: larger numbers would drown that in rounding.
    const Vector3d bounded = reported.diagonal().cwiseMin(kHugeVariance_m2);
    return {bounded.asDiagonal(),
            false,
            "used_with_diagonal_covariance",
            sentence("The fix's vertical variance is %g m^2, expected at most 1e6; that is used, "
                     "without correlations.",
                     reported(2, 2))};
  }
  const double least =
      Eigen::SelfAdjointEigenSolver<Matrix3d>(reported, Eigen::EigenvaluesOnly).eigenvalues()(0);
  if (!(least > 0.0)) {
    return {reported.diagonal().asDiagonal(),
            false,
            "used_with_diagonal_covariance",
            sentence("The fix's covariance has the eigenvalue %g m^2, expected all positive; its "
                     "diagonal alone is used.",
                     least)};
  }
  return {reported, false, "", ""};
}

FixVerdict refuse_message(const GnssFix& fix) {
  if (!is_usable_stamp(fix.stamp_ns)) {
    return refuse(
        "stamp_out_of_range",
        sentence("Fix refused: its stamp is %g s, expected 0 to 8e9.", to_seconds(fix.stamp_ns)));
  }
  if (fix.status == FixStatus::kNoFix) {
    return refuse("no_fix", "The receiver says that it has no fix.");
  }
  const geodesy::Geographic place{fix.latitude_deg, fix.longitude_deg, fix.altitude_m};
  if (!std::isfinite(fix.latitude_deg + fix.longitude_deg + fix.altitude_m)) {
    return refuse("not_finite", "Fix refused: " + geodesy::find_fault(place).value_or("") + ".");
  }
  if (std::abs(fix.latitude_deg) < kNullIsland_deg &&
      std::abs(fix.longitude_deg) < kNullIsland_deg) {
    return refuse(
        "zero_position",
        "Fix refused: latitude and longitude are 0, as receivers without a position send.");
  }
  if (const auto fault = geodesy::find_fault(place)) {
    return refuse("out_of_range", "Fix refused: " + *fault + ".");
  }
  const bool covariance_meant = fix.covariance_type != CovarianceType::kUnknown;
  if (covariance_meant && !fix.covariance_enu_m2.allFinite()) {
    return refuse("covariance_not_finite",
                  "Fix refused: its covariance is not finite, expected variances in m^2 or type "
                  "UNKNOWN.");
  }
  const double widest = fix.covariance_enu_m2.diagonal().head<2>().maxCoeff();
  if (covariance_meant && widest > kHugeVariance_m2) {
    return refuse(
        "covariance_huge",
        sentence("Fix refused: horizontal variance %g m^2, expected at most 1e6.", widest));
  }
  return {};
}

}  // namespace

FixVerdict check_fix(const GnssFix& fix, const Config& config) {
  if (FixVerdict refused = refuse_message(fix); !refused.reason.empty()) {
    return refused;
  }
  const Repair repair = repair_covariance(fix, config);
  CheckedFix checked;
  checked.stamp_ns = fix.stamp_ns;
  checked.place = {fix.latitude_deg, fix.longitude_deg, fix.altitude_m};
  checked.assumed_covariance = repair.assumed;
  const double sigma = std::sqrt(repair.covariance_m2.diagonal().head<2>().maxCoeff());
  checked.gnss_class = class_of(fix.status, sigma, repair.assumed, config);
  const double scale = repair.assumed ? 1.0 : config.fix_sigma_scale;
  checked.covariance_enu_m2 =
      scale * scale * repair.covariance_m2 + kLeastSigma_m * kLeastSigma_m * Matrix3d::Identity();
  return {checked, repair.reason, repair.text};
}

std::int64_t FrozenReceiver::count(const geodesy::Geographic& place) {
  const bool same = place.latitude_deg == last_.latitude_deg &&
                    place.longitude_deg == last_.longitude_deg && place.height_m == last_.height_m;
  repeats_ = same ? repeats_ + 1 : 1;
  last_ = place;
  return repeats_;
}

}  // namespace trigpoint::gps_odometry
