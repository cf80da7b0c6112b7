// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "paced_sender.hpp"

#include "domain_config.hpp"
#include "endpoint.hpp"

#include <algorithm>
#include <utility>

namespace trigpoint::bus::cyclonedds {

PacedSender::PacedSender(std::int64_t portion_bytes,
                         std::chrono::milliseconds period,
                         Refused refused)
    : portion_bytes_(portion_bytes),
      period_(period),
      refused_(std::move(refused)),
      thread_([this] { work(); }) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return pacer_.has_value(); });
}

PacedSender::~PacedSender() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

dds_return_t PacedSender::send(dds_entity_t writer,
                               const Topic& topic,
                               const WireSample& sample,
                               int depth) {
  WireData data(topic, sample, *pacer_);
  if (!data || data.cdr().size() > static_cast<std::size_t>(kLargestMessage_bytes)) {
    return DDS_RETCODE_BAD_PARAMETER;
  }
  {
    const std::lock_guard lock(mutex_);
    const auto is_mine = [writer](const Waiting& each) { return each.writer == writer; };
    if (std::count_if(waiting_.begin(), waiting_.end(), is_mine) >= depth) {
      waiting_.erase(std::find_if(waiting_.begin(), waiting_.end(), is_mine));
    }
    waiting_.push_back({writer, std::move(data)});
  }
  changed_.notify_all();
  return DDS_RETCODE_OK;
}

bool PacedSender::has_sent_all_of(dds_entity_t writer) const {
  return sending_ != writer &&
         std::none_of(waiting_.begin(), waiting_.end(), [writer](const Waiting& w) {
           return w.writer == writer;
         });
}

bool PacedSender::wait_until_sent(dds_entity_t writer,
                                  std::chrono::steady_clock::time_point deadline) {
  std::unique_lock lock(mutex_);
  return changed_.wait_until(lock, deadline, [&] { return has_sent_all_of(writer); });
}

void PacedSender::cancel(dds_entity_t writer) {
  std::unique_lock lock(mutex_);
  std::erase_if(waiting_, [writer](const Waiting& each) { return each.writer == writer; });
  changed_.wait(lock, [&] { return sending_ != writer; });
}

void PacedSender::forward(Waiting& next) const {
  const std::size_t size_bytes = next.data.cdr().size();
  dds_return_t result = DDS_RETCODE_OK;
  {
    const OwnCall call;
    result = next.data.forward_to(next.writer);
  }
  if (result != DDS_RETCODE_OK) {
    refused_(size_bytes, result);
  }
}

void PacedSender::work() {
  std::unique_lock lock(mutex_);
  pacer_.emplace(portion_bytes_, period_);
  changed_.notify_all();
  while (true) {
    changed_.wait(lock, [this] { return ended_ || !waiting_.empty(); });
    if (ended_) {
      return;
    }
    Waiting next = std::move(waiting_.front());
    waiting_.pop_front();
    sending_ = next.writer;
    lock.unlock();
    forward(next);
    lock.lock();
    sending_.reset();
    changed_.notify_all();
  }
}

}  // namespace trigpoint::bus::cyclonedds
