// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "handshake_room.hpp"

#include "wire_type.hpp"
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include <stdexcept>

namespace trigpoint::bus::fastdds {

namespace {

namespace dds = eprosima::fastdds::dds;

constexpr char kHandshakeTopic[] = "DCPSParticipantStatelessMessage";
/// A message of it has more than 4.4 kB with certificates of bringup/make-credentials, most of it
/// permissions.
constexpr std::uint32_t kLongestHandshake_bytes = 32'768;
/// Security is for domains up to 230, so its ports are nobody's.
constexpr dds::DomainId_t kDomainOfNobody = 232;

/// On nobody's network: no discovery, and only the loopback device.
dds::DomainParticipantQos unseen() {
  dds::DomainParticipantQos qos;
  qos.name("handshake_room");
  qos.wire_protocol().builtin.discovery_config.discoveryProtocol =
      eprosima::fastrtps::rtps::DiscoveryProtocol_t::NONE;
  auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  loopback->interfaceWhiteList.emplace_back("127.0.0.1");
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(loopback);
  return qos;
}

dds::DataWriterQos of_the_pool() {
  dds::DataWriterQos qos;
  qos.endpoint().history_memory_policy =
      eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  qos.history().depth = 1;
  qos.resource_limits().max_samples = 1;
  qos.resource_limits().max_instances = 1;
  qos.resource_limits().max_samples_per_instance = 1;
  qos.resource_limits().allocated_samples = 1;
  return qos;
}

}  // namespace

HandshakeRoom::HandshakeRoom(const Config& config) {
  if (config.security_folder.empty()) {
    return;
  }
  participant_ =
      dds::DomainParticipantFactory::get_instance()->create_participant(kDomainOfNobody, unseen());
  auto* type = new WireType(kHandshakeTopic);
  type->m_typeSize = kLongestHandshake_bytes;
  const dds::TypeSupport owner(type);
  dds::DataWriter* writer = nullptr;
  if (participant_ != nullptr) {
    owner.register_type(participant_);
    writer = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT)
                 ->create_datawriter(participant_->create_topic(
                                         kHandshakeTopic, kHandshakeTopic, dds::TOPIC_QOS_DEFAULT),
                                     of_the_pool());
  }
  if (writer == nullptr) {
    throw std::runtime_error(
        "Fast DDS makes no room for the handshake of bus.security_folder (are "
        "UDP ports from 65400 on 127.0.0.1 free?)");
  }
}

HandshakeRoom::~HandshakeRoom() {
  if (participant_ != nullptr) {
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
}

}  // namespace trigpoint::bus::fastdds
