// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "reader_events.hpp"

#include <bit>

namespace trigpoint::bus {

bool is_told(std::uint64_t count) {
  return std::has_single_bit(count);
}

Event best_effort_event(const std::string& dds_topic) {
  return {Severity::kWarning,
          0,
          "bus_reader_best_effort",
          "a writer on " + dds_topic +
              " offers only BEST_EFFORT; our reader now asks for no more, and samples that the "
              "network loses stay lost"};
}

std::optional<Event> malformed_event(const std::string& dds_topic,
                                     const std::string& writer_guid,
                                     std::uint64_t count) {
  if (!is_told(count)) {
    return std::nullopt;
  }
  return Event{
      Severity::kWarning,
      0,
      "bus_malformed_message",
      "a sample on " + dds_topic + " from writer " + writer_guid +
          " is not a message of that topic's type and was refused; the reader has refused " +
          std::to_string(count) + " so far. Does that writer use another definition?"};
}

}  // namespace trigpoint::bus
