// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "security.hpp"

#include "../credentials.hpp"

#include <string>

namespace trigpoint::bus::fastdds {

void set_security(eprosima::fastdds::dds::DomainParticipantQos& qos, const Config& config) {
  const auto credentials = credentials_of(config, "fastdds");
  if (!credentials) {
    return;
  }
  const auto set = [&qos](const std::string& name, const std::string& value) {
    qos.properties().properties().emplace_back("dds.sec." + name, value);
  };
  set("auth.plugin", "builtin.PKI-DH");
  set("auth.builtin.PKI-DH.identity_ca", credentials->identity_ca);
  set("auth.builtin.PKI-DH.identity_certificate", credentials->identity_certificate);
  set("auth.builtin.PKI-DH.private_key", credentials->private_key);
  set("access.plugin", "builtin.Access-Permissions");
  set("access.builtin.Access-Permissions.permissions_ca", credentials->permissions_ca);
  set("access.builtin.Access-Permissions.governance", credentials->governance);
  set("access.builtin.Access-Permissions.permissions", credentials->permissions);
  set("crypto.plugin", "builtin.AES-GCM-GMAC");
}

}  // namespace trigpoint::bus::fastdds
