// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "incomplete_datagrams.hpp"

#include <fstream>
#include <sstream>

namespace trigpoint::cli {

namespace {

/// Two lines for each protocol: "Ip: Forwarding DefaultTTL ...", then "Ip: 1 64 ...".
std::optional<std::int64_t> value_below(const std::string& wanted,
                                        std::istream& names,
                                        std::istream& values) {
  std::string name;
  std::string value;
  while (names >> name && values >> value) {
    if (name == wanted) {
      std::istringstream text(value);
      std::int64_t number = 0;
      return text >> number ? std::optional(number) : std::nullopt;
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::int64_t> failed_reassemblies(std::istream& snmp) {
  std::string names;
  std::string values;
  while (std::getline(snmp, names) && std::getline(snmp, values)) {
    if (names.starts_with("Ip:")) {
      std::istringstream of_names(names);
      std::istringstream of_values(values);
      return value_below("ReasmFails", of_names, of_values);
    }
  }
  return std::nullopt;
}

std::optional<std::int64_t> failed_reassemblies() {
  std::ifstream snmp("/proc/net/snmp");
  return failed_reassemblies(snmp);
}

std::string reassembly_advice(std::optional<std::int64_t> before,
                              std::optional<std::int64_t> after) {
  if (!before || !after || *after <= *before) {
    return "";
  }
  return std::to_string(*after - *before) +
         " datagrams came in pieces of which some were lost, and the kernel gave them up while "
         "this "
         "listened (ReasmFails " +
         std::to_string(*before) + " before, " + std::to_string(*after) +
         " after): they are larger than a network frame. For our programs set bus.datagram_bytes: "
         "1472 "
         "(bringup/profiles/lan.yaml) on the computer that sends; for others that cannot, on this "
         "one: sysctl -w net.ipv4.ipfrag_time=1 net.ipv4.ipfrag_high_thresh=67108864";
}

std::string past_reassembly_note(std::optional<std::int64_t> before,
                                 std::optional<std::int64_t> after) {
  if (!before || !after || *before == 0 || *after != *before) {
    return "";
  }
  return "the kernel gave up " + std::to_string(*before) +
         " datagrams of which pieces were lost, but none while this listened (ReasmFails " +
         std::to_string(*before) + " before and after)";
}

}  // namespace trigpoint::cli
