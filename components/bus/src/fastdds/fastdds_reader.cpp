// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fastdds_reader.hpp"

#include "../message_info.hpp"
#include "../reader_events.hpp"
#include "../rtps_limits.hpp"
#include "endpoint.hpp"
#include "wire_type.hpp"

#include <stdexcept>
#include <utility>

namespace trigpoint::bus::fastdds {

namespace dds = eprosima::fastdds::dds;

namespace {

constexpr int kMostAtOnce = 10'000;  // samples that are taken in one callback

}  // namespace

FastReader::FastReader(FastNode& node,
                       const backend::TypeOps& type,
                       dds::Topic* topic,
                       const Qos& qos,
                       backend::Deliver deliver,
                       SubscriptionEvents events)
    : node_(node),
      type_(type),
      topic_(topic),
      deliver_(std::move(deliver)),
      events_(std::move(events)),
      message_(type.make()),
      qos_(qos) {
  node_.incoming().add_reader(topic_->get_name(), qos_);
  try {
    const std::lock_guard lock(reader_mutex_);
    reader_ = create(qos_);
  } catch (...) {
    node_.incoming().remove_reader(topic_->get_name(), qos_);
    throw;
  }
}

FastReader::~FastReader() {
  {
    const std::lock_guard lock(callback_mutex_);
    closed_ = true;
  }
  node_.worker().cancel(this);
  if (reader_ != nullptr) {
    remove(reader_);
  }
  node_.incoming().remove_reader(topic_->get_name(), qos_);
}

dds::DataReader* FastReader::create(const Qos& qos) {
  dds::DataReaderQos reader_qos;
  set_policies(reader_qos, qos, type_);
  dds::DataReader* reader =
      node_.subscriber().create_datareader(topic_, reader_qos, this, dds::StatusMask::all());
  if (reader == nullptr) {
    throw std::runtime_error("Fast DDS cannot create a reader on " + topic_->get_name());
  }
  return reader;
}

void FastReader::remove(dds::DataReader* reader) {
  reader->set_listener(nullptr);
  node_.subscriber().delete_datareader(reader);
}

void FastReader::on_data_available(dds::DataReader* reader) {
  const std::lock_guard lock(callback_mutex_);
  WireSample sample;
  sample.ops = &type_;
  sample.received = message_.get();
  sample.largest_bytes = largest_message_bytes(qos_);
  dds::SampleInfo info;
  // More than any history holds is one sample again and again, which Fast DDS cannot remove: to go
  // on would keep its thread, and whoever deletes the reader, for ever.
  for (int taken = 0; taken < kMostAtOnce && !closed_; ++taken) {
    if (reader->take_next_sample(&sample, &info) !=
        eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      return;
    }
    if (info.valid_data) {
      deliver(info, sample.decoded);
    }
  }
}

void FastReader::deliver(const dds::SampleInfo& info, bool decoded) {
  MessageInfo told;
  told.writer_guid = guid_text(info.sample_identity.writer_guid());
  if (!decoded) {
    if (const auto event = malformed_event(topic_->get_name(), told.writer_guid, ++malformed_)) {
      node_.tell(*event);
    }
    return;
  }
  told.source_stamp_ns = info.source_timestamp.to_ns();
  told.reception_stamp_ns = wall_clock_ns();
  deliver_(message_.get(), told);
}

void FastReader::on_subscription_matched(dds::DataReader*,
                                         const dds::SubscriptionMatchedStatus& status) {
  const std::lock_guard lock(callback_mutex_);
  const std::string guid =
      guid_text(eprosima::fastrtps::rtps::iHandle2GUID(status.last_publication_handle));
  // A reader that was made anew meets the writers again; only news is told.
  const bool matched = status.current_count_change > 0;
  const bool is_news = matched ? writers_.insert(guid).second : writers_.erase(guid) > 0;
  matched_ = static_cast<int>(writers_.size());
  const auto& tell = matched ? events_.writer_matched : events_.writer_lost;
  if (!closed_ && is_news && tell) {
    tell(guid);
  }
}

void FastReader::on_requested_incompatible_qos(dds::DataReader*,
                                               const dds::RequestedIncompatibleQosStatus& status) {
  const std::lock_guard lock(callback_mutex_);
  if (closed_) {
    return;
  }
  if (events_.incompatible_qos) {
    events_.incompatible_qos(policy_name(status.last_policy_id));
  }
  if (status.last_policy_id == dds::RELIABILITY_QOS_POLICY_ID && !being_made_anew_) {
    being_made_anew_ = true;
    node_.worker().post(this, [this] { make_anew_as_best_effort(); });
  }
}

void FastReader::make_anew_as_best_effort() {
  const std::lock_guard lock(reader_mutex_);
  try {
    remove(std::exchange(reader_, nullptr));
    node_.incoming().remove_reader(topic_->get_name(), qos_);
    qos_.reliability = Reliability::kBestEffort;
    node_.incoming().add_reader(topic_->get_name(), qos_);
    reader_ = create(qos_);
  } catch (const std::exception& error) {
    node_.tell(reader_lost_event(topic_->get_name(), error));
    return;
  }
  node_.tell(best_effort_event(topic_->get_name()));
}

}  // namespace trigpoint::bus::fastdds
