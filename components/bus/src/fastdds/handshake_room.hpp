// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/bus/config.hpp"

#include <memory>

namespace eprosima::fastdds::dds {
class DomainParticipant;
}

namespace trigpoint::bus::fastdds {

/// Lets a secured participant send datagrams that are smaller than its handshake. Fast DDS 2.9
/// gives a message of the handshake as many bytes of memory as a datagram may have, and where those
/// are too few it counts the wanted ones one short and then refuses them ("Cannot serialize
/// ParticipantGenericMessage"): nobody matches. That memory comes from a pool of the process, by
/// the name of its topic, which is as generous as whoever asks for it first. This asks first.
///
/// To be there while the participant is made, which then keeps the pool; does nothing without
/// security. Throws std::runtime_error when Fast DDS refuses.
class HandshakeRoom {
 public:
  explicit HandshakeRoom(const Config& config);
  ~HandshakeRoom();
  HandshakeRoom(const HandshakeRoom&) = delete;
  HandshakeRoom& operator=(const HandshakeRoom&) = delete;

 private:
  eprosima::fastdds::dds::DomainParticipant* participant_{nullptr};
};

}  // namespace trigpoint::bus::fastdds
