// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Files of a session that goes on which cannot be read: a power failure leaves empty ones. They are
// no reason not to start, and a warning says what that costs.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/export/session.hpp"

#include <stdexcept>
#include <string>

namespace trigpoint::pipeline {

/// `damaged` names the file, `consequence` what is done without it.
Event warning_of(const std::runtime_error& damaged, const std::string& consequence);

/// The counts of `program` in the folder `session`; begun anew where what is there is damaged.
exporter::CountsWriter open_counts(const std::string& session,
                                   const std::string& program,
                                   exporter::Opening opening,
                                   Events& events);

}  // namespace trigpoint::pipeline
