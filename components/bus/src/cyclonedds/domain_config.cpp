// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "domain_config.hpp"

#include "trigpoint/base/config.hpp"

#include "../network.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <vector>

namespace trigpoint::bus::cyclonedds {

namespace {

constexpr std::size_t kMostInterfaces = 4;  // Cyclone 0.10 cannot use more
constexpr int kHighestIndex = 119;   // of a participant: above, ports belong to the next domain
constexpr int kFirstIndexPort = 10;  // discovery of participant 0, above the domain's first
constexpr std::int64_t kHeaders_bytes = 128;  // of RTPS in front of a fragment, generously
// Around a fragment that is encrypted, and its payload once more. Cyclone does not count them, and
// a datagram larger than it should be is sent in two pieces.
constexpr std::int64_t kSecurityHeaders_bytes = 128;
// Samples of a writer of which fragments are missing. When there are more, fragments of the newest
// are thrown away, and a lossy link never catches up (with 2: 5 of 120 clouds at 1 % and 50 ms).
constexpr int kMostRepaired = 16;
constexpr int kMostIncomplete = 2;      // of best effort: the rest never comes
constexpr double kAskedAgain_s = 0.05;  // for what was asked for and has not come
constexpr std::int64_t kLargestFragment_bytes = 64'000;

std::string element(const std::string& name, const std::string& content) {
  return "<" + name + ">" + content + "</" + name + ">";
}

std::string element(const std::string& name, std::int64_t number, const std::string& unit = {}) {
  return element(name, std::to_string(number) + unit);
}

std::string milliseconds(double seconds) {
  return std::to_string(std::max(1L, std::lround(1e3 * seconds))) + "ms";
}

/// Cyclone by itself would take one; the loopback device only where there is nothing else.
std::vector<NetworkInterface> used_interfaces(const std::string& wanted) {
  if (!wanted.empty()) {
    return {find_interface(wanted)};
  }
  std::vector<NetworkInterface> usable;
  for (const bool loopback : {false, true}) {
    for (const NetworkInterface& each : network_interfaces()) {
      if (each.is_up && each.is_loopback == loopback && usable.size() < kMostInterfaces &&
          (!loopback || usable.empty())) {
        usable.push_back(each);
      }
    }
  }
  if (usable.empty()) {
    throw std::runtime_error("no network interface with an IPv4 address is up, not even lo");
  }
  return usable;
}

std::string interfaces(const Config& config) {
  std::string list;
  for (const NetworkInterface& each : used_interfaces(config.network_interface)) {
    // lo lacks the flag in most systems, and multicast works on it all the same.
    list += "<NetworkInterface address=\"" + each.address + "\" " +
            (each.is_loopback ? "multicast=\"true\"" : "") + "/>";
  }
  return element("Interfaces", list);
}

std::int64_t fragment_bytes(const Config& config) {
  const std::int64_t headers_bytes =
      kHeaders_bytes + (config.security_folder.empty() ? 0 : kSecurityHeaders_bytes);
  return std::min(config.datagram_bytes - headers_bytes, kLargestFragment_bytes);
}

std::string general(const Config& config) {
  return element("General",
                 interfaces(config) +
                     // As Fast DDS does: data goes to each reader by itself, only discovery to all.
                     element("AllowMulticast", "spdp") +
                     element("MaxMessageSize", config.datagram_bytes, "B") +
                     element("MaxRexmitMessageSize", config.datagram_bytes, "B") +
                     element("FragmentSize", fragment_bytes(config), "B"));
}

std::string peers(const Config& config) {
  std::string list;
  const auto add = [&list](const std::string& address, int port) {
    list += "<Peer address=\"" + address + ":" + std::to_string(port) + "\"/>";
  };
  for (const std::string& text : config.initial_peers) {
    const Peer peer = parse_peer(text);
    if (peer.port != 0) {
      add(peer.address, peer.port);
      continue;
    }
    for (int index = 0; index < kProcessesPerPeer; ++index) {
      add(peer.address, first_port(domain_of(config)) + kFirstIndexPort + 2 * index);
    }
  }
  return list.empty() ? "" : element("Peers", list);
}

std::string discovery(const Config& config) {
  if (!config.discovery_server.empty()) {
    throw ConfigError(
        "bus.discovery_server is '" + config.discovery_server +
        "', and Cyclone DDS knows no discovery server; name the computers in bus.initial_peers");
  }
  return element("Discovery",
                 // Each participant has a Cyclone domain of its own (see CycloneNode).
                 element("ExternalDomainId", domain_of(config)) +
                     // Well-known ports, so that peers find us, and discovery apart from data.
                     element("ParticipantIndex", "auto") +
                     element("MaxAutoParticipantIndex", kHighestIndex) + peers(config) +
                     element("LeaseDuration", milliseconds(config.lease_s)) +
                     element("SPDPInterval", milliseconds(config.lease_s / 4.0)));
}

std::string buffer(const std::string& name, std::int64_t bytes) {
  const std::string size = std::to_string(bytes) + "B";
  return "<" + name + " min=\"" + size + "\" max=\"" + size + "\"/>";
}

std::string internal(const Config& config, const SocketBuffers& buffers) {
  const std::string heartbeat = milliseconds(config.heartbeat_s);
  const auto pacing = pacing_of(config, buffers);
  const std::string repair_burst =
      pacing ? element("BurstSize", element("MaxRexmit", pacing->portion_bytes, "B")) : "";
  return element("Internal",
                 buffer("SocketReceiveBufferSize", buffers.receive_bytes) +
                     buffer("SocketSendBufferSize", buffers.send_bytes) +
                     "<HeartbeatInterval minsched=\"" + heartbeat + "\" max=\"" + heartbeat +
                     "\">" + heartbeat + "</HeartbeatInterval>" + element("NackDelay", "10ms") +
                     element("AutoReschedNackDelay", milliseconds(kAskedAgain_s)) +
                     element("WriterLingerDuration", kLinger.count(), "ms") +
                     element("MaxSampleSize", kLargestMessage_bytes, "B") +
                     element("DefragReliableMaxSamples", kMostRepaired) +
                     element("DefragUnreliableMaxSamples", kMostIncomplete) + repair_burst);
}

/// Cyclone DDS shares memory through iceoryx, and only messages of fixed size.
void refuse_shared_memory(const Config& config) {
  if (config.shared_memory) {
    throw ConfigError(
        "bus.shared_memory is true, and Cyclone DDS cannot do it: through its iceoryx daemon it "
        "shares messages of fixed size only, and points and odometry are not; leave it false, or "
        "take the programs that are built with Fast DDS");
  }
}

}  // namespace

std::string domain_config(const Config& config, const SocketBuffers& buffers) {
  refuse_shared_memory(config);
  const std::string ours = element("CycloneDDS",
                                   "<Domain Id=\"any\">" + general(config) + discovery(config) +
                                       internal(config, buffers) + "</Domain>");
  const char* uri = std::getenv("CYCLONEDDS_URI");
  return uri == nullptr || *uri == '\0' ? ours : ours + "," + uri;
}

}  // namespace trigpoint::bus::cyclonedds
