// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "reader_events.hpp"

#include "rtps_limits.hpp"

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

Event reader_lost_event(const std::string& dds_topic, const std::exception& why) {
  return {Severity::kError,
          0,
          "bus_reader_lost",
          "nothing on " + dds_topic + " is heard any more: " + why.what()};
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

Event fragment_refused_event(const std::string& sender, std::uint64_t count) {
  const auto either = [](std::int64_t bulk_bytes, std::int64_t small_bytes) {
    return std::to_string(bulk_bytes) + " bytes (" + std::to_string(small_bytes) +
           " on topics that are not bulk)";
  };
  return {Severity::kWarning,
          0,
          "bus_fragment_refused",
          "a datagram from " + sender +
              " was dropped: it has a fragment that contradicts itself, " +
              "is of a sample above " + either(kLargestMessage_bytes, kLargestSmallMessage_bytes) +
              ", or came while unfinished samples took the " +
              either(kIncompleteBulk_bytes, kIncompleteOther_bytes) + " that they may; " +
              std::to_string(count) + " so far"};
}

Event too_large_event(std::size_t size_bytes, const Qos& qos, std::uint64_t count) {
  return {Severity::kWarning,
          0,
          "bus_sample_not_sent",
          "a sample of " + std::to_string(size_bytes) + " bytes was not sent; at most " +
              std::to_string(largest_message_bytes(qos)) + " bytes can be on a topic that is " +
              (qos.bulk ? "" : "not ") + "bulk; " + std::to_string(count) + " so far"};
}

}  // namespace trigpoint::bus
