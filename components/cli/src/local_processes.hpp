// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Programs of Trigpoint on this computer, as /proc has them (in a container: its own).
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::cli {

struct LocalProcess {
  unsigned number{0};
  std::string program;  ///< "trigpoint_lio_mapper"
  char state{'R'};      ///< as ps shows it: T stopped, D waits for a disk, S sleeps
  double age_s{0.0};
  std::optional<std::string> domain;  ///< its ROS_DOMAIN_ID, empty when not set; of our own user's
};

/// The GPS filters, the mapper, the gate and the clock watch.
std::vector<LocalProcess> local_processes();

}  // namespace trigpoint::cli
