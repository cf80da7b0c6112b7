// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "process_note.hpp"

#include <unistd.h>

#include <charconv>
#include <string_view>

namespace trigpoint::bus {

namespace {

constexpr std::string_view kKey = "process=";

std::optional<unsigned> number_at(std::string_view text, int base) {
  unsigned number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, base);
  return error == std::errc{} ? std::optional(number) : std::nullopt;
}

}  // namespace

std::string process_note() {
  return "enclave=/;" + std::string(kKey) + std::to_string(getpid()) + ";";
}

std::optional<unsigned> noted_process(std::span<const std::uint8_t> user_data) {
  const std::string_view text(reinterpret_cast<const char*>(user_data.data()), user_data.size());
  const std::size_t key = text.find(kKey);
  return key == std::string_view::npos ? std::nullopt
                                       : number_at(text.substr(key + kKey.size()), 10);
}

std::optional<unsigned> process_in_fastdds_guid(const std::string& guid) {
  constexpr std::string_view kFastDds = "010f";
  constexpr std::size_t kLowByte = 8;  // the lower byte comes first
  if (!guid.starts_with(kFastDds) || guid.size() < kLowByte + 4) {
    return std::nullopt;
  }
  return number_at(guid.substr(kLowByte + 2, 2) + guid.substr(kLowByte, 2), 16);
}

}  // namespace trigpoint::bus
