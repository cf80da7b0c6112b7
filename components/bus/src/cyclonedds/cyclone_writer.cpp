// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "cyclone_writer.hpp"

#include "../rtps_limits.hpp"
#include "domain_config.hpp"
#include "endpoint.hpp"

#include <utility>

namespace trigpoint::bus::cyclonedds {

namespace {

QosPointer writer_qos(const Qos& qos, const backend::TypeOps& type) {
  QosPointer result = make_qos(qos, type);
  dds_qset_writer_data_lifecycle(result.get(),
                                 false);  // a topic without key has nothing to dispose
  if (qos.durability == Durability::kTransientLocal) {
    // What late joiners get is not `history` in Cyclone.
    dds_qset_durability_service(result.get(),
                                0,
                                DDS_HISTORY_KEEP_LAST,
                                qos.depth,
                                DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED);
  }
  return result;
}

}  // namespace

CycloneWriter::CycloneWriter(CycloneNode& node,
                             const backend::TypeOps& type,
                             const Topic& topic,
                             const Qos& qos,
                             PublisherEvents events)
    : node_(node),
      type_(type),
      topic_(topic),
      qos_(qos),
      events_(std::move(events)),
      paced_(qos.bulk ? node.paced_sender() : nullptr) {
  const ListenerPointer listener(dds_create_listener(this));
  dds_lset_publication_matched(
      listener.get(), [](dds_entity_t, dds_publication_matched_status_t status, void* self) {
        static_cast<CycloneWriter*>(self)->tell_matched(static_cast<int>(status.current_count));
      });
  dds_lset_offered_incompatible_qos(
      listener.get(), [](dds_entity_t, dds_offered_incompatible_qos_status_t status, void* self) {
        static_cast<CycloneWriter*>(self)->tell_incompatible(status.last_policy_id);
      });
  const QosPointer policies = writer_qos(qos, type);
  *topic_.is_written_here = true;
  writer_ =
      checked(dds_create_writer(node.participant(), topic.entity, policies.get(), listener.get()),
              "cannot create a writer of " + type.dds_name);
  dds_guid_t guid{};
  dds_get_guid(writer_, &guid);
  guid_ = guid_text(guid);
}

CycloneWriter::~CycloneWriter() {
  if (paced_ != nullptr) {
    paced_->wait_until_sent(writer_, std::chrono::steady_clock::now() + kLinger);
    paced_->cancel(writer_);
  }
  {
    const OwnCall call;
    dds_delete(writer_);  // when it returns no listener runs
  }
  node_.worker().cancel(this);
}

bool CycloneWriter::write(const void* value) {
  const std::size_t size_bytes = type_.size_bound(value);
  if (size_bytes > static_cast<std::size_t>(largest_message_bytes(qos_))) {
    node_.tell_too_large(size_bytes, qos_);
    return false;
  }
  const WireSample sample{&type_, value};
  const dds_return_t result = send(sample);
  if (result != DDS_RETCODE_OK && result != DDS_RETCODE_TIMEOUT) {
    node_.tell_not_sent(size_bytes, result);
  }
  return result == DDS_RETCODE_OK;
}

dds_return_t CycloneWriter::send(const WireSample& sample) {
  if (paced_ != nullptr) {
    return paced_->send(writer_, topic_, sample, qos_.depth);
  }
  const OwnCall call;
  return dds_write(writer_, &sample);
}

bool CycloneWriter::wait_for_acknowledgments(std::chrono::nanoseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  if (paced_ != nullptr && !paced_->wait_until_sent(writer_, deadline)) {
    return false;
  }
  const auto rest = std::chrono::nanoseconds(deadline - std::chrono::steady_clock::now()).count();
  return dds_wait_for_acks(writer_, std::max<dds_duration_t>(rest, 0)) == DDS_RETCODE_OK;
}

int CycloneWriter::matched() const {
  return matched_;
}

std::string CycloneWriter::guid() const {
  return guid_;
}

// Cyclone may call from inside a call of ours, so users are told on the worker.

void CycloneWriter::tell_matched(int readers) {
  matched_ = readers;
  if (events_.readers_changed) {
    node_.worker().post(this, [this, readers] { events_.readers_changed(readers); });
  }
}

void CycloneWriter::tell_incompatible(std::uint32_t policy) {
  if (events_.incompatible_qos) {
    node_.worker().post(this, [this, policy] { events_.incompatible_qos(policy_name(policy)); });
  }
}

}  // namespace trigpoint::bus::cyclonedds
