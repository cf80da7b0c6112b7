// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "endpoint.hpp"

#include "../message_info.hpp"

namespace trigpoint::bus::fastdds {

Guid guid_of(const eprosima::fastrtps::rtps::GUID_t& guid) {
  Guid bytes{};
  const auto rest = std::copy_n(guid.guidPrefix.value, sizeof guid.guidPrefix.value, bytes.begin());
  std::copy_n(guid.entityId.value, sizeof guid.entityId.value, rest);
  return bytes;
}

std::string guid_text(const eprosima::fastrtps::rtps::GUID_t& guid) {
  return hexadecimal(guid.guidPrefix.value) + hexadecimal(guid.entityId.value);
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
