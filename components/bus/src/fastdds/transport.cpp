// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "transport.hpp"

#include "trigpoint/base/config.hpp"

#include "../network.hpp"
#include "bulk_queue.hpp"
#include "discovery_turns.hpp"
#include "limited_transport.hpp"
#include <fastdds/rtps/flowcontrol/FlowControllerDescriptor.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include <memory>
#include <mutex>

namespace trigpoint::bus::fastdds {

namespace {

using eprosima::fastdds::rtps::FlowControllerDescriptor;
using eprosima::fastdds::rtps::SharedMemTransportDescriptor;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;

/// Fast DDS 2.9 takes maxMessageSize as the limit of what it receives too; this virtual function is
/// asked for sending only. So we can send small datagrams and still receive large ones.
struct Udp : UDPv4TransportDescriptor {
  std::uint32_t largest_sent_bytes{65'500};

  std::uint32_t max_message_size() const override { return largest_sent_bytes; }
};

/// Strangers on the network cannot reach it: no limit in front of it as UDP has.
std::shared_ptr<SharedMemTransportDescriptor> shared_memory() {
  // Of each writing process: clouds that nobody has read yet. With Fast DDS's 512 kB a cloud of
  // 2 MB takes 22 ms.
  constexpr std::uint32_t kSegment_bytes = 16'000'000;
  auto descriptor = std::make_shared<SharedMemTransportDescriptor>();
  descriptor->segment_size(kSegment_bytes);
  return descriptor;
}

/// Of a server that was started as number 0: `fastdds discovery -i 0`.
constexpr char kDiscoveryServerPrefix[] = "44.53.00.5f.45.50.52.4f.53.49.4d.41";
constexpr int kDiscoveryServerPort = 11811;
constexpr char kLoopback[] = "127.0.0.1";

Locator_t peer_locator(const std::string& text) {
  const Peer peer = parse_peer(text);
  Locator_t locator;
  IPLocator::createLocator(
      LOCATOR_KIND_UDPv4, peer.address, static_cast<std::uint32_t>(peer.port), locator);
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
  Locator_t multicast;
  IPLocator::createLocator(LOCATOR_KIND_UDPv4,
                           kDiscoveryMulticast,
                           static_cast<std::uint32_t>(first_port(domain_of(config))),
                           multicast);
  peers.push_back(multicast);
}

/// Clients of Fast DDS before 2.10 do not do the handshake of DDS-Security with their server, nor
/// does it tell them of each other then: all wait for ever, and nothing says so.
void refuse_server_with_security(const Config& config) {
  if (!config.security_folder.empty()) {
    throw ConfigError(
        "bus.discovery_server and bus.security_folder are both set, and Fast DDS 2.9 cannot have "
        "them together: its discovery server knows no DDS-Security. Leave out the server and name "
        "a computer that has a fixed address in bus.initial_peers of all; it finds the others "
        "when they call");
  }
}

/// All discovery goes through the server then: neither multicast nor peers are asked.
void use_discovery_server(eprosima::fastdds::dds::DomainParticipantQos& qos, const Config& config) {
  namespace rtps = eprosima::fastrtps::rtps;
  refuse_server_with_security(config);
  const Peer address = parse_peer(config.discovery_server, "bus.discovery_server");
  rtps::RemoteServerAttributes server;
  server.ReadguidPrefix(kDiscoveryServerPrefix);
  Locator_t locator;
  IPLocator::createLocator(
      LOCATOR_KIND_UDPv4,
      address.address,
      static_cast<std::uint32_t>(address.port == 0 ? kDiscoveryServerPort : address.port),
      locator);
  server.metatrafficUnicastLocatorList.push_back(locator);
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.discoveryProtocol = rtps::DiscoveryProtocol_t::CLIENT;
  discovery.discoveryServer_client_syncperiod =
      eprosima::fastrtps::Duration_t(config.lease_s / 8.0);
  discovery.m_DiscoveryServers.push_back(server);
}

void take_turns_in_discovery(eprosima::fastdds::dds::DomainParticipantQos& qos) {
  const auto turn = std::make_shared<std::mutex>();
  for (auto& transport : qos.transport().user_transports) {
    transport = one_discovery_at_a_time(transport, turn);
  }
}

void add_pacing(eprosima::fastdds::dds::DomainParticipantQos& qos, const Pacing& wanted) {
  auto pacing = std::make_shared<FlowControllerDescriptor>();
  pacing->name = kPacing;
  pacing->max_bytes_per_period = static_cast<std::int32_t>(wanted.portion_bytes);
  pacing->period_ms = static_cast<std::uint64_t>(wanted.period.count());
  qos.flow_controllers().push_back(pacing);
}

}  // namespace

std::shared_ptr<BulkQueue> make_bulk_queue(const Config& config, const SocketBuffers& buffers) {
  const auto pacing = pacing_of(config, buffers);
  if (!pacing || !config.security_folder.empty() || config.shared_memory) {
    return nullptr;
  }
  constexpr std::chrono::milliseconds kCatchesUp{20};  // a cloud's fifth
  return std::make_shared<BulkQueue>(*pacing,
                                     is_small(buffers) ? std::chrono::milliseconds{0} : kCatchesUp);
}

void set_transport(eprosima::fastdds::dds::DomainParticipantQos& qos,
                   const Config& config,
                   const SocketBuffers& buffers,
                   const std::shared_ptr<BulkQueue>& bulk,
                   const Incoming& incoming) {
  auto udp = std::make_shared<Udp>();
  udp->largest_sent_bytes = static_cast<std::uint32_t>(config.datagram_bytes);
  udp->sendBufferSize = static_cast<std::uint32_t>(buffers.send_bytes);
  udp->receiveBufferSize = static_cast<std::uint32_t>(buffers.receive_bytes);
  udp->maxInitialPeersRange = kProcessesPerPeer;
  if (!config.network_interface.empty()) {
    udp->interfaceWhiteList.push_back(find_interface(config.network_interface).address);
    // Fast DDS participants without this restriction, such as a discovery server, answer those on
    // their own computer there.
    udp->interfaceWhiteList.push_back(kLoopback);
  }
  // Shared memory stays off unless asked for: it costs seconds of reconnection after a kill and
  // never matches between root and other users (see the README).
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(limited(udp, bulk, incoming));
  if (config.shared_memory) {
    qos.transport().user_transports.push_back(shared_memory());
  }
  if (!config.security_folder.empty()) {
    take_turns_in_discovery(qos);
  }
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.leaseDuration = eprosima::fastrtps::Duration_t(config.lease_s);
  discovery.leaseDuration_announcementperiod = eprosima::fastrtps::Duration_t(config.lease_s / 4.0);
  if (config.discovery_server.empty()) {
    add_peers(qos, config);
  } else {
    use_discovery_server(qos, config);
  }
  if (const auto pacing = pacing_of(config, buffers); pacing && bulk == nullptr) {
    add_pacing(qos, *pacing);
  }
}

}  // namespace trigpoint::bus::fastdds
