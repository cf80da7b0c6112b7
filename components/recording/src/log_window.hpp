// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/recording/log.hpp"

#include <memory>

namespace trigpoint::recording {

/// The part of a log that `options` asks for: a window in time, and fixes at a limited rate, those
/// beyond it marked as withheld.
std::unique_ptr<LogReader> apply_options(std::unique_ptr<LogReader> log, const LogOptions& options);

}  // namespace trigpoint::recording
