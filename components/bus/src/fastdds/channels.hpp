// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Which socket a datagram leaves from. Where interfaces are named Fast DDS 2.9 has a socket bound
// to each and sends everything from all of them: those on the same computer then hear it twice, and
// to others one of two system calls fails.
#pragma once

#include <fastdds/rtps/network/SenderResource.h>

#include <mutex>
#include <utility>
#include <vector>

namespace trigpoint::bus::fastdds {

/// What a socket is for, by the address that it is bound to.
enum class Reach {
  kAll,        ///< any address
  kLoopback,   ///< 127.0.0.1: this computer, still there when the cable is not
  kInterface,  ///< the address of an interface: everybody else
  kMulticast,  ///< of an interface, beside a socket on any address
};

/// Multicast leaves from every socket.
bool serves(Reach reach, const eprosima::fastrtps::rtps::Locator_t& destination);

/// The sockets of one transport, which Fast DDS closes with the transport and not before: no other
/// ever has the address of one that was seen. May be asked by several threads.
class Channels {
 public:
  /// Of a socket on 127.0.0.1 kAll as long as there is none of another interface.
  Reach reach_of(const eprosima::fastrtps::rtps::SenderResource& channel);

 private:
  std::mutex mutex_;
  bool are_others_served_{false};
  bool are_all_served_{false};
  std::vector<std::pair<const eprosima::fastrtps::rtps::SenderResource*, Reach>> known_;
};

}  // namespace trigpoint::bus::fastdds
