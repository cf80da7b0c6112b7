// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "imu_model.hpp"

#include <GeographicLib/Constants.hpp>
#include <GeographicLib/NormalGravity.hpp>

#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace trigpoint::simulator {

namespace {

constexpr double kDegreesPerHour = std::numbers::pi / 180.0 / 3600.0;    // rad/s
constexpr double kDegreesPerRootHour = std::numbers::pi / 180.0 / 60.0;  // rad/s/sqrt(Hz)
constexpr double kPerRootHour = 1.0 / 60.0;  // m/s/sqrt(h) to m/s^2/sqrt(Hz)

// research/gps C7.
const std::array<ImuGrade, 2>& grades() {
  static const std::array<ImuGrade, 2> all{{
      {"low", 10.0 * kDegreesPerHour, 0.75 * kDegreesPerRootHour, 2e-4, 0.05 * kPerRootHour, 100.0},
      {"mid", 3.5 * kDegreesPerHour, 0.25 * kDegreesPerRootHour, 5e-5, 0.03 * kPerRootHour, 100.0},
  }};
  return all;
}

Eigen::Vector3d quantise(const Eigen::Vector3d& value, double limit, double step) {
  const Eigen::Vector3d limited = value.cwiseMin(limit).cwiseMax(-limit);
  return step > 0.0 ? Eigen::Vector3d(step * (limited / step).array().round()) : limited;
}

}  // namespace

EarthAtDatum::EarthAtDatum(const Datum& datum, bool rotation) {
  double north_mps2 = 0.0;
  double up_mps2 = 0.0;
  GeographicLib::NormalGravity::WGS84().Gravity(
      datum.latitude_deg, datum.height_m, north_mps2, up_mps2);
  gravity_mps2 = -up_mps2;
  if (rotation) {
    const double latitude = datum.latitude_deg * std::numbers::pi / 180.0;
    omega_map_radps = GeographicLib::Constants::WGS84_omega() *
                      Eigen::Vector3d(0.0, std::cos(latitude), std::sin(latitude));
  }
}

ImuSample ideal_imu(const TrueState& state, const EarthAtDatum& earth) {
  const Eigen::Quaterniond q_base_map = state.T_map_base.q.conjugate();
  ImuSample sample;
  sample.frame_id = "base_link";
  sample.gyro_radps = state.omega_base_radps + q_base_map * earth.omega_map_radps;
  sample.accel_mps2 =
      q_base_map * (state.a_map_mps2 + 2.0 * earth.omega_map_radps.cross(state.v_map_mps) +
                    earth.gravity_mps2 * Eigen::Vector3d::UnitZ());
  return sample;
}

const ImuGrade& imu_grade(const std::string& name) {
  for (const ImuGrade& grade : grades()) {
    if (grade.name == name) {
      return grade;
    }
  }
  throw std::invalid_argument("no IMU grade is called '" + name + "'");
}

std::vector<std::string> imu_grade_names() {
  std::vector<std::string> names;
  for (const ImuGrade& grade : grades()) {
    names.push_back(grade.name);
  }
  return names;
}

ImuModel::ImuModel(const ImuConfig& config, std::uint64_t seed)
    : config_(config),
      grade_(imu_grade(config.grade)),
      random_(derive_seed(seed, kImuSeed)),
      gyro_turn_on_(config.noise_scale * config.gyro_turn_on_bias_radps * random_.normal3()),
      accel_turn_on_(config.noise_scale * config.accel_turn_on_bias_mps2 * random_.normal3()),
      gyro_drift_(Eigen::Vector3d::Constant(config.noise_scale * grade_.gyro_bias_radps),
                  grade_.bias_tau_s,
                  random_),
      accel_drift_(Eigen::Vector3d::Constant(config.noise_scale * grade_.accel_bias_mps2),
                   grade_.bias_tau_s,
                   random_) {}

ImuSample ImuModel::measure(const ImuSample& ideal) {
  ImuSample sample = ideal;
  // A density over the bandwidth of the sample rate: sigma = density * sqrt(rate).
  const double scale = config_.noise_scale * std::sqrt(config_.rate_hz);
  sample.gyro_radps +=
      gyro_bias_radps() + scale * grade_.gyro_noise_radps_per_sqrt_hz * random_.normal3();
  sample.accel_mps2 +=
      accel_bias_mps2() + scale * grade_.accel_noise_mps2_per_sqrt_hz * random_.normal3();
  sample.gyro_radps =
      quantise(sample.gyro_radps, config_.gyro_limit_radps, config_.gyro_step_radps);
  sample.accel_mps2 =
      quantise(sample.accel_mps2, config_.accel_limit_mps2, config_.accel_step_mps2);
  gyro_drift_.advance(1.0 / config_.rate_hz, random_);
  accel_drift_.advance(1.0 / config_.rate_hz, random_);
  return sample;
}

}  // namespace trigpoint::simulator
