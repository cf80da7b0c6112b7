// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "endpoint.hpp"

#include <cstdint>

namespace trigpoint::bus::fastdds {

namespace {

void append_hexadecimal(std::string& text, std::uint8_t byte) {
  constexpr char kDigits[] = "0123456789abcdef";
  text.push_back(kDigits[byte >> 4]);
  text.push_back(kDigits[byte & 15]);
}

}  // namespace

std::string guid_text(const eprosima::fastrtps::rtps::GUID_t& guid) {
  std::string text;
  for (const std::uint8_t byte : guid.guidPrefix.value) {
    append_hexadecimal(text, byte);
  }
  for (const std::uint8_t byte : guid.entityId.value) {
    append_hexadecimal(text, byte);
  }
  return text;
}

std::string policy_name(eprosima::fastdds::dds::QosPolicyId_t policy) {
  namespace dds = eprosima::fastdds::dds;
  switch (policy) {
    case dds::DURABILITY_QOS_POLICY_ID:
      return "DURABILITY";
    case dds::DEADLINE_QOS_POLICY_ID:
      return "DEADLINE";
    case dds::OWNERSHIP_QOS_POLICY_ID:
      return "OWNERSHIP";
    case dds::LIVELINESS_QOS_POLICY_ID:
      return "LIVELINESS";
    case dds::RELIABILITY_QOS_POLICY_ID:
      return "RELIABILITY";
    case dds::PARTITION_QOS_POLICY_ID:
      return "PARTITION";
    case dds::DATAREPRESENTATION_QOS_POLICY_ID:
      return "DATA_REPRESENTATION";
    default:
      return "policy " + std::to_string(static_cast<unsigned>(policy));
  }
}

}  // namespace trigpoint::bus::fastdds
