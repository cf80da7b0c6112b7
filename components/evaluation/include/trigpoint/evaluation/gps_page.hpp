// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A page of pictures: error of GPS filters with the band of three sigma that they publish, through
// an outage: a picture with a column a filter and a row an axis, and one of the 3-D errors.
#pragma once

#include <Eigen/Core>

#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// One published position against the truth, axes of map.
struct ErrorSample {
  double time_s{0.0};
  Eigen::Vector3d error_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d sigma_m{Eigen::Vector3d::Zero()};
};

struct FilterErrors {
  std::string name;
  std::vector<ErrorSample> samples;  ///< in the order of time
};

struct GpsPage {
  std::string title;
  double outage_from_s{0.0};
  double outage_to_s{0.0};
  std::vector<FilterErrors> filters;
};

/// Writes index.html, bands.png and all.png into `folder`, scripts and data into its plots/.
/// Returns the page's path. Throws std::runtime_error naming what failed.
std::string draw_gps_page(const GpsPage& page,
                          const std::string& folder,
                          const std::string& gnuplot = "gnuplot");

}  // namespace trigpoint::evaluation
