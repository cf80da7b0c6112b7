// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/bus/config.hpp"

#include <dds/dds.h>

namespace trigpoint::bus::cyclonedds {

/// Nothing without a security folder. Throws std::runtime_error when one of its files is missing.
void set_security(dds_qos_t* qos, const Config& config);

}  // namespace trigpoint::bus::cyclonedds
