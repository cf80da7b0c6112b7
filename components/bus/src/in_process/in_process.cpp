// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "in_process.hpp"

#include "../message_info.hpp"
#include "../reader_events.hpp"
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace trigpoint::bus::in_process {

namespace {

std::string next_guid() {
  constexpr std::size_t kDigits = 32;
  static std::atomic<std::uint64_t> last{0};
  const std::string number = std::to_string(++last);
  return std::string(kDigits - number.size(), '0') + number;
}

}  // namespace

void Outstanding::add() {
  const std::lock_guard lock(mutex_);
  ++count_;
}

void Outstanding::remove() {
  const std::lock_guard lock(mutex_);
  if (--count_ == 0) {
    none_.notify_all();
  }
}

bool Outstanding::wait_for_none(std::chrono::nanoseconds timeout) {
  std::unique_lock lock(mutex_);
  return none_.wait_for(lock, timeout, [this] { return count_ == 0; });
}

Parcel::Parcel(std::shared_ptr<const Bytes> cdr,
               MessageInfo sample_info,
               std::shared_ptr<Outstanding> count)
    : bytes(std::move(cdr)), info(std::move(sample_info)), count_(std::move(count)) {
  count_->add();
}

Parcel::~Parcel() {
  count_->remove();
}

LocalWriter::LocalWriter(int domain,
                         const backend::TypeOps& type,
                         Endpoint endpoint,
                         PublisherEvents events)
    : domain_(domain),
      type_(type),
      endpoint_(std::move(endpoint)),
      events_(std::move(events)),
      guid_(next_guid()),
      outstanding_(std::make_shared<Outstanding>()) {
  Hub::instance().add(*this);
}

LocalWriter::~LocalWriter() {
  Hub::instance().remove(*this);
}

bool LocalWriter::write(const void* value) {
  auto bytes = std::make_shared<Bytes>(type_.size_bound(value));
  bytes->resize(type_.serialize(value, *bytes));
  if (bytes->empty()) {
    return false;
  }
  Hub::instance().publish(*this, std::move(bytes));
  return true;
}

bool LocalWriter::wait_for_acknowledgments(std::chrono::nanoseconds timeout) {
  return outstanding_->wait_for_none(timeout);
}

void LocalWriter::readers_changed(int change) {
  readers_ += change;
  if (events_.readers_changed) {
    notices_.post(this, [this, readers = readers_.load()] { events_.readers_changed(readers); });
  }
}

void LocalWriter::refused(const std::string& policy) {
  if (events_.incompatible_qos) {
    notices_.post(this, [this, policy] { events_.incompatible_qos(policy); });
  }
}

LocalReader::LocalReader(int domain,
                         const backend::TypeOps& type,
                         Endpoint endpoint,
                         backend::Deliver deliver,
                         SubscriptionEvents events,
                         EventSink sink)
    : domain_(domain),
      type_(type),
      endpoint_(std::move(endpoint)),
      deliver_(std::move(deliver)),
      events_(std::move(events)),
      sink_(std::move(sink)),
      message_(type.make()),
      guid_(next_guid()) {
  thread_ = std::thread([this] { work(); });
  Hub::instance().add(*this);
}

LocalReader::~LocalReader() {
  Hub::instance().remove(*this);
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  work_.notify_one();
  thread_.join();
}

/// KEEP_LAST: the oldest waiting sample gives way.
void LocalReader::push_sample(std::unique_ptr<Parcel> parcel) {
  const std::lock_guard lock(mutex_);
  if (samples_ >= static_cast<std::size_t>(endpoint_.qos.depth)) {
    const auto oldest = std::find_if(
        items_.begin(), items_.end(), [](const Item& item) { return item.parcel != nullptr; });
    items_.erase(oldest);
    --samples_;
  }
  items_.push_back({std::move(parcel), {}});
  ++samples_;
  work_.notify_one();
}

void LocalReader::push_notice(std::function<void()> notice) {
  const std::lock_guard lock(mutex_);
  items_.push_back({nullptr, std::move(notice)});
  work_.notify_one();
}

void LocalReader::matched_with(const std::string& writer_guid) {
  writers_.insert(writer_guid);
  matched_ = static_cast<int>(writers_.size());
  if (events_.writer_matched) {
    push_notice([this, writer_guid] { events_.writer_matched(writer_guid); });
  }
}

void LocalReader::lost(const std::string& writer_guid) {
  writers_.erase(writer_guid);
  matched_ = static_cast<int>(writers_.size());
  if (events_.writer_lost) {
    push_notice([this, writer_guid] { events_.writer_lost(writer_guid); });
  }
}

void LocalReader::refused(const std::string& policy) {
  if (events_.incompatible_qos) {
    push_notice([this, policy] { events_.incompatible_qos(policy); });
  }
  if (policy == "RELIABILITY" && sink_) {
    push_notice([this] { sink_(best_effort_event(endpoint_.dds_topic)); });
  }
}

void LocalReader::work() {
  std::unique_lock lock(mutex_);
  while (true) {
    work_.wait(lock, [this] { return ended_ || !items_.empty(); });
    if (ended_) {
      return;
    }
    Item item = std::move(items_.front());
    items_.pop_front();
    samples_ -= item.parcel ? 1 : 0;
    lock.unlock();
    if (item.parcel) {
      deliver(*item.parcel);
    } else {
      item.notice();
    }
    item = {};  // acknowledged, outside the lock
    lock.lock();
  }
}

void LocalReader::deliver(const Parcel& parcel) {
  if (!type_.deserialize(*parcel.bytes, message_.get())) {
    const auto event = malformed_event(endpoint_.dds_topic, parcel.info.writer_guid, ++malformed_);
    if (event && sink_) {
      sink_(*event);
    }
    return;
  }
  MessageInfo info = parcel.info;
  info.reception_stamp_ns = wall_clock_ns();
  deliver_(message_.get(), info);
}

Hub& Hub::instance() {
  static Hub hub;
  return hub;
}

bool Hub::same_topic(const LocalWriter& writer, const LocalReader& reader) {
  return writer.domain_ == reader.domain_ &&
         writer.endpoint_.dds_topic == reader.endpoint_.dds_topic &&
         writer.endpoint_.dds_type == reader.endpoint_.dds_type;
}

std::string Hub::incompatible_policy(const LocalWriter& writer, const LocalReader& reader) {
  const Qos& offered = writer.endpoint_.qos;
  const Qos& requested = reader.endpoint_.qos;
  if (requested.durability > offered.durability) {
    return "DURABILITY";
  }
  return requested.reliability > offered.reliability ? "RELIABILITY" : "";
}

void Hub::send(LocalWriter& writer, LocalReader& reader, const LocalWriter::Sample& sample) {
  reader.push_sample(std::make_unique<Parcel>(
      sample.bytes, MessageInfo{writer.guid_, sample.stamp_ns, 0}, writer.outstanding_));
}

void Hub::meet(LocalWriter& writer, LocalReader& reader) {
  if (!same_topic(writer, reader)) {
    return;
  }
  const std::string policy = incompatible_policy(writer, reader);
  if (!policy.empty()) {
    reader.refused(policy);
    writer.refused(policy);
  }
  if (policy == "RELIABILITY") {
    reader.endpoint_.qos.reliability = Reliability::kBestEffort;
  } else if (!policy.empty()) {
    return;
  }
  reader.matched_with(writer.guid_);
  writer.readers_changed(1);
  if (reader.endpoint_.qos.durability == Durability::kTransientLocal) {
    for (const LocalWriter::Sample& sample : writer.history_) {
      send(writer, reader, sample);
    }
  }
}

void Hub::part(LocalWriter& writer, LocalReader& reader) {
  if (!reader.writers_.contains(writer.guid_)) {
    return;
  }
  reader.lost(writer.guid_);
  writer.readers_changed(-1);
}

void Hub::add(LocalWriter& writer) {
  const std::lock_guard lock(mutex_);
  writers_.push_back(&writer);
  for (LocalReader* reader : readers_) {
    meet(writer, *reader);
  }
}

void Hub::remove(LocalWriter& writer) {
  const std::lock_guard lock(mutex_);
  std::erase(writers_, &writer);
  for (LocalReader* reader : readers_) {
    part(writer, *reader);
  }
}

void Hub::add(LocalReader& reader) {
  const std::lock_guard lock(mutex_);
  readers_.push_back(&reader);
  for (LocalWriter* writer : writers_) {
    meet(*writer, reader);
  }
}

void Hub::remove(LocalReader& reader) {
  const std::lock_guard lock(mutex_);
  std::erase(readers_, &reader);
  for (LocalWriter* writer : writers_) {
    part(*writer, reader);
  }
}

void Hub::publish(LocalWriter& writer, std::shared_ptr<const Bytes> bytes) {
  const std::lock_guard lock(mutex_);
  const LocalWriter::Sample sample{std::move(bytes), wall_clock_ns()};
  if (writer.endpoint_.qos.durability == Durability::kTransientLocal) {
    writer.history_.push_back(sample);
    if (writer.history_.size() > static_cast<std::size_t>(writer.endpoint_.qos.depth)) {
      writer.history_.pop_front();
    }
  }
  for (LocalReader* reader : readers_) {
    if (reader->writers_.contains(writer.guid_)) {
      send(writer, *reader, sample);
    }
  }
}

std::vector<DiscoveredEndpoint> Hub::others(int domain, const void* participant) {
  const std::lock_guard lock(mutex_);
  std::vector<DiscoveredEndpoint> found;
  const auto add = [&](bool writes, const auto& one) {
    const Endpoint& endpoint = one.endpoint_;
    if (one.domain_ == domain && endpoint.participant != participant) {
      found.push_back({one.guid_,
                       writes,
                       endpoint.dds_topic,
                       endpoint.dds_type,
                       endpoint.qos.reliability,
                       endpoint.qos.durability,
                       static_cast<unsigned>(getpid())});
    }
  };
  for (const LocalWriter* writer : writers_) {
    add(true, *writer);
  }
  for (const LocalReader* reader : readers_) {
    add(false, *reader);
  }
  return found;
}

}  // namespace trigpoint::bus::in_process
