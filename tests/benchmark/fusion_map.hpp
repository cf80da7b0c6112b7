// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The rows of the fusion table that are about the past: the saved map and fused_smoothed.tum, made
// as `trigpoint map` and `trigpoint merge` make them. The truth is used for scoring only.
#pragma once

#include "fusion_rows.hpp"

#include <string>

namespace trigpoint::fusion_table {

/// Where and as what a row's drives are made.
struct MapTask {
  cli::InputOptions input;  ///< seed, config files
  std::string mode;
  std::string folder;  ///< empty, and the row's own
};

/// Streets driven before and after each outage, and the smoothed trajectory.
Figures map_across_outages(const MapTask& task, const std::string& scenario);

/// A session that goes on another day, and two that are merged.
Figures map_of_second_run(const MapTask& task);
Figures map_of_merged_sessions(const MapTask& task);

/// How much of what moves is in the saved map.
Figures map_without_traffic(const MapTask& task);

}  // namespace trigpoint::fusion_table
