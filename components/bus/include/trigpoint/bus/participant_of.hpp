// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>

namespace trigpoint::bus {

/// The participant's part of a writer's GUID, which all writers of one program share: 12 bytes in
/// hexadecimal digits.
inline std::string participant_of(const std::string& writer_guid) {
  return writer_guid.substr(0, 24);
}

}  // namespace trigpoint::bus
