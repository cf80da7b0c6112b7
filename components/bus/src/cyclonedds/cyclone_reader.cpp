// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "cyclone_reader.hpp"

#include "../message_info.hpp"
#include "../reader_events.hpp"
#include "../rtps_limits.hpp"
#include "endpoint.hpp"

#include <array>
#include <exception>
#include <utility>
#include <vector>

namespace trigpoint::bus::cyclonedds {

namespace {

constexpr std::size_t kMostGuids = 1024;  // then those of writers that have gone are forgotten

}  // namespace

CycloneReader::CycloneReader(CycloneNode& node,
                             const backend::TypeOps& type,
                             const Topic& topic,
                             std::string dds_topic,
                             const Qos& qos,
                             backend::Deliver deliver,
                             SubscriptionEvents events)
    : node_(node),
      type_(type),
      topic_(topic),
      dds_topic_(std::move(dds_topic)),
      deliver_(std::move(deliver)),
      events_(std::move(events)),
      message_(type.make()),
      qos_(qos) {
  {
    const std::lock_guard lock(making_mutex_);
    reader_ = create();
  }
  // What came before the handle was known.
  on_matched();
  take_on_worker();
}

CycloneReader::~CycloneReader() {
  {
    const std::lock_guard lock(callback_mutex_);
    closed_ = true;
  }
  node_.worker().cancel(this);  // it may be making the reader anew
  dds_delete(reader_);          // when it returns no listener runs
  node_.worker().cancel(this);
}

dds_entity_t CycloneReader::create() {
  const ListenerPointer listener(dds_create_listener(this));
  dds_lset_data_available(listener.get(), [](dds_entity_t, void* self) {
    static_cast<CycloneReader*>(self)->on_data_available();
  });
  dds_lset_subscription_matched(listener.get(),
                                [](dds_entity_t, dds_subscription_matched_status_t, void* self) {
                                  static_cast<CycloneReader*>(self)->on_matched();
                                });
  dds_lset_requested_incompatible_qos(
      listener.get(), [](dds_entity_t, dds_requested_incompatible_qos_status_t status, void* self) {
        static_cast<CycloneReader*>(self)->on_incompatible_qos(status.last_policy_id);
      });
  const QosPointer policies = make_qos(qos_, type_);
  const OwnCall call;
  return checked(
      dds_create_reader(node_.participant(), topic_.entity, policies.get(), listener.get()),
      "cannot create a reader on " + dds_topic_);
}

void CycloneReader::on_data_available() {
  if (OwnCall::is_on_this_thread() || *topic_.is_written_here) {
    take_on_worker();
  } else {
    take_all();
  }
}

/// Cyclone calls a reader's listeners one at a time, and dds_write of the same participant waits
/// for its turn; a callback in a listener that waits for whoever writes would wait for ever.
void CycloneReader::take_on_worker() {
  if (!take_is_posted_.exchange(true)) {
    node_.worker().post(this, [this] {
      take_is_posted_ = false;
      take_all();
    });
  }
}

void CycloneReader::take_all() {
  constexpr std::uint32_t kAtOnce = 16;
  const std::lock_guard lock(callback_mutex_);
  std::array<ddsi_serdata*, kAtOnce> taken{};
  std::array<dds_sample_info_t, kAtOnce> infos{};
  while (!closed_) {
    const dds_return_t count =
        dds_takecdr(reader_, taken.data(), kAtOnce, infos.data(), DDS_ANY_STATE);
    if (count <= 0) {
      return;
    }
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      const WireData data(taken[i]);
      if (infos[i].valid_data) {
        deliver(data, infos[i]);
      }
    }
  }
}

void CycloneReader::deliver(const WireData& data, const dds_sample_info_t& info) {
  MessageInfo told;
  told.writer_guid = guid_of_writer(info.publication_handle);
  if (told.writer_guid.empty()) {  // nobody could say whose it is
    node_.tell_of_unknown_writer(dds_topic_);
    return;
  }
  const auto cdr = data.cdr();
  const bool is_too_large = cdr.size() > static_cast<std::size_t>(largest_message_bytes(qos_));
  if (is_too_large || !type_.deserialize(cdr, message_.get())) {
    if (const auto event = malformed_event(dds_topic_, told.writer_guid, ++malformed_)) {
      node_.tell(*event);
    }
    return;
  }
  told.source_stamp_ns = info.source_timestamp;
  told.reception_stamp_ns = wall_clock_ns();
  deliver_(message_.get(), told);
}

std::string CycloneReader::guid_of_writer(dds_instance_handle_t writer) {
  if (const auto known = guids_.find(writer); known != guids_.end()) {
    return known->second;
  }
  std::string guid;
  if (dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(reader_, writer)) {
    guid = guid_text(endpoint->key);
    dds_builtintopic_free_endpoint(endpoint);
    if (guids_.size() >= kMostGuids) {
      guids_ = writers_;
    }
    guids_.emplace(writer, guid);
  }
  return guid;  // empty: it has gone, and Cyclone with it
}

void CycloneReader::on_matched() {
  node_.worker().post(this, [this] { update_writers(); });
}

/// Compares those matched now with those told: a reader that was made anew meets the same writers
/// again, and only news is told.
void CycloneReader::update_writers() {
  std::vector<dds_instance_handle_t> handles(64);
  dds_return_t count = dds_get_matched_publications(reader_, handles.data(), handles.size());
  if (count > static_cast<dds_return_t>(handles.size())) {
    handles.resize(static_cast<std::size_t>(count) + 64);
    count = dds_get_matched_publications(reader_, handles.data(), handles.size());
  }
  const std::size_t listed = std::min(handles.size(), static_cast<std::size_t>(std::max(count, 0)));
  handles.resize(listed);

  const std::lock_guard lock(callback_mutex_);
  std::map<dds_instance_handle_t, std::string> now;
  for (const dds_instance_handle_t handle : handles) {
    if (std::string guid = guid_of_writer(handle); !guid.empty()) {
      now.emplace(handle, std::move(guid));
    }
  }
  const auto before = std::exchange(writers_, now);
  matched_ = static_cast<int>(now.size());
  for (const auto& [handle, guid] : before) {
    if (!closed_ && !now.contains(handle) && events_.writer_lost) {
      events_.writer_lost(guid);
    }
  }
  for (const auto& [handle, guid] : now) {
    if (!closed_ && !before.contains(handle) && events_.writer_matched) {
      events_.writer_matched(guid);
    }
  }
}

void CycloneReader::on_incompatible_qos(std::uint32_t policy) {
  node_.worker().post(this, [this, policy] { be_incompatible(policy); });
}

void CycloneReader::be_incompatible(std::uint32_t policy) {
  {
    const std::lock_guard lock(callback_mutex_);
    if (closed_) {
      return;
    }
    if (events_.incompatible_qos) {
      events_.incompatible_qos(policy_name(policy));
    }
  }
  if (policy == DDS_RELIABILITY_QOS_POLICY_ID && qos_.reliability == Reliability::kReliable) {
    make_anew_as_best_effort();
  }
}

void CycloneReader::make_anew_as_best_effort() {
  try {
    // Cyclone tells of writers that it knows already from inside the constructor's create().
    const std::lock_guard lock(making_mutex_);
    dds_delete(reader_.exchange(0));
    qos_.reliability = Reliability::kBestEffort;
    reader_ = create();
  } catch (const std::exception& error) {
    node_.tell(reader_lost_event(dds_topic_, error));
    return;
  }
  update_writers();
  take_all();
  node_.tell(best_effort_event(dds_topic_));
}

}  // namespace trigpoint::bus::cyclonedds
