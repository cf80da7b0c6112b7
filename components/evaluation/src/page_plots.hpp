// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The plots of report.html: each is a `<figure>`, empty when there is nothing to draw.
#pragma once

#include "trigpoint/base/measurements.hpp"

#include "session_data.hpp"

#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// Trajectories and fixes from above, over the map's points, dropouts marked and numbered.
/// `map` may be empty.
std::string plot_top_view(const SessionData& data, const PointCloud& map);

/// Per axis: sigma of the GPS odometry and of the alignment, threshold, what the gate chose.
std::string plot_uncertainty(const SessionData& data);

/// What became of each fix, a row for each kind of verdict.
std::string plot_verdicts(const SessionData& data);

std::string plot_height(const SessionData& data);
std::string plot_error(const SessionData& data);
std::string plot_scan_times(const SessionData& data);

/// Of a verdict as gate.csv tells it: without the numbers that make it one of its own.
std::string kind_of_verdict(const FixVerdict& verdict);

/// One verdict on each fix that gate.csv tells of: that it was used, if any says so (a receiver may
/// repeat a fix), else the last one. In the order of the fixes.
std::vector<FixVerdict> last_verdicts(const SessionData& data);

}  // namespace trigpoint::evaluation
