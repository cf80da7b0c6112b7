// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What writers and readers have in common.
#pragma once

#include "trigpoint/bus/backend.hpp"
#include "trigpoint/bus/qos.hpp"

#include "../incoming_samples.hpp"
#include "../type_hash.hpp"
#include <fastdds/dds/core/policy/QosPolicies.hpp>
#include <fastdds/rtps/common/Guid.h>
#include <fastdds/rtps/resources/ResourceManagement.h>

#include <algorithm>
#include <string>

namespace trigpoint::bus::fastdds {

/// Sets the policies that DataWriterQos and DataReaderQos both have.
template <class EndpointQos>
void set_policies(EndpointQos& endpoint, const Qos& qos, const backend::TypeOps& type) {
  namespace dds = eprosima::fastdds::dds;
  const std::string note = type_hash_note(type.dds_name);
  endpoint.user_data().data_vec({note.begin(), note.end()});
  endpoint.reliability().kind = qos.reliability == Reliability::kReliable
                                    ? dds::RELIABLE_RELIABILITY_QOS
                                    : dds::BEST_EFFORT_RELIABILITY_QOS;
  endpoint.durability().kind = qos.durability == Durability::kTransientLocal
                                   ? dds::TRANSIENT_LOCAL_DURABILITY_QOS
                                   : dds::VOLATILE_DURABILITY_QOS;
  endpoint.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  endpoint.history().depth = qos.depth;
  auto& limits = endpoint.resource_limits();
  limits.max_samples_per_instance = std::max(limits.max_samples_per_instance, qos.depth);
  limits.allocated_samples = std::min(limits.allocated_samples, qos.depth);
  // The default drops every sample that is larger than the type's usual size.
  endpoint.endpoint().history_memory_policy =
      eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  endpoint.data_sharing().off();
}

Guid guid_of(const eprosima::fastrtps::rtps::GUID_t& guid);

/// 32 hexadecimal digits.
std::string guid_text(const eprosima::fastrtps::rtps::GUID_t& guid);

/// "RELIABILITY" and the like.
std::string policy_name(eprosima::fastdds::dds::QosPolicyId_t policy);

}  // namespace trigpoint::bus::fastdds
