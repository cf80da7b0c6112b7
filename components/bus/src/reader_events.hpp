// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What every backend's reader tells the participant's sink.
#pragma once

#include "trigpoint/base/event.hpp"

#include <cstdint>
#include <optional>
#include <string>

namespace trigpoint::bus {

/// Of what may come in streams the first, second, fourth, eighth, ... is told, so that the log is
/// not flooded.
bool is_told(std::uint64_t count);

/// A reader was made anew as best effort.
Event best_effort_event(const std::string& dds_topic);

/// The `count`th sample that could not be decoded came from this writer; nothing when it is not
/// told.
std::optional<Event> malformed_event(const std::string& dds_topic,
                                     const std::string& writer_guid,
                                     std::uint64_t count);

}  // namespace trigpoint::bus
