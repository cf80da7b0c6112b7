// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "skipped_messages.hpp"

#include <algorithm>
#include <utility>

namespace trigpoint::recording {

void SkippedMessages::add(const Undecodable& message,
                          std::uint64_t number,
                          Nanoseconds receive_ns,
                          const std::string& detail) {
  const bool first_of_topic =
      std::none_of(counts_.begin(), counts_.end(), [&](const Undecodable& known) {
        return known.topic == message.topic;
      });
  if (first_of_topic) {
    events_.push_back({Severity::kWarning,
                       receive_ns,
                       "message_undecodable",
                       "message " + std::to_string(number) + " of '" + message.topic +
                           "' is skipped: " + detail +
                           "; others like it are counted and told at the end"});
  }
  const auto known = std::find_if(counts_.begin(), counts_.end(), [&](const Undecodable& other) {
    return other.topic == message.topic && other.reason == message.reason;
  });
  if (known != counts_.end()) {
    ++known->count;
    return;
  }
  counts_.push_back(message);
  counts_.back().count = 1;
}

Events SkippedMessages::take_events() {
  return std::exchange(events_, {});
}

Events fault_events(const LogSummary& summary) {
  Events events;
  for (const std::string& fault : summary.faults) {
    events.push_back({Severity::kWarning, summary.first_ns, "log_fault", fault});
  }
  return events;
}

Events undecodable_events(const LogReader& log) {
  Events events;
  for (const Undecodable& skipped : log.undecodable()) {
    events.push_back({Severity::kWarning,
                      log.summary().last_ns,
                      "messages_undecodable",
                      std::to_string(skipped.count) + " messages of '" + skipped.topic +
                          "' could not be decoded and were skipped: " + skipped.reason});
  }
  return events;
}

}  // namespace trigpoint::recording
