// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The GPS filters side by side on the same simulated drives, and the figures that are taken of
// them.
#pragma once

#include "trigpoint/gps_odometry/gps_odometry.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <Eigen/Core>

#include <array>
#include <functional>
#include <string>
#include <vector>

namespace trigpoint {

inline constexpr std::array<const char*, 3> kFilters{"ekf15", "eskf18", "ekf15_strict"};

/// One published position against the truth.
struct DriveSample {
  double time_s{0.0};  ///< since the scenario's start
  Eigen::Vector3d error_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d sigma_m{Eigen::Vector3d::Zero()};
  double nees{0.0};  ///< of the position, 3 degrees of freedom
  GpsHealth health{GpsHealth::kInit};
};

using DriveSamples = std::vector<DriveSample>;

/// `only` may drop a fix (false) by its time since the start.
using FixFilter = std::function<bool(double)>;

/// All three filters on the same inputs, in the order of kFilters.
std::array<DriveSamples, 3> drive_all(const simulator::Scenario& scenario,
                                      std::uint64_t seed,
                                      double duration_s,
                                      const FixFilter& only = {});

/// A shipped scenario with more faults, each "{type: ..., ...}".
simulator::Scenario scenario_with(const std::string& name, const std::vector<std::string>& faults);

/// drive_all over seeds 1 to `runs`, two at a time; the order is that of the seeds.
std::vector<std::array<DriveSamples, 3>> drive_seeds(
    int runs,
    const std::function<std::array<DriveSamples, 3>(std::uint64_t)>& drive);

/// Errors and what was said about them, over any number of samples.
class Honesty {
 public:
  void add(const DriveSample& sample);
  void add(const DriveSamples& samples, double from_s, double to_s = 1e9);

  double rms_m() const;
  double rms_up_m() const;
  double rms_level_m() const;
  double anees() const;   ///< per degree of freedom
  double inside() const;  ///< share of axes within 1.96 sigma
  double inside_up() const;
  double median_sigma_m() const;  ///< 3-D

  double worst_m() const { return worst_m_; }

  std::size_t count() const { return sigmas_.size(); }

 private:
  Eigen::Vector3d square_sum_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d inside_{Eigen::Vector3d::Zero()};
  double nees_sum_{0.0};
  double worst_m_{0.0};
  std::vector<double> sigmas_;
};

/// The newest sample up to `time_s`.
const DriveSample& sample_at(const DriveSamples& samples, double time_s);

/// Largest jump of the error between consecutive samples.
double largest_step_m(const DriveSamples& samples, double from_s, double to_s);

}  // namespace trigpoint
