// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fastdds_node.hpp"

#include "trigpoint/bus/participant_of.hpp"

#include "../network.hpp"
#include "../process_note.hpp"
#include "../reader_events.hpp"
#include "../rtps_limits.hpp"
#include "bulk_queue.hpp"
#include "endpoint.hpp"
#include "fastdds_reader.hpp"
#include "fastdds_writer.hpp"
#include "handshake_room.hpp"
#include "limited_transport.hpp"
#include "security.hpp"
#include "transport.hpp"
#include "wire_type.hpp"
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastrtps/xmlparser/XMLProfileManager.h>

#include <stdexcept>
#include <utility>

namespace trigpoint::bus {

namespace dds = eprosima::fastdds::dds;

namespace fastdds {

namespace {

/// Endpoints of one process talk over UDP like all others: one path to test, one behaviour.
void turn_off_intraprocess_delivery() {
  eprosima::fastrtps::LibrarySettingsAttributes settings;
  settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
}

std::function<void(const std::string& sender)> refusal_teller(const EventSink& sink) {
  const auto count = std::make_shared<std::atomic<std::uint64_t>>(0);
  return [sink, count](const std::string& sender) {
    const std::uint64_t so_far = ++*count;
    if (sink && is_told(so_far)) {
      sink(fragment_refused_event(sender, so_far));
    }
  };
}

}  // namespace

FastNode::FastNode(const Config& config, const std::string& name, EventSink sink)
    : config_(config), sink_(std::move(sink)) {
  const SocketBuffers buffers = permitted_socket_buffers(config.socket_buffer_bytes);
  is_paced_ = pacing_of(config, buffers).has_value();
  if (const auto warning = socket_buffer_warning(config.socket_buffer_bytes, buffers)) {
    tell(*warning);
  }
  auto* factory = dds::DomainParticipantFactory::get_instance();
  factory->load_profiles();  // else the defaults do not know FASTRTPS_DEFAULT_PROFILES_FILE
  turn_off_intraprocess_delivery();
  dds::DomainParticipantQos qos;
  factory->get_default_participant_qos(qos);
  qos.name(name);
  const std::string note = process_note();
  qos.user_data().data_vec({note.begin(), note.end()});
  bulk_queue_ = make_bulk_queue(config, buffers);
  set_transport(qos, config, buffers, bulk_queue_, {incoming_, refusal_teller(sink_)});
  set_security(qos, config);
  const HandshakeRoom room(config);
  const int domain = domain_of(config);
  participant_ = factory->create_participant(
      static_cast<dds::DomainId_t>(domain), qos, this, dds::StatusMask::none());
  if (participant_ == nullptr) {
    throw std::runtime_error(cannot_join(config));
  }
  publisher_ = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
  subscriber_ = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
}

FastNode::~FastNode() {
  participant_->set_listener(nullptr);
  participant_->delete_contained_entities();
  if (bulk_queue_ != nullptr) {
    bulk_queue_->stop();
  }
  dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

void FastNode::on_participant_discovery(dds::DomainParticipant*,
                                        eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) {
  using Info = eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;
  const std::string guid = participant_of(guid_text(info.info.m_guid));
  const std::lock_guard lock(discovery_mutex_);
  if (info.status == Info::REMOVED_PARTICIPANT || info.status == Info::DROPPED_PARTICIPANT) {
    processes_.erase(guid);
    incoming_->remove_participant(info.info.m_guid.guidPrefix.value);
    std::erase_if(endpoints_, [&guid](const auto& each) { return each.first.starts_with(guid); });
  } else if (const auto number = noted_process(info.info.m_userData)) {
    processes_[guid] = *number;
  }
}

std::optional<unsigned> FastNode::process_of(const std::string& writer_guid) {
  const std::lock_guard lock(discovery_mutex_);
  const auto noted = processes_.find(participant_of(writer_guid));
  return noted != processes_.end() ? number_that_counts_here(noted->second)
                                   : process_in_fastdds_guid(writer_guid);
}

template <class Data>
void FastNode::note_endpoint(bool writes, const Data& data, bool removed) {
  const std::string guid = guid_text(data.guid());
  const std::lock_guard lock(discovery_mutex_);
  if (removed) {
    endpoints_.erase(guid);
    if (writes) {
      incoming_->remove_writer(guid_of(data.guid()));
    }
    return;
  }
  DiscoveredEndpoint endpoint{guid, writes, data.topicName().c_str(), data.typeName().c_str()};
  endpoint.reliability = data.m_qos.m_reliability.kind == dds::RELIABLE_RELIABILITY_QOS
                             ? Reliability::kReliable
                             : Reliability::kBestEffort;
  endpoint.durability = data.m_qos.m_durability.kind == dds::VOLATILE_DURABILITY_QOS
                            ? Durability::kVolatile
                            : Durability::kTransientLocal;
  if (writes) {
    incoming_->add_writer(guid_of(data.guid()), endpoint.dds_topic, endpoint.reliability);
  }
  endpoints_.insert_or_assign(guid, endpoint);
}

void FastNode::on_publisher_discovery(dds::DomainParticipant*,
                                      eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) {
  note_endpoint(true,
                info.info,
                info.status == eprosima::fastrtps::rtps::WriterDiscoveryInfo::REMOVED_WRITER);
}

void FastNode::on_subscriber_discovery(dds::DomainParticipant*,
                                       eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) {
  note_endpoint(false,
                info.info,
                info.status == eprosima::fastrtps::rtps::ReaderDiscoveryInfo::REMOVED_READER);
}

std::vector<DiscoveredEndpoint> FastNode::discovered() {
  std::vector<DiscoveredEndpoint> all;
  {
    const std::lock_guard lock(discovery_mutex_);
    const std::string own = participant_of(guid_text(participant_->guid()));
    for (const auto& [guid, endpoint] : endpoints_) {
      if (!guid.starts_with(own)) {  // Fast DDS tells of our own too
        all.push_back(endpoint);
      }
    }
  }
  for (DiscoveredEndpoint& endpoint : all) {
    endpoint.process = process_of(endpoint.guid);
  }
  return all;
}

void FastNode::tell(const Event& event) const {
  if (sink_) {
    sink_(event);
  }
}

void FastNode::tell_too_large(std::size_t size_bytes, const Qos& qos) {
  const std::uint64_t count = ++not_sent_;
  if (is_told(count)) {
    tell(too_large_event(size_bytes, qos, count));
  }
}

dds::Topic* FastNode::topic(const std::string& dds_type, const std::string& dds_topic) {
  const std::lock_guard lock(topics_mutex_);
  if (auto* known = participant_->lookup_topicdescription(dds_topic)) {
    if (known->get_type_name() != dds_type) {
      throw std::runtime_error("topic " + dds_topic + " is already used here with type " +
                               known->get_type_name() + ", not " + dds_type);
    }
    return dynamic_cast<dds::Topic*>(known);
  }
  if (participant_->find_type(dds_type).empty()) {
    dds::TypeSupport(new WireType(dds_type)).register_type(participant_);
  }
  dds::Topic* topic = participant_->create_topic(dds_topic, dds_type, dds::TOPIC_QOS_DEFAULT);
  if (topic == nullptr) {
    throw std::runtime_error("Fast DDS refuses topic " + dds_topic + " of type " + dds_type);
  }
  return topic;
}

std::unique_ptr<backend::Writer> FastNode::make_writer(const backend::TypeOps& type,
                                                       const std::string& dds_topic,
                                                       const Qos& qos,
                                                       PublisherEvents events) {
  return std::make_unique<FastWriter>(
      *this, type, topic(type.dds_name, dds_topic), qos, std::move(events));
}

std::unique_ptr<backend::Reader> FastNode::make_reader(const backend::TypeOps& type,
                                                       const std::string& dds_topic,
                                                       const Qos& qos,
                                                       backend::Deliver deliver,
                                                       SubscriptionEvents events) {
  return std::make_unique<FastReader>(
      *this, type, topic(type.dds_name, dds_topic), qos, std::move(deliver), std::move(events));
}

}  // namespace fastdds

namespace backend {

std::unique_ptr<Node> make_node(const Config& config, const std::string& name, EventSink sink) {
  return std::make_unique<fastdds::FastNode>(config, name, std::move(sink));
}

const char* name() {
  return "fastdds";
}

}  // namespace backend
}  // namespace trigpoint::bus
