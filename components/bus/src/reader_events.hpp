// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What every backend's reader tells the participant's sink.
#pragma once

#include "trigpoint/base/event.hpp"

#include <cstdint>
#include <optional>
#include <string>

namespace trigpoint::bus {

/// A reader was made anew as best effort.
Event best_effort_event(const std::string& dds_topic);

/// The `count`th sample that could not be decoded came from this writer. Told at the first, second,
/// fourth, eighth, ... so that a stream of them does not flood the log.
std::optional<Event> malformed_event(const std::string& dds_topic,
                                     const std::string& writer_guid,
                                     std::uint64_t count);

}  // namespace trigpoint::bus
