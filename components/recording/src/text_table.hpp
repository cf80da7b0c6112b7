// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Files of numbers as text: read whole, errors name file and line.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trigpoint::recording {

/// Lines without their ends; throws LogError when the file cannot be read.
std::vector<std::string> read_lines(const std::filesystem::path& file);

/// Numbers separated by `separator`; throws LogError naming file and line when the line holds
/// anything else or fewer than `at_least` finite numbers.
std::vector<double> parse_numbers(const std::string& line,
                                  char separator,
                                  std::size_t at_least,
                                  const std::filesystem::path& file,
                                  std::size_t line_number);

}  // namespace trigpoint::recording
