// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/serial_worker.hpp"

#include <utility>

namespace trigpoint {

SerialWorker::SerialWorker(std::size_t capacity) : jobs_(capacity), thread_([this] { work(); }) {}

SerialWorker::~SerialWorker() {
  jobs_.close();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void SerialWorker::give(Job job) {
  rethrow();
  jobs_.push(std::move(job));
}

void SerialWorker::finish() {
  jobs_.close();
  if (thread_.joinable()) {
    thread_.join();
  }
  rethrow();
}

void SerialWorker::rethrow() {
  const std::lock_guard lock(mutex_);
  if (failure_) {
    std::rethrow_exception(failure_);
  }
}

/// After a failure the queue is emptied without doing anything: nobody who gives may wait for ever.
void SerialWorker::work() {
  bool failed = false;
  while (auto job = jobs_.pop()) {
    if (failed) {
      continue;
    }
    try {
      (*job)();
    } catch (...) {
      failed = true;
      const std::lock_guard lock(mutex_);
      failure_ = std::current_exception();
    }
  }
}

}  // namespace trigpoint
