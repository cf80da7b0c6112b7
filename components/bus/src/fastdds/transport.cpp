// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "transport.hpp"

#include <arpa/inet.h>
#include <fastdds/rtps/flowcontrol/FlowControllerDescriptor.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <ifaddrs.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <stdexcept>

namespace trigpoint::bus::fastdds {

namespace {

using eprosima::fastdds::rtps::FlowControllerDescriptor;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;

constexpr char kMulticastAddress[] = "239.255.0.1";
constexpr std::uint32_t kProcessesPerPeer = 20;  // participant ids whose ports are tried there
constexpr std::uint32_t kPortBase = 7400;
constexpr std::uint32_t kPortsPerDomain = 250;
constexpr std::uint64_t kPacingPeriod_ms = 2;
constexpr std::int64_t kLeastPacedBytes = 65'536;

/// Fast DDS 2.9 takes maxMessageSize as the limit of what it receives too; this virtual function is
/// asked for sending only. So we can send small datagrams and still receive large ones.
struct Udp : UDPv4TransportDescriptor {
  std::uint32_t largest_sent_bytes{65'500};

  std::uint32_t max_message_size() const override { return largest_sent_bytes; }
};

std::string address_text(const sockaddr* address) {
  char text[INET_ADDRSTRLEN] = {};
  inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(address)->sin_addr, text, sizeof text);
  return text;
}

/// The IPv4 address of an interface given by name or by that address.
std::string interface_address(const std::string& wanted) {
  ifaddrs* interfaces = nullptr;
  if (getifaddrs(&interfaces) != 0) {
    throw std::runtime_error("cannot list the network interfaces");
  }
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> owner(interfaces, freeifaddrs);
  std::string known;
  for (const ifaddrs* each = interfaces; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr == nullptr || each->ifa_addr->sa_family != AF_INET) {
      continue;
    }
    const std::string address = address_text(each->ifa_addr);
    if (wanted == each->ifa_name || wanted == address) {
      return address;
    }
    known += std::string(known.empty() ? "" : ", ") + each->ifa_name + " (" + address + ")";
  }
  throw std::runtime_error("bus.network_interface is '" + wanted +
                           "'; interfaces with an IPv4 address are: " + known);
}

/// Port 0 means the discovery ports of all processes there.
Locator_t peer_locator(const std::string& peer) {
  const std::size_t colon = peer.find(':');
  const std::string address = peer.substr(0, colon);
  const int port = colon == std::string::npos ? 0 : std::atoi(peer.c_str() + colon + 1);
  in_addr parsed{};
  const bool port_is_valid = colon == std::string::npos || (port > 0 && port < 65536);
  if (inet_pton(AF_INET, address.c_str(), &parsed) != 1 || !port_is_valid) {
    throw std::runtime_error("bus.initial_peers has '" + peer +
                             "'; expected an IPv4 address, with or without a port: 10.0.0.2:7410");
  }
  Locator_t locator;
  IPLocator::createLocator(LOCATOR_KIND_UDPv4, address, static_cast<std::uint32_t>(port), locator);
  return locator;
}

/// Named peers would replace multicast; both are wanted.
void add_peers(eprosima::fastdds::dds::DomainParticipantQos& qos, const Config& config) {
  if (config.initial_peers.empty()) {
    return;
  }
  auto& peers = qos.wire_protocol().builtin.initialPeersList;
  for (const std::string& peer : config.initial_peers) {
    peers.push_back(peer_locator(peer));
  }
  const auto domain = static_cast<std::uint32_t>(domain_of(config));
  Locator_t multicast;
  IPLocator::createLocator(
      LOCATOR_KIND_UDPv4, kMulticastAddress, kPortBase + kPortsPerDomain * domain, multicast);
  peers.push_back(multicast);
}

/// A portion a period that fits the smaller buffer with room for everything else.
void add_pacing(eprosima::fastdds::dds::DomainParticipantQos& qos, const SocketBuffers& buffers) {
  const std::int64_t smaller = std::min(buffers.receive_bytes, buffers.send_bytes);
  if (smaller >= kUnpacedBufferBytes) {
    return;
  }
  auto pacing = std::make_shared<FlowControllerDescriptor>();
  pacing->name = kPacing;
  pacing->max_bytes_per_period =
      static_cast<std::int32_t>(std::max(smaller * 2 / 3, kLeastPacedBytes));
  pacing->period_ms = kPacingPeriod_ms;
  qos.flow_controllers().push_back(pacing);
}

}  // namespace

void set_transport(eprosima::fastdds::dds::DomainParticipantQos& qos,
                   const Config& config,
                   const SocketBuffers& buffers) {
  auto udp = std::make_shared<Udp>();
  udp->largest_sent_bytes = static_cast<std::uint32_t>(config.datagram_bytes);
  udp->sendBufferSize = static_cast<std::uint32_t>(buffers.send_bytes);
  udp->receiveBufferSize = static_cast<std::uint32_t>(buffers.receive_bytes);
  udp->maxInitialPeersRange = kProcessesPerPeer;
  if (!config.network_interface.empty()) {
    udp->interfaceWhiteList.push_back(interface_address(config.network_interface));
  }
  // Shared memory stays off: it costs seconds of reconnection after a kill and never matches
  // between root and other users (see the README).
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.leaseDuration = eprosima::fastrtps::Duration_t(config.lease_s);
  discovery.leaseDuration_announcementperiod = eprosima::fastrtps::Duration_t(config.lease_s / 4.0);
  add_peers(qos, config);
  add_pacing(qos, buffers);
}

}  // namespace trigpoint::bus::fastdds
