// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What is asked of numbers on the command line, refused with a sentence.
#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <optional>
#include <string>

namespace trigpoint::cli {

/// Finite and more than 0.
CLI::Validator more_than_zero();

/// Finite and not negative.
CLI::Validator zero_or_more();

/// A whole number from 0 to 2^64 - 1, in decimal digits only: CLI11 lets -1 wrap around.
CLI::Validator whole_number();

/// How long a scenario is driven: the option's value, or nothing (0) for the scenario's own. Throws
/// ConfigError, naming `option`, beyond the longest that a scenario may last.
std::optional<double> scenario_duration_s(double option_s,
                                          const std::string& option = "--duration");

/// Throws ConfigError when --rate is neither "max" (0 is returned) nor a finite number above 0.
double rate_of(const std::string& text);

}  // namespace trigpoint::cli
