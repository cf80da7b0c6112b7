// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/bus/config.hpp"

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

namespace trigpoint::bus::fastdds {

/// Nothing without a security folder. Throws std::runtime_error when one of its files is missing.
void set_security(eprosima::fastdds::dds::DomainParticipantQos& qos, const Config& config);

}  // namespace trigpoint::bus::fastdds
