// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fastdds_writer.hpp"

#include "../rtps_limits.hpp"
#include "bulk_queue.hpp"
#include "endpoint.hpp"
#include "transport.hpp"
#include "wire_type.hpp"

#include <stdexcept>
#include <utility>

namespace trigpoint::bus::fastdds {

namespace dds = eprosima::fastdds::dds;

namespace {

/// Cyclone DDS asks for 256 fragments at a heartbeat, of clouds that have thousands.
constexpr double kRoundsOfRepair = 5.0;

EntityNumber entity_number(const dds::DataWriter& writer) {
  EntityNumber number = 0;
  for (const auto byte : writer.guid().entityId.value) {
    number = (number << 8) | byte;
  }
  return number;
}

dds::DataWriterQos writer_qos(const FastNode& node, const Qos& qos, const backend::TypeOps& type) {
  dds::DataWriterQos result;
  set_policies(result, qos, type);
  result.reliable_writer_qos().times.heartbeatPeriod =
      eprosima::fastrtps::Duration_t(node.config().heartbeat_s);
  // What is missing is sent at once: many short repairs follow each other on a long way.
  result.reliable_writer_qos().times.nackResponseDelay = eprosima::fastrtps::Duration_t(0, 0);
  result.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
  if (!qos.bulk || !node.is_paced()) {
    return result;
  }
  // Else each fragment has a heartbeat with it as soon as the history is full.
  result.reliable_writer_qos().disable_heartbeat_piggyback = true;
  if (node.bulk_queue() != nullptr) {
    result.reliable_writer_qos().times.heartbeatPeriod =
        eprosima::fastrtps::Duration_t(node.config().heartbeat_s / kRoundsOfRepair);
  } else {
    result.publish_mode().kind = dds::ASYNCHRONOUS_PUBLISH_MODE;
    result.publish_mode().flow_controller_name = kPacing;
  }
  return result;
}

/// When a reader goes, Fast DDS 2.9 removes from a volatile writer's history what only that one had
/// not acknowledged, and holds the writer's list of readers meanwhile. If some of it is being
/// repaired it waits for the flow controller, whose thread waits for that list: the process hangs
/// for ever (Fast DDS #3468, #5432). So what is acknowledged stays until `depth` newer samples are
/// there. What is announced and what late joiners get is settled when the writer is enabled; from
/// then on only that removal asks for the durability, and no function may change it: neither
/// set_qos() nor a publisher that does not enable its writers, since enable() takes all three from
/// the same value. The removal is of a sample, so no other thread reads the value before the first
/// write() of ours, which comes later and through the writer's mutex.
void keep_what_is_acknowledged(dds::DataWriter& writer) {
  const_cast<dds::DataWriterQos&>(writer.get_qos()).durability().kind =
      dds::TRANSIENT_LOCAL_DURABILITY_QOS;
}

}  // namespace

FastWriter::FastWriter(FastNode& node,
                       const backend::TypeOps& type,
                       dds::Topic* topic,
                       const Qos& qos,
                       PublisherEvents events)
    : node_(node), type_(type), qos_(qos), events_(std::move(events)) {
  writer_ = node.publisher().create_datawriter(
      topic, writer_qos(node, qos, type), this, dds::StatusMask::all());
  if (writer_ == nullptr) {
    throw std::runtime_error("Fast DDS cannot create a writer on " + topic->get_name());
  }
  // Unpaced clouds are for one computer, where nothing is repaired: their memory is better reused.
  if (!qos.bulk || node.is_paced()) {
    keep_what_is_acknowledged(*writer_);
  }
  if (qos.bulk && node.bulk_queue() != nullptr) {
    bulk_queue_ = node.bulk_queue();
    bulk_queue_->add_writer(entity_number(*writer_), static_cast<std::size_t>(qos.depth));
  }
}

FastWriter::~FastWriter() {
  {
    const std::lock_guard lock(callback_mutex_);
    closed_ = true;
  }
  writer_->set_listener(nullptr);
  // Else Fast DDS 2.9 takes its samples away one by one while its heartbeat goes through them,
  // which then counts missing ones for ever.
  std::size_t removed = 0;
  writer_->clear_history(&removed);
  if (bulk_queue_ != nullptr) {
    bulk_queue_->remove_writer(entity_number(*writer_));
  }
  node_.publisher().delete_datawriter(writer_);
}

bool FastWriter::write(const void* value) {
  const std::size_t size_bytes = type_.size_bound(value);
  if (size_bytes > static_cast<std::size_t>(largest_message_bytes(qos_))) {
    node_.tell_too_large(size_bytes, qos_);
    return false;
  }
  WireSample sample;
  sample.ops = &type_;
  sample.written = value;
  const BulkQueue::NewSample is_new;
  return writer_->write(&sample);
}

bool FastWriter::wait_for_acknowledgments(std::chrono::nanoseconds timeout) {
  const eprosima::fastrtps::Duration_t limit(std::chrono::duration<double>(timeout).count());
  return writer_->wait_for_acknowledgments(limit) ==
         eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
}

int FastWriter::matched() const {
  dds::PublicationMatchedStatus status;
  writer_->get_publication_matched_status(status);
  return status.current_count;
}

std::string FastWriter::guid() const {
  return guid_text(writer_->guid());
}

void FastWriter::on_publication_matched(dds::DataWriter*,
                                        const dds::PublicationMatchedStatus& status) {
  const std::lock_guard lock(callback_mutex_);
  if (!closed_ && events_.readers_changed) {
    events_.readers_changed(status.current_count);
  }
}

void FastWriter::on_offered_incompatible_qos(dds::DataWriter*,
                                             const dds::OfferedIncompatibleQosStatus& status) {
  const std::lock_guard lock(callback_mutex_);
  if (!closed_ && events_.incompatible_qos) {
    events_.incompatible_qos(policy_name(status.last_policy_id));
  }
}

}  // namespace trigpoint::bus::fastdds
