// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What is wrong on a bus as a whole: between writers and readers, and between topics.
#pragma once

#include "bus_survey.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::cli {

/// A topic and a sentence that says what to do.
struct Finding {
  std::string topic;
  std::string sentence;
  bool is_wrong{true};  ///< false: a hint, that may well be no fault
};

/// Writers of a known topic that send another type, and writers outside of ROS 2's names.
std::vector<Finding> wrong_types(const std::vector<recording::TopicSurvey>& surveys,
                                 const std::vector<bus::DiscoveredEndpoint>& endpoints);

/// Inputs that nobody writes while their type is written on a topic that is not ours.
std::vector<Finding> inputs_under_other_names(
    const std::vector<recording::TopicSurvey>& surveys,
    const std::vector<bus::DiscoveredEndpoint>& endpoints);

/// Readers that ask for more than a writer of the same topic and type offers.
std::vector<Finding> readers_in_vain(const std::vector<bus::DiscoveredEndpoint>& endpoints);

/// Topics that are for one writer and have several. Several GPS filters are welcome.
std::vector<Finding> several_writers(const std::vector<recording::TopicSurvey>& surveys);

/// Fixes far from the datum that would be near it with latitude and longitude exchanged.
std::vector<Finding> swapped_positions(const std::vector<recording::TopicSurvey>& surveys);

/// Sensors that come more rarely than the filters need. Only of use on real time.
std::vector<Finding> slow_inputs(const std::vector<recording::TopicSurvey>& surveys,
                                 const RobotConfig& robot);

/// All of the above.
std::vector<Finding> findings_of(const std::vector<recording::TopicSurvey>& surveys,
                                 const std::vector<bus::DiscoveredEndpoint>& endpoints,
                                 const RobotConfig& robot);

/// Empty when receive buffers may have `wanted_bytes`; `limit_bytes` is net.core.rmem_max.
std::string buffer_advice(std::int64_t limit_bytes, std::int64_t wanted_bytes);

/// A line for each participant: its program, its DDS vendor, what it writes and reads.
std::vector<std::string> who_is_there(const std::vector<bus::DiscoveredEndpoint>& endpoints);

}  // namespace trigpoint::cli
