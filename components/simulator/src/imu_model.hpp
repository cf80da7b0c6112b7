// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// References: [1] P. Groves, "Principles of GNSS, inertial and multisensor integrated navigation
// systems", 2nd ed. 2013, sec. 4.4 (errors), 5.3 (rotating Earth). [2] gnss-ins-sim, imu_model.py
// (grades). [3] C. Somigliana's closed form of normal gravity, in GeographicLib.
#pragma once

#include "trigpoint/simulator/simulator.hpp"

#include "fault.hpp"
#include "gnss_model.hpp"
#include "random.hpp"
#include <Eigen/Core>

#include <string>
#include <vector>

namespace trigpoint::simulator {

/// What map feels of the Earth at the datum. Gravity is taken parallel over the whole map.
struct EarthAtDatum {
  EarthAtDatum(const Datum& datum, bool rotation);

  double gravity_mps2{9.8};                                  ///< along -z of map
  Eigen::Vector3d omega_map_radps{Eigen::Vector3d::Zero()};  ///< Earth's rotation, or zero
};

/// A perfect IMU at base_link: gyro = omega_base + R^T omega_earth,
/// accel = R^T (a + 2 omega_earth x v + g e_z), [1] eq. 5.53 with centrifugal force inside gravity.
ImuSample ideal_imu(const TrueState& state, const EarthAtDatum& earth);

/// One grade of instrument, [2]: bias instability as Gauss-Markov, white noise as a density.
struct ImuGrade {
  std::string name;
  double gyro_bias_radps;
  double gyro_noise_radps_per_sqrt_hz;
  double accel_bias_mps2;
  double accel_noise_mps2_per_sqrt_hz;
  double bias_tau_s;
};

/// Throws std::invalid_argument for a name that is not in imu_grade_names().
const ImuGrade& imu_grade(const std::string& name);
std::vector<std::string> imu_grade_names();

/// Turns ideal samples into those of a real instrument: biases, noise, saturation, quantisation.
class ImuModel {
 public:
  ImuModel(const ImuConfig& config, std::uint64_t seed);

  ImuSample measure(const ImuSample& ideal);

  Eigen::Vector3d gyro_bias_radps() const { return gyro_turn_on_ + gyro_drift_.value(); }

  Eigen::Vector3d accel_bias_mps2() const { return accel_turn_on_ + accel_drift_.value(); }

 private:
  ImuConfig config_;
  ImuGrade grade_;
  Random random_;
  Eigen::Vector3d gyro_turn_on_;
  Eigen::Vector3d accel_turn_on_;
  GaussMarkov gyro_drift_;
  GaussMarkov accel_drift_;
};

}  // namespace trigpoint::simulator
