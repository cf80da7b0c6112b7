// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "process_note.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <cstdio>
#include <string_view>

namespace trigpoint::bus {

namespace {

constexpr std::string_view kKey = "process=";
constexpr std::string_view kSpaceKey = ";in=";

/// Of our process numbers: the end of the kernel's number of their namespace. All computers have
/// the same one outside of containers.
unsigned own_space() {
  constexpr unsigned kEnd = 0xffff;

  struct stat space {};

  return stat("/proc/self/ns/pid", &space) == 0 ? static_cast<unsigned>(space.st_ino) & kEnd : 0;
}

std::optional<unsigned> number_at(std::string_view text, int base) {
  unsigned number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, base);
  return error == std::errc{} ? std::optional(number) : std::nullopt;
}

std::optional<unsigned> number_behind(std::string_view key, std::string_view text, int base) {
  const std::size_t at = text.find(key);
  return at == std::string_view::npos ? std::nullopt
                                      : number_at(text.substr(at + key.size()), base);
}

}  // namespace

std::string process_note() {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "enclave=/;process=%d;in=%x;", getpid(), own_space());
  return text.data();
}

std::optional<unsigned> noted_process(std::span<const std::uint8_t> user_data) {
  const std::string_view text(reinterpret_cast<const char*>(user_data.data()), user_data.size());
  const std::optional<unsigned> number = number_behind(kKey, text, 10);
  const bool is_elsewhere = number_behind(kSpaceKey, text, 16).value_or(own_space()) != own_space();
  return number && is_elsewhere ? kNumberedElsewhere : number;
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
