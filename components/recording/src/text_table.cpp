// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "text_table.hpp"

#include "trigpoint/recording/log.hpp"

#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>

namespace trigpoint::recording {

std::vector<std::string> read_lines(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) {
    throw LogError(file.string() + ": cannot be read; it belongs to every KITTI raw drive");
  }
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty() && line.back() == '\r') {
      line.pop_back();
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

std::vector<double> parse_numbers(const std::string& line,
                                  char separator,
                                  std::size_t at_least,
                                  const std::filesystem::path& file,
                                  std::size_t line_number) {
  const auto refuse = [&](const std::string& what) {
    throw LogError(file.string() + ":" + std::to_string(line_number) + ": " + what);
  };
  std::vector<double> numbers;
  const char* at = line.data();
  const char* const end = at + line.size();
  while (at < end) {
    if (*at == separator) {
      ++at;
      continue;
    }
    double value = 0.0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc{} || !std::isfinite(value)) {
      refuse("'" + std::string(at, end).substr(0, 20) + "' is not a finite number");
    }
    numbers.push_back(value);
    at = next;
  }
  if (numbers.size() < at_least) {
    refuse(std::to_string(numbers.size()) + " numbers, at least " + std::to_string(at_least) +
           " expected");
  }
  return numbers;
}

}  // namespace trigpoint::recording
