// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What backends tell the participant's sink.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/bus/qos.hpp"

#include <cstddef>
#include <cstdint>
#include <exception>
#include <optional>
#include <string>

namespace trigpoint::bus {

/// Of what may come in streams the first, second, fourth, eighth, ... is told, so that the log is
/// not flooded.
bool is_told(std::uint64_t count);

/// A reader was made anew as best effort.
Event best_effort_event(const std::string& dds_topic);

/// It could not be made anew.
Event reader_lost_event(const std::string& dds_topic, const std::exception& why);

/// The `count`th sample that could not be decoded came from this writer; nothing when it is not
/// told.
std::optional<Event> malformed_event(const std::string& dds_topic,
                                     const std::string& writer_guid,
                                     std::uint64_t count);

/// The `count`th datagram with a fragment for which there is no room.
Event fragment_refused_event(const std::string& sender, std::uint64_t count);

/// The `count`th sample of this participant that is larger than those of such a topic may be.
Event too_large_event(std::size_t size_bytes, const Qos& qos, std::uint64_t count);

}  // namespace trigpoint::bus
