// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Programs of ours that are there and say nothing, and a mapper that says that it has no track.
#pragma once

#include "bus_survey.hpp"
#include "doctor_findings.hpp"
#include "local_processes.hpp"

#include <vector>

namespace trigpoint::cli {

/// Mapper, filters, gate and clock watch that were found on the bus and have been silent for 2 s on
/// all that they write (each of ours gives its word once a second, whatever its sensors do), or
/// have left the bus without a word; GPS filters of others that are silent while IMU and fixes
/// come. `local` tells how a process of this computer stands.
std::vector<Finding> silent_on_the_bus(const std::vector<recording::TopicSurvey>& surveys,
                                       const std::vector<LocalProcess>& local,
                                       const RobotConfig& robot);

/// Processes of ours that run here for this `domain`, by their environment, for longer than was
/// listened, and were not found on the bus: one that is stopped answers nobody who comes later. Of
/// all others it is a hint: their configuration, or the container they are in, may have them on
/// another bus.
std::vector<Finding> not_on_the_bus(const std::vector<recording::TopicSurvey>& surveys,
                                    const std::vector<LocalProcess>& local,
                                    int domain,
                                    double listened_s);

/// What lio/status says of a mapper that looks for its place, or has not begun, while clouds and
/// IMU samples come.
std::vector<Finding> mapper_without_track(const std::vector<recording::TopicSurvey>& surveys,
                                          const RobotConfig& robot);

}  // namespace trigpoint::cli
