// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gnss_model.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace trigpoint::simulator {

namespace {

// research/gps C7: KF-GINS data for RTK, Joerger & Pervan 2020 and NCLT for the others.
const std::array<GnssClassModel, 4>& class_models() {
  static const std::array<GnssClassModel, 4> models{{
      {"fixed", {0.010, 0.010, 0.018}, {0.008, 0.008, 0.015}, 100.0, {0.014, 0.014, 0.024}},
      {"float", {0.07, 0.07, 0.10}, {0.35, 0.35, 0.6}, 40.0, {0.3, 0.3, 0.4}},
      {"code", {0.3, 0.3, 0.6}, {1.5, 1.5, 3.0}, 70.0, {1.5, 1.5, 2.4}},
      {"sbas", {0.3, 0.3, 0.6}, {1.5, 1.5, 3.0}, 70.0, {1.2, 1.2, 2.0}},
  }};
  return models;
}

std::size_t class_index(const std::string& name) {
  for (std::size_t i = 0; i < class_models().size(); ++i) {
    if (class_models()[i].name == name) {
      return i;
    }
  }
  throw std::invalid_argument("no GNSS class is called '" + name + "'");
}

/// What a driver writes into NavSatFix, research/gps C1: status by class, order fixed float code
/// sbas.
struct DriverModel {
  std::string name;
  std::array<FixStatus, 4> status;
  CovarianceType covariance_type;
};

const std::array<DriverModel, 4>& driver_models() {
  using enum FixStatus;
  static const std::array<DriverModel, 4> models{{
      {"ublox", {kGbas, kFix, kFix, kFix}, CovarianceType::kDiagonalKnown},
      {"septentrio", {kGbas, kGbas, kFix, kSbas}, CovarianceType::kKnown},
      {"nmea", {kGbas, kGbas, kFix, kSbas}, CovarianceType::kApproximated},
      {"novatel", {kFix, kFix, kFix, kFix}, CovarianceType::kDiagonalKnown},
  }};
  return models;
}

const DriverModel& driver_model(const std::string& name) {
  for (const DriverModel& model : driver_models()) {
    if (model.name == name) {
      return model;
    }
  }
  throw std::invalid_argument("no GNSS driver is called '" + name + "'");
}

constexpr std::uint16_t kGpsAndGlonass = 3;

void write_over(const GnssReport& report, GnssFix& fix) {
  fix.latitude_deg = report.latitude_deg.value_or(fix.latitude_deg);
  fix.longitude_deg = report.longitude_deg.value_or(fix.longitude_deg);
  fix.altitude_m = report.altitude_m.value_or(fix.altitude_m);
  if (report.variance_enu_m2 && fix.covariance_type != CovarianceType::kUnknown) {
    fix.covariance_enu_m2 = report.variance_enu_m2->asDiagonal();
  }
  if (report.covariance_unknown) {
    fix.covariance_enu_m2.setZero();
    fix.covariance_type = CovarianceType::kUnknown;
  }
}

}  // namespace

GaussMarkov::GaussMarkov(const Eigen::Vector3d& sigma, double tau_s, Random& random)
    : sigma_(sigma), tau_s_(tau_s), value_(sigma.cwiseProduct(random.normal3())) {}

void GaussMarkov::advance(double dt_s, Random& random) {
  const double keep = std::exp(-dt_s / tau_s_);
  value_ = keep * value_ + std::sqrt(1.0 - keep * keep) * sigma_.cwiseProduct(random.normal3());
}

const GnssClassModel& gnss_class_model(const std::string& name) {
  return class_models()[class_index(name)];
}

std::vector<std::string> gnss_class_names() {
  std::vector<std::string> names{"none"};
  for (const GnssClassModel& model : class_models()) {
    names.push_back(model.name);
  }
  return names;
}

std::vector<std::string> gnss_driver_names() {
  std::vector<std::string> names;
  for (const DriverModel& model : driver_models()) {
    names.push_back(model.name);
  }
  return names;
}

GnssModel::GnssModel(const GnssConfig& config, const Datum& datum, std::uint64_t seed)
    : config_(config), frame_(datum), random_(derive_seed(seed, kGnssSeed)) {
  for (const GnssClassModel& model : class_models()) {
    correlated_.emplace_back(model.correlated_m, model.tau_s, random_);
  }
  white_.resize(class_models().size());
}

GnssEpoch GnssModel::begin(Nanoseconds stamp_ns, const Eigen::Vector3d& antenna_map_m) {
  for (std::size_t i = 0; i < correlated_.size(); ++i) {
    correlated_[i].advance(1.0 / config_.rate_hz, random_);
    white_[i] = class_models()[i].white_m.cwiseProduct(random_.normal3());
  }
  GnssEpoch epoch;
  epoch.stamp_ns = stamp_ns;
  epoch.period_s = 1.0 / config_.rate_hz;
  epoch.antenna_map_m = antenna_map_m;
  epoch.gnss_class = config_.gnss_class;
  const double jitter_s = random_.uniform(-config_.latency_jitter_s, config_.latency_jitter_s);
  const bool late = random_.chance(config_.late_share);
  epoch.latency_s = std::max(0.0, (late ? config_.late_latency_s : config_.latency_s) + jitter_s);
  return epoch;
}

GnssFix GnssModel::finish(const GnssEpoch& epoch) {
  if (!epoch.frozen || !last_) {
    last_ = measure(epoch);
  }
  GnssFix fix = *last_;
  fix.stamp_ns = epoch.stamp_ns + epoch.stamp_shift_ns;
  return fix;
}

GnssFix GnssModel::measure(const GnssEpoch& epoch) const {
  GnssFix fix;
  fix.frame_id = "gnss_antenna";
  fix.service = kGpsAndGlonass;
  // "none": status no fix, position not a number: it stays at the sensor's border as drivers send
  // it.
  if (epoch.gnss_class != "none") {
    solve(epoch, fix);
  }
  write_over(epoch.report, fix);
  return fix;
}

void GnssModel::solve(const GnssEpoch& epoch, GnssFix& fix) const {
  const std::size_t i = class_index(epoch.gnss_class);
  const DriverModel& driver = driver_model(config_.driver);
  const Eigen::Vector3d error =
      config_.noise_scale * epoch.error_scale * (correlated_[i].value() + white_[i]);
  const geodesy::Geographic place =
      frame_.to_geographic(epoch.antenna_map_m + error + epoch.extra_error_m);
  fix.status = driver.status[i];
  fix.latitude_deg = place.latitude_deg;
  fix.longitude_deg = place.longitude_deg;
  fix.altitude_m = place.height_m;
  fix.covariance_enu_m2 = class_models()[i].reported_m.cwiseAbs2().asDiagonal();
  fix.covariance_type = driver.covariance_type;
}

}  // namespace trigpoint::simulator
