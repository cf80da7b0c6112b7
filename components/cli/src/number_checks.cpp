// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "number_checks.hpp"

#include "trigpoint/base/config.hpp"

#include <charconv>
#include <cmath>
#include <cstdint>

namespace trigpoint::cli {

namespace {

constexpr double kLongestScenario_s = 1e5;  // the bound of duration_s in a scenario's file
constexpr double kShortestScenario_s = 0.1;

template <typename T>
std::optional<T> read(const std::string& text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional<T>(value)
                                                                  : std::nullopt;
}

}  // namespace

CLI::Validator more_than_zero() {
  const auto check = [](const std::string& text) -> std::string {
    const auto value = read<double>(text);
    return value && std::isfinite(*value) && *value > 0.0
               ? ""
               : "must be a number above 0; is '" + text + "'";
  };
  return CLI::Validator(check, "> 0");
}

CLI::Validator zero_or_more() {
  const auto check = [](const std::string& text) -> std::string {
    const auto value = read<double>(text);
    return value && std::isfinite(*value) && *value >= 0.0
               ? ""
               : "must be a number of 0 or more; is '" + text + "'";
  };
  return CLI::Validator(check, ">= 0");
}

CLI::Validator whole_number() {
  const auto check = [](const std::string& text) -> std::string {
    return read<std::uint64_t>(text)
               ? ""
               : "must be a whole number from 0 to 18446744073709551615; is '" + text + "'";
  };
  return CLI::Validator(check, ">= 0");
}

std::optional<double> scenario_duration_s(double option_s, const std::string& option) {
  if (option_s == 0.0) {
    return std::nullopt;
  }
  if (!(option_s >= kShortestScenario_s && option_s <= kLongestScenario_s)) {
    throw ConfigError(option + ": a scenario lasts from 0.1 s to 100000 s");
  }
  return option_s;
}

double rate_of(const std::string& text) {
  if (text == "max") {
    return 0.0;
  }
  const auto rate = read<double>(text);
  if (!rate || !std::isfinite(*rate) || !(*rate > 0.0)) {
    throw ConfigError("--rate must be 'max' or a number above 0 (1 is real time); is '" + text +
                      "'");
  }
  return *rate;
}

}  // namespace trigpoint::cli
