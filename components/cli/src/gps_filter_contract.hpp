// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a GPS filter promises (docs/write_a_gps_filter.md), held against what one said on a drive
// whose truth is known.
#pragma once

#include "trigpoint/simulator/simulator.hpp"

#include "filter_drive.hpp"

#include <string>
#include <vector>

namespace trigpoint::cli {

/// What happened on the drive.
struct FilterScript {
  Nanoseconds start_ns{0};
  Nanoseconds end_ns{0};
  Nanoseconds outage_from_ns{0};
  Nanoseconds outage_to_ns{0};
  double fix_rate_hz{5.0};
  Eigen::Vector3d antenna_position_base_m{Eigen::Vector3d::Zero()};
  Datum datum;  ///< of the truth's map; the filter's may be another one
};

struct ContractCheck {
  std::string name;
  bool passed{false};
  std::string figures;
};

std::vector<ContractCheck> judge_filter(const recording::FilterRecord& record,
                                        const FilterScript& script,
                                        const simulator::Truth& truth);

}  // namespace trigpoint::cli
