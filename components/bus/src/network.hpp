// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Interfaces and peers of the configuration, checked the same way for every vendor.
#pragma once

#include "trigpoint/bus/config.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::bus {

inline constexpr char kDiscoveryMulticast[] = "239.255.0.1";
/// How many processes are looked for at a peer that is given without port.
inline constexpr int kProcessesPerPeer = 20;

/// The first of the ports of RTPS for a domain: 7400 + 250 x domain.
constexpr int first_port(int domain) {
  return 7400 + 250 * domain;
}

/// What to say when a middleware does not let us in.
std::string cannot_join(const Config& config);

struct NetworkInterface {
  std::string name;
  std::string address;  ///< IPv4
  bool is_up{false};
  bool is_loopback{false};
};

/// Those with an IPv4 address. Throws std::runtime_error when the system does not tell.
std::vector<NetworkInterface> network_interfaces();

/// The interface given by name or IPv4 address; throws std::runtime_error with those that exist.
NetworkInterface find_interface(const std::string& wanted);

struct Peer {
  std::string address;  ///< IPv4
  int port{0};          ///< 0: the discovery ports of all processes there
};

/// From "10.0.0.2" or "10.0.0.2:7410"; throws std::runtime_error, which names the setting, on
/// everything else.
Peer parse_peer(const std::string& text, const std::string& setting = "bus.initial_peers");

}  // namespace trigpoint::bus
