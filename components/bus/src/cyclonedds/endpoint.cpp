// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "endpoint.hpp"

#include "../message_info.hpp"
#include "../type_hash.hpp"

#include <stdexcept>

namespace trigpoint::bus::cyclonedds {

QosPointer make_qos(const Qos& qos, const backend::TypeOps& type) {
  QosPointer result(dds_create_qos());
  constexpr dds_duration_t kLongestBlocking = DDS_MSECS(100);
  dds_qset_reliability(result.get(),
                       qos.reliability == Reliability::kReliable ? DDS_RELIABILITY_RELIABLE
                                                                 : DDS_RELIABILITY_BEST_EFFORT,
                       kLongestBlocking);
  dds_qset_durability(result.get(),
                      qos.durability == Durability::kTransientLocal ? DDS_DURABILITY_TRANSIENT_LOCAL
                                                                    : DDS_DURABILITY_VOLATILE);
  dds_qset_history(result.get(), DDS_HISTORY_KEEP_LAST, qos.depth);
  const dds_data_representation_id_t representation = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(result.get(), 1, &representation);
  const std::string note = type_hash_note(type.dds_name);
  dds_qset_userdata(result.get(), note.data(), note.size());
  return result;
}

std::string guid_text(const dds_guid_t& guid) {
  return hexadecimal(guid.v);
}

std::string policy_name(std::uint32_t policy) {
  switch (policy) {
    case DDS_DURABILITY_QOS_POLICY_ID:
      return "DURABILITY";
    case DDS_DEADLINE_QOS_POLICY_ID:
      return "DEADLINE";
    case DDS_OWNERSHIP_QOS_POLICY_ID:
      return "OWNERSHIP";
    case DDS_LIVELINESS_QOS_POLICY_ID:
      return "LIVELINESS";
    case DDS_RELIABILITY_QOS_POLICY_ID:
      return "RELIABILITY";
    case DDS_PARTITION_QOS_POLICY_ID:
      return "PARTITION";
    case DDS_DATA_REPRESENTATION_QOS_POLICY_ID:
      return "DATA_REPRESENTATION";
    default:
      return "policy " + std::to_string(policy);
  }
}

dds_entity_t checked(dds_entity_t result, const std::string& what) {
  if (result < 0) {
    throw std::runtime_error(what + ": Cyclone DDS says '" + dds_strretcode(result) + "'");
  }
  return result;
}

int& OwnCall::depth() {
  thread_local int calls = 0;
  return calls;
}

}  // namespace trigpoint::bus::cyclonedds
