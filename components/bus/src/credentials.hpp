// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The files of DDS-Security that a participant needs, as bringup/make-credentials lays them out.
#pragma once

#include "trigpoint/bus/config.hpp"

#include <optional>
#include <string>

namespace trigpoint::bus {

/// "file://" addresses, as both vendors take them.
struct Credentials {
  std::string identity_ca;
  std::string identity_certificate;
  std::string private_key;
  std::string permissions_ca;
  std::string governance;
  std::string permissions;
};

/// Of the configured folder; nothing where there is none. Each vendor has a certificate of its own:
/// between vendors only the one with the lower subject hash may start the handshake (README).
/// Throws std::runtime_error naming the file that cannot be read.
std::optional<Credentials> credentials_of(const Config& config, const std::string& vendor);

}  // namespace trigpoint::bus
