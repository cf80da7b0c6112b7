// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "worker.hpp"

#include <utility>

namespace trigpoint::bus {

Worker::Worker() : thread_([this] { work(); }) {}

Worker::~Worker() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Worker::post(const void* owner, std::function<void()> job) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back({owner, std::move(job)});
  }
  changed_.notify_all();
}

void Worker::cancel(const void* owner) {
  std::unique_lock lock(mutex_);
  std::erase_if(jobs_, [owner](const Job& job) { return job.owner == owner; });
  changed_.wait(lock, [this, owner] { return running_ != owner; });
}

void Worker::work() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ended_ || !jobs_.empty(); });
    if (ended_) {
      return;
    }
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    running_ = job.owner;
    lock.unlock();
    job.run();
    lock.lock();
    running_ = nullptr;
    changed_.notify_all();
  }
}

}  // namespace trigpoint::bus
