// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "network.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>

#include <cstdlib>
#include <memory>
#include <stdexcept>

namespace trigpoint::bus {

namespace {

std::string address_text(const sockaddr* address) {
  char text[INET_ADDRSTRLEN] = {};
  inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(address)->sin_addr, text, sizeof text);
  return text;
}

}  // namespace

std::string cannot_join(const Config& config) {
  const int domain = domain_of(config);
  if (!config.security_folder.empty()) {
    return "cannot join DDS domain " + std::to_string(domain) + " with the credentials in " +
           config.security_folder +
           " (are they valid now, of this computer, and is the domain at most 230?)";
  }
  return "cannot join DDS domain " + std::to_string(domain) + " (are its UDP ports, from " +
         std::to_string(first_port(domain)) + ", free, and is there a network interface?)";
}

std::vector<NetworkInterface> network_interfaces() {
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) {
    throw std::runtime_error("cannot list the network interfaces");
  }
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> owner(list, freeifaddrs);
  std::vector<NetworkInterface> interfaces;
  for (const ifaddrs* each = list; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr != nullptr && each->ifa_addr->sa_family == AF_INET) {
      interfaces.push_back({each->ifa_name,
                            address_text(each->ifa_addr),
                            (each->ifa_flags & IFF_UP) != 0,
                            (each->ifa_flags & IFF_LOOPBACK) != 0});
    }
  }
  return interfaces;
}

NetworkInterface find_interface(const std::string& wanted) {
  std::string known;
  for (const NetworkInterface& each : network_interfaces()) {
    if (wanted == each.name || wanted == each.address) {
      return each;
    }
    known += std::string(known.empty() ? "" : ", ") + each.name + " (" + each.address + ")";
  }
  throw std::runtime_error("bus.network_interface is '" + wanted +
                           "'; interfaces with an IPv4 address are: " + known);
}

Peer parse_peer(const std::string& text, const std::string& setting) {
  const std::size_t colon = text.find(':');
  const Peer peer{text.substr(0, colon),
                  colon == std::string::npos ? 0 : std::atoi(text.c_str() + colon + 1)};
  in_addr parsed{};
  const bool port_is_valid = colon == std::string::npos || (peer.port > 0 && peer.port < 65536);
  if (inet_pton(AF_INET, peer.address.c_str(), &parsed) != 1 || !port_is_valid) {
    throw std::runtime_error(setting + " has '" + text +
                             "'; expected an IPv4 address, with or without a port: 10.0.0.2:7410");
  }
  return peer;
}

}  // namespace trigpoint::bus
