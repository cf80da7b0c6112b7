// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Listens to the bus for a while and tells who says what.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/bus/discovered.hpp"

#include "known_topics.hpp"

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace trigpoint::recording {

struct TopicSurvey {
  KnownTopic topic;
  std::uint64_t messages{0};
  double heard_s{0.0};  ///< from the first message to the end of the survey
  double rate_hz{0.0};  ///< within heard_s; 0 with fewer than two messages
  std::uint64_t bytes{0};
  std::set<std::string> writers;              ///< GUIDs of those who were heard
  std::set<std::string> silent_writers;       ///< matched, but nothing came from them
  std::set<std::string> predecessors;         ///< of those heard: silent since before another came
  std::map<std::string, unsigned> processes;  ///< numbers of the writers' processes, where told
  std::set<std::string> refused;              ///< QoS policies for which a writer did not match
  std::vector<std::string> remarks;           ///< wrong units, missing fields, frames: sentences
  std::optional<GnssFix> last_fix;            ///< or datum
  /// By writer, also those who have left: until the end of the survey, since the newest message or,
  /// where none came, since it was found.
  std::map<std::string, double> silent_s;
  /// Of them those who have left: how long they had been silent by then. One that ends says so; of
  /// one that is stopped, hangs as a whole or lost its network only the bus's lease runs out.
  std::map<std::string, double> silent_before_leaving_s;
  std::optional<LioStatus> last_lio_status;
  double without_track_s{0.0};  ///< for so long, up to the end, lio/status has told of no track
};

struct SurveyOptions {
  bus::Config bus;
  std::vector<KnownTopic> topics;
  double duration_s{5.0};
  std::function<void(const Event&)> on_event{};  ///< may be empty
  /// May be empty; told before leaving: everybody's writers and readers, on all topics.
  std::function<void(std::vector<bus::DiscoveredEndpoint>)> on_discovered{};
};

/// Joins the bus, listens, leaves. Ends early on SIGINT or SIGTERM. Throws std::runtime_error when
/// the bus cannot be joined.
std::vector<TopicSurvey> survey_bus(const SurveyOptions& options);

}  // namespace trigpoint::recording
