// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A drive in real time through bringup/run, whose processes are killed and stopped on the way, and
// what the bus, the session and its report show of it.
#pragma once

#include "kill_judgement.hpp"

#include <string>
#include <vector>

namespace trigpoint::tests {

struct DriveSettings {
  std::string scenario;
  int seed{1};
  double duration_s{180.0};
  std::string domain;
  std::string session;
  std::string rate{"1"};
  std::vector<std::string> more_arguments;
};

/// Runs it to its end. ROS_DOMAIN_ID of this process is set to the domain.
DriveResult drive(const DriveSettings& settings, const std::vector<Blow>& blows);

const char* name_of(Kind kind);

}  // namespace trigpoint::tests
