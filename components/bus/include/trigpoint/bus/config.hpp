// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint {
class ConfigFields;
}

namespace trigpoint::bus {

/// How a process takes part in the bus; the same for every backend. `bus:` in the configuration.
struct Config {
  std::int64_t domain_id{-1};     ///< -1: environment variable ROS_DOMAIN_ID, or 0
  std::string network_interface;  ///< name or IPv4 address; empty: all
  std::vector<std::string>
      initial_peers;             ///< "10.0.0.2" or "10.0.0.2:7410", for nets without multicast
  std::string discovery_server;  ///< "10.0.0.1:11811", Fast DDS only; empty: none
  std::int64_t socket_buffer_bytes{4'194'304};
  std::int64_t datagram_bytes{65'500};  ///< 1472 between computers: one Ethernet frame each
  std::int64_t bulk_bytes_per_s{0};     ///< of clouds, to everybody together; 0: no limit
  double heartbeat_s{0.05};             ///< how often a reliable writer asks what was lost
  double lease_s{2.0};                  ///< silence after which a process counts as gone
  bool shared_memory{false};            ///< beside UDP, within one computer; Fast DDS only
  std::string security_folder;          ///< of bringup/make-credentials; empty: no security
};

void describe(Config& config, ConfigFields& fields);

/// The domain to join. Throws ConfigError when ROS_DOMAIN_ID is needed and is not 0 to 232.
int domain_of(const Config& config);

}  // namespace trigpoint::bus
