// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "bulk_queue.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

namespace trigpoint::bus::fastdds {

namespace {

using eprosima::fastdds::rtps::LocatorList;
using eprosima::fastdds::rtps::Locators;
using eprosima::fastrtps::rtps::SenderResource;

constexpr std::int64_t kRepairs_portion = 8;  // one of so many
constexpr std::chrono::milliseconds kSocketFull{100};

thread_local bool writes_new_sample = false;

bool send_now(SenderResource& socket, std::span<const std::uint8_t> bytes, const LocatorList& to) {
  Locators first(to.begin());
  Locators after(to.end());
  return socket.send(bytes.data(),
                     static_cast<std::uint32_t>(bytes.size()),
                     &first,
                     &after,
                     std::chrono::steady_clock::now() + kSocketFull);
}

/// Of some bytes and all that was before them.
std::size_t hash_of(std::span<const std::uint8_t> bytes, std::size_t before) {
  return std::hash<std::string_view>{}(
             {reinterpret_cast<const char*>(bytes.data()), bytes.size()}) ^
         (31 * before);
}

}  // namespace

std::size_t BulkQueue::Datagram::hash() const {
  std::size_t hash = hash_of(bytes, 0);
  for (const Destinations& each : destinations) {
    hash = 31 * hash + std::hash<SenderResource*>{}(each.socket);
    for (const auto& locator : each.to) {
      hash = hash_of(locator.address, hash + locator.port);
    }
  }
  return hash;
}

BulkQueue::NewSample::NewSample() {
  writes_new_sample = true;
}

BulkQueue::NewSample::~NewSample() {
  writes_new_sample = false;
}

BulkQueue::BulkQueue(const Pacing& pacing, std::chrono::milliseconds catches_up)
    : pacing_(pacing), catches_up_(catches_up), thread_([this] { work(); }) {}

BulkQueue::~BulkQueue() {
  stop();
}

void BulkQueue::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    writers_.clear();
    new_.clear();
    repairs_.clear();
    repaired_.clear();
  }
  changed_.notify_all();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void BulkQueue::add_writer(EntityNumber writer, std::size_t depth) {
  const std::lock_guard lock(mutex_);
  if (!stopped_) {
    writers_[writer].depth = depth;
  }
}

template <typename Which>
void BulkQueue::drop_repairs(const Which& which) {
  for (const Datagram& each : repairs_) {
    if (which(each)) {
      repaired_.erase(each.hash());
    }
  }
  std::erase_if(repairs_, which);
}

void BulkQueue::remove_writer(EntityNumber writer) {
  const std::lock_guard lock(mutex_);
  const auto is_its = [writer](const Datagram& each) { return each.sample.writer == writer; };
  writers_.erase(writer);
  std::erase_if(new_, is_its);
  drop_repairs(is_its);
}

bool BulkQueue::send(SenderResource& socket,
                     std::span<const std::uint8_t> bytes,
                     const LocatorList& to) {
  const auto sample = carried_sample(bytes);
  std::unique_lock lock(mutex_);
  if (const auto writer = sample ? writers_.find(sample->writer) : writers_.end();
      writer != writers_.end()) {
    Datagram datagram{{bytes.begin(), bytes.end()}, *sample, {{&socket, to}}};
    if (writes_new_sample) {
      add_new(std::move(datagram), writer->second);
    } else if (repaired_.insert(datagram.hash()).second) {
      repairs_.push_back(std::move(datagram));
    }
    lock.unlock();
    changed_.notify_all();
    return true;
  }
  const auto corrected = with_heartbeats_until(bytes, [this](EntityNumber of) {
    const auto writer = writers_.find(of);
    return writer == writers_.end() || writer->second.waiting.empty()
               ? std::nullopt
               : std::optional(writer->second.waiting.begin()->first - 1);
  });
  return send_now(socket, corrected ? std::span<const std::uint8_t>(*corrected) : bytes, to);
}

void BulkQueue::add_new(Datagram&& datagram, Writer& writer) {
  if (!new_.empty() && new_.back().bytes == datagram.bytes) {  // from another socket
    new_.back().destinations.push_back(std::move(datagram.destinations.front()));
    return;
  }
  if (++writer.waiting[datagram.sample.number] == 1) {
    // Of samples that the writer no longer keeps.
    drop_repairs([newest = datagram.sample, depth = writer.depth](const Datagram& each) {
      return each.sample.writer == newest.writer && each.sample.number + depth <= newest.number;
    });
  }
  if (writer.waiting.size() > writer.depth) {
    drop_new(datagram.sample.writer, writer.waiting.begin()->first);
    writer.waiting.erase(writer.waiting.begin());
  }
  new_.push_back(std::move(datagram));
}

void BulkQueue::drop_new(EntityNumber writer, std::uint64_t number) {
  std::erase_if(new_, [&](const Datagram& each) {
    return each.sample.writer == writer && each.sample.number == number;
  });
}

bool BulkQueue::may_send_repair() const {
  if (repairs_.empty()) {
    return false;
  }
  const auto size = static_cast<std::int64_t>(repairs_.front().bytes.size());
  return new_.empty() || repaired_bytes_ == 0 ||
         kRepairs_portion * (repaired_bytes_ + size) <= pacing_.portion_bytes;
}

BulkQueue::Datagram BulkQueue::next() {
  const bool repairs = may_send_repair();
  auto& queue = repairs ? repairs_ : new_;
  Datagram datagram = std::move(queue.front());
  queue.pop_front();
  if (repairs) {
    repaired_bytes_ += static_cast<std::int64_t>(datagram.bytes.size());
    repaired_.erase(datagram.hash());
  } else if (const auto writer = writers_.find(datagram.sample.writer); writer != writers_.end()) {
    const auto waiting = writer->second.waiting.find(datagram.sample.number);
    if (--waiting->second == 0) {
      writer->second.waiting.erase(waiting);
    }
  }
  return datagram;
}

void BulkQueue::begin_period_if_due() {
  const auto now = std::chrono::steady_clock::now();
  if (now < period_end_) {
    return;
  }
  period_end_ = (now - period_end_ <= catches_up_ ? period_end_ : now) + pacing_.period;
  sent_bytes_ = 0;
  repaired_bytes_ = 0;
}

void BulkQueue::work() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopped_ || !new_.empty() || !repairs_.empty(); });
    if (stopped_) {
      return;
    }
    begin_period_if_due();
    const auto& first = may_send_repair() ? repairs_.front() : new_.front();
    const auto size = static_cast<std::int64_t>(first.bytes.size());
    if (sent_bytes_ > 0 && sent_bytes_ + size > pacing_.portion_bytes) {
      changed_.wait_until(lock, period_end_, [this] { return stopped_; });
      continue;
    }
    sent_bytes_ += size;
    const Datagram datagram = next();
    for (const Destinations& each : datagram.destinations) {
      send_now(*each.socket, datagram.bytes, each.to);
    }
    lock.unlock();  // for those who send something else
    lock.lock();
  }
}

}  // namespace trigpoint::bus::fastdds
