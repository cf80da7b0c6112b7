// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The drives on which eskf18 is measured: cheap IMUs with biases and vibration of their own in
// every run. Figures are gathered over seeds; tests state what they must be.
#pragma once

#include "drive.hpp"
#include "urban.hpp"

#include <array>
#include <vector>

namespace trigpoint::gps_odometry {

/// Biases of 0.17 deg/s and 0.05 m/s^2 (1 sigma an axis), vibration while moving, RTK, lever arm.
Sensors cheap_robot(unsigned seed);

/// Errors at one age of an outage over all runs.
struct OutageFigure {
  double age_s{0.0};
  double rms_m{0.0};    ///< 3-D
  double sigma_m{0.0};  ///< published, 3-D
  double inside{0.0};   ///< share of axes within 1.96 sigma
};

std::vector<OutageFigure> measure_outage(double speed_mps, int runs, const Config& config);

/// Average NEES per degree of freedom of the raw position covariance at 20 epochs, where truth and
/// model are the same.
std::array<double, 20> measure_raw_anees(int runs);

struct UrbanFigure {
  double anees{0.0};  ///< published covariance, per degree of freedom
  double inside{0.0};
  double rms_m{0.0};
  double median_sigma_m{0.0};
  double worst_m{0.0};
};

UrbanFigure measure_urban(int runs, double duration_s);

}  // namespace trigpoint::gps_odometry
