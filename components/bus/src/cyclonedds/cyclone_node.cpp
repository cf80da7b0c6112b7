// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "cyclone_node.hpp"

#include "trigpoint/bus/participant_of.hpp"

#include "../network.hpp"
#include "../process_note.hpp"
#include "../reader_events.hpp"
#include "cyclone_reader.hpp"
#include "cyclone_writer.hpp"
#include "domain_config.hpp"
#include "endpoint.hpp"
#include "security.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <stdexcept>
#include <utility>

namespace trigpoint::bus {

namespace cyclonedds {

namespace {

/// The number by which this process knows a Cyclone domain; on the network another one counts.
dds_domainid_t next_private_id() {
  static std::atomic<dds_domainid_t> last{1'000'000};
  return ++last;
}

/// With security that number is held against the governance file, where Cyclone takes none above
/// 230: that of the network, or where a participant of this process has it, another one.
dds_entity_t create_secured_domain(const Config& config,
                                   const std::string& xml,
                                   dds_domainid_t& id) {
  constexpr dds_domainid_t kHighestGoverned = 230;
  id = static_cast<dds_domainid_t>(domain_of(config));
  dds_entity_t domain = dds_create_domain(id, xml.c_str());
  for (dds_domainid_t other = kHighestGoverned;
       domain == DDS_RETCODE_PRECONDITION_NOT_MET && other > 0;
       --other) {
    id = other;
    domain = dds_create_domain(id, xml.c_str());
  }
  return domain;
}

dds_entity_t create_domain(const Config& config, const std::string& xml, dds_domainid_t& id) {
  if (!config.security_folder.empty()) {
    return create_secured_domain(config, xml, id);
  }
  id = next_private_id();
  return dds_create_domain(id, xml.c_str());
}

DiscoveredEndpoint endpoint_of(const dds_builtintopic_endpoint_t& told, bool writes) {
  DiscoveredEndpoint endpoint{guid_text(told.key), writes, told.topic_name, told.type_name};
  dds_reliability_kind_t reliability{};
  dds_durability_kind_t durability{};
  if (dds_qget_reliability(told.qos, &reliability, nullptr)) {
    endpoint.reliability =
        reliability == DDS_RELIABILITY_RELIABLE ? Reliability::kReliable : Reliability::kBestEffort;
  }
  if (dds_qget_durability(told.qos, &durability)) {
    endpoint.durability =
        durability == DDS_DURABILITY_VOLATILE ? Durability::kVolatile : Durability::kTransientLocal;
  }
  return endpoint;
}

/// Cyclone has a topic for all writers and one for all readers that it knows.
template <class Visitor>
void read_endpoints(dds_entity_t participant, bool writers, Visitor&& visit) {
  constexpr std::uint32_t kMost = 4096;
  const dds_entity_t reader = dds_create_reader(
      participant,
      writers ? DDS_BUILTIN_TOPIC_DCPSPUBLICATION : DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION,
      nullptr,
      nullptr);
  std::vector<void*> samples(kMost, nullptr);
  std::vector<dds_sample_info_t> infos(kMost);
  const dds_return_t count = dds_read(reader, samples.data(), infos.data(), kMost, kMost);
  for (std::size_t i = 0; i < static_cast<std::size_t>(std::max(count, 0)); ++i) {
    if (infos[i].valid_data && infos[i].instance_state == DDS_IST_ALIVE) {
      visit(*static_cast<const dds_builtintopic_endpoint_t*>(samples[i]));
    }
  }
  if (count > 0) {
    dds_return_loan(reader, samples.data(), count);
  }
  dds_delete(reader);
}

}  // namespace

CycloneNode::CycloneNode(const Config& config, const std::string& name, EventSink sink)
    : sink_(std::move(sink)) {
  const SocketBuffers buffers = permitted_socket_buffers(config.socket_buffer_bytes);
  if (const auto pacing = pacing_of(config, buffers)) {
    paced_sender_ = std::make_unique<PacedSender>(
        pacing->portion_bytes, pacing->period, [this](std::size_t size_bytes, dds_return_t why) {
          tell_not_sent(size_bytes, why);
        });
  }
  if (const auto warning = socket_buffer_warning(config.socket_buffer_bytes, buffers)) {
    tell(*warning);
  }
  const std::string what = cannot_join(config);
  dds_domainid_t id{};
  const QosPointer qos(dds_create_qos());
  set_security(qos.get(), config);  // may throw, so before there is a domain to delete
  domain_ = checked(create_domain(config, domain_config(config, buffers), id), what);
  dds_qset_entity_name(qos.get(), name.c_str());
  const std::string note = process_note();
  dds_qset_userdata(qos.get(), note.data(), note.size());
  participant_ = dds_create_participant(id, qos.get(), nullptr);
  if (participant_ < 0) {
    dds_delete(domain_);
    checked(participant_, what);
  }
}

CycloneNode::~CycloneNode() {
  dds_delete(domain_);
}

std::vector<DiscoveredEndpoint> CycloneNode::discovered() {
  dds_guid_t own{};
  dds_get_guid(participant_, &own);
  std::vector<DiscoveredEndpoint> all;
  for (const bool writes : {true, false}) {
    read_endpoints(participant_, writes, [&](const dds_builtintopic_endpoint_t& told) {
      if (guid_text(told.participant_key) != guid_text(own)) {
        all.push_back(endpoint_of(told, writes));
      }
    });
  }
  for (DiscoveredEndpoint& endpoint : all) {
    endpoint.process = process_of(endpoint.guid);
  }
  return all;
}

/// Cyclone keeps what participants say of themselves for whoever reads this topic.
std::optional<unsigned> CycloneNode::process_of(const std::string& writer_guid) {
  constexpr std::uint32_t kMost = 256;
  const dds_entity_t reader =
      dds_create_reader(participant_, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr);
  std::array<void*, kMost> samples{};
  std::array<dds_sample_info_t, kMost> infos{};
  const dds_return_t count = dds_read(reader, samples.data(), infos.data(), kMost, kMost);
  std::optional<unsigned> found;
  for (std::size_t i = 0; i < static_cast<std::size_t>(std::max(count, 0)) && !found; ++i) {
    const auto& told = *static_cast<const dds_builtintopic_participant_t*>(samples[i]);
    if (participant_of(guid_text(told.key)) == participant_of(writer_guid)) {
      void* data = nullptr;
      std::size_t size = 0;
      if (infos[i].valid_data && dds_qget_userdata(told.qos, &data, &size)) {
        found = noted_process({static_cast<const std::uint8_t*>(data), size});
        dds_free(data);
      }
    }
  }
  if (count > 0) {
    dds_return_loan(reader, samples.data(), count);
  }
  dds_delete(reader);
  return found ? number_that_counts_here(*found) : process_in_fastdds_guid(writer_guid);
}

void CycloneNode::tell(const Event& event) const {
  if (sink_) {
    sink_(event);
  }
}

void CycloneNode::tell_of_unknown_writer(const std::string& dds_topic) {
  const std::uint64_t count = ++of_unknown_writer_;
  if (is_told(count)) {
    tell({Severity::kWarning,
          0,
          "bus_unknown_writer",
          "a sample on " + dds_topic + " was dropped, since its writer went before it was known; " +
              std::to_string(count) + " so far"});
  }
}

void CycloneNode::tell_too_large(std::size_t size_bytes, const Qos& qos) {
  const std::uint64_t count = ++not_sent_;
  if (is_told(count)) {
    tell(too_large_event(size_bytes, qos, count));
  }
}

void CycloneNode::tell_not_sent(std::size_t size_bytes, dds_return_t why) {
  const std::uint64_t count = ++not_sent_;
  if (is_told(count)) {
    tell({Severity::kWarning,
          0,
          "bus_sample_not_sent",
          "a sample of " + std::to_string(size_bytes) + " bytes was not sent: Cyclone DDS says '" +
              dds_strretcode(why) + "'; " + std::to_string(count) + " so far"});
  }
}

Topic CycloneNode::topic(const std::string& dds_type, const std::string& dds_topic) {
  const std::lock_guard lock(topics_mutex_);
  if (const auto known = topics_.find(dds_topic); known != topics_.end()) {
    if (known->second.dds_type != dds_type) {
      throw std::runtime_error("topic " + dds_topic + " is already used here with type " +
                               known->second.dds_type + ", not " + dds_type);
    }
    return known->second.topic;
  }
  const Topic topic = create_topic(participant_, dds_topic, dds_type, pool_);
  checked(topic.entity, "cannot create topic " + dds_topic + " of type " + dds_type);
  topics_.emplace(dds_topic, KnownTopic{dds_type, topic});
  return topic;
}

std::unique_ptr<backend::Writer> CycloneNode::make_writer(const backend::TypeOps& type,
                                                          const std::string& dds_topic,
                                                          const Qos& qos,
                                                          PublisherEvents events) {
  return std::make_unique<CycloneWriter>(
      *this, type, topic(type.dds_name, dds_topic), qos, std::move(events));
}

std::unique_ptr<backend::Reader> CycloneNode::make_reader(const backend::TypeOps& type,
                                                          const std::string& dds_topic,
                                                          const Qos& qos,
                                                          backend::Deliver deliver,
                                                          SubscriptionEvents events) {
  return std::make_unique<CycloneReader>(*this,
                                         type,
                                         topic(type.dds_name, dds_topic),
                                         dds_topic,
                                         qos,
                                         std::move(deliver),
                                         std::move(events));
}

}  // namespace cyclonedds

namespace backend {

std::unique_ptr<Node> make_node(const Config& config, const std::string& name, EventSink sink) {
  return std::make_unique<cyclonedds::CycloneNode>(config, name, std::move(sink));
}

const char* name() {
  return "cyclonedds";
}

}  // namespace backend
}  // namespace trigpoint::bus
