// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/config.hpp"

#include "trigpoint/base/config.hpp"

#include <charconv>
#include <cstdlib>
#include <string_view>

namespace trigpoint::bus {

namespace {

constexpr int kHighestDomain = 232;  // ports are 7400 + 250 domain + ..., and end at 65535

int domain_from_environment() {
  const char* variable = std::getenv("ROS_DOMAIN_ID");
  const std::string_view text = variable == nullptr ? "" : variable;
  if (text.empty()) {
    return 0;
  }
  int domain = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), domain);
  if (error != std::errc{} || end != text.data() + text.size() || domain < 0 ||
      domain > kHighestDomain) {
    throw ConfigError("environment variable ROS_DOMAIN_ID is '" + std::string(text) +
                      "'; expected a whole number from 0 to " + std::to_string(kHighestDomain));
  }
  return domain;
}

}  // namespace

void describe(Config& config, ConfigFields& fields) {
  fields.integer("domain_id",
                 config.domain_id,
                 "DDS domain; -1 takes the environment variable ROS_DOMAIN_ID, or 0. On Linux keep "
                 "it at most 101, above that its ports are also given to other programs",
                 {-1, kHighestDomain});
  fields.text("network_interface",
              config.network_interface,
              "the only interface to use, by name (eth0) or IPv4 address; empty for all");
  fields.texts("initial_peers",
               config.initial_peers,
               "computers to look for where there is no multicast: \"10.0.0.2\" or "
               "\"10.0.0.2:7410\"; name this computer too");
  fields.text("discovery_server",
              config.discovery_server,
              "a Fast DDS discovery server through which all processes find each other, "
              "\"10.0.0.1:11811\"; Cyclone DDS knows none. Empty: multicast and initial_peers");
  fields.integer("socket_buffer_bytes",
                 config.socket_buffer_bytes,
                 "wanted size of each socket buffer; what the kernel does not permit "
                 "(net.core.rmem_max) is made up for by pacing, with a warning",
                 {65536, 1 << 30});
  fields.integer("datagram_bytes",
                 config.datagram_bytes,
                 "largest datagram sent: 65500 within one computer, 1472 between computers, where "
                 "one lost frame would lose all of a larger one",
                 {1200, 65500});
  fields.integer("bulk_bytes_per_s",
                 config.bulk_bytes_per_s,
                 "most that this process sends of its point clouds, for slow links; their readers "
                 "on the same computer wait too. 0: no limit",
                 {0, 10'000'000'000});
  fields.number("heartbeat_s",
                config.heartbeat_s,
                "how often a reliable writer asks its readers what they miss; of paced clouds "
                "(Fast DDS) five times as often",
                {0.005, 3.0});
  fields.number("lease_s",
                config.lease_s,
                "a process that is silent for so long counts as gone",
                {0.5, 100.0});
  fields.flag(
      "shared_memory",
      config.shared_memory,
      "also shared memory between processes of one computer and one user; Fast DDS only, and "
      "for all of them or none. After a kill -9 the others are silent for 2 to 4 s, and "
      "files stay in /dev/shm");
  fields.text("security_folder",
              config.security_folder,
              "DDS-Security with the credentials that bringup/make-credentials has put there; "
              "empty: none, and everybody may read and write");
}

int domain_of(const Config& config) {
  return config.domain_id < 0 ? domain_from_environment() : static_cast<int>(config.domain_id);
}

}  // namespace trigpoint::bus
