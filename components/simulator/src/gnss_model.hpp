// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Errors of a satellite receiver and what its driver makes of them. Numbers: docs of this component
// (README), after KF-GINS and Joerger & Pervan 2020.
#pragma once

#include "trigpoint/geodesy/local_frame.hpp"
#include "trigpoint/simulator/scenario.hpp"

#include "fault.hpp"
#include "random.hpp"
#include <Eigen/Core>

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::simulator {

/// A first-order Gauss-Markov process, exact at any step: x' = e^(-dt/tau) x + sqrt(1 -
/// e^(-2dt/tau)) s n.
class GaussMarkov {
 public:
  /// Starts in its stationary distribution.
  GaussMarkov(const Eigen::Vector3d& sigma, double tau_s, Random& random);

  const Eigen::Vector3d& value() const { return value_; }

  void advance(double dt_s, Random& random);

 private:
  Eigen::Vector3d sigma_;
  double tau_s_;
  Eigen::Vector3d value_;
};

/// Standard deviations east, north, up (m) of one kind of solution.
struct GnssClassModel {
  std::string name;
  Eigen::Vector3d white_m;
  Eigen::Vector3d correlated_m;
  double tau_s;
  Eigen::Vector3d reported_m;
};

/// The model of "fixed", "float", "code" or "sbas". Throws std::invalid_argument for another name.
const GnssClassModel& gnss_class_model(const std::string& name);
/// Their names, and "none".
std::vector<std::string> gnss_class_names();

std::vector<std::string> gnss_driver_names();

/// Simulates the receiver epoch by epoch.
class GnssModel {
 public:
  GnssModel(const GnssConfig& config, const Datum& datum, std::uint64_t seed);

  /// The epoch as the sky would give it: class, latency, nothing lost. Moves the errors on by one
  /// epoch.
  GnssEpoch begin(Nanoseconds stamp_ns, const Eigen::Vector3d& antenna_map_m);
  /// The message for it, after the faults had their say.
  GnssFix finish(const GnssEpoch& epoch);

 private:
  GnssFix measure(const GnssEpoch& epoch) const;
  void solve(const GnssEpoch& epoch, GnssFix& fix) const;

  GnssConfig config_;
  geodesy::LocalFrame frame_;
  Random random_;
  std::vector<GaussMarkov> correlated_;  ///< one a class; all run all the time
  std::vector<Eigen::Vector3d> white_;
  std::optional<GnssFix> last_;  ///< that was not frozen
};

}  // namespace trigpoint::simulator
