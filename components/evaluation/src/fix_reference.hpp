// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/evaluation/trajectory_error.hpp"

#include <Eigen/Core>

#include <vector>

namespace trigpoint::evaluation {

enum class FixChoice { kWithheld, kAll };

/// The antenna in map at every chosen fix; attitudes are identity. Fixes without a place or with
/// status "no fix" are left out. In order of time, one per stamp.
Trajectory fix_positions(const std::vector<exporter::LoggedFix>& fixes,
                         const Datum& datum,
                         FixChoice choice);

/// The estimate's antenna (pose times lever arm) at the fixes' stamps; between poses that are
/// farther apart than pose_at allows there is no pair.
Association associate_fixes(const Trajectory& estimate,
                            const Trajectory& fix_positions_map,
                            const Eigen::Vector3d& antenna_position_base_m,
                            Nanoseconds largest_gap_ns = kDefaultGap_ns);

}  // namespace trigpoint::evaluation
