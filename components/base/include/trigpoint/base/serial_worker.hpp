// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/bounded_queue.hpp"

#include <exception>
#include <functional>
#include <mutex>
#include <thread>

namespace trigpoint {

/// One thread that does jobs in the order in which they were given, beside their giver.
class SerialWorker {
 public:
  using Job = std::function<void()>;

  /// So many jobs may wait.
  explicit SerialWorker(std::size_t capacity);
  /// Does what still waits; what a job throws is lost here, so call finish() before.
  ~SerialWorker();
  SerialWorker(const SerialWorker&) = delete;
  SerialWorker& operator=(const SerialWorker&) = delete;

  /// Waits while the queue is full. Throws what an earlier job threw; later ones are not done then.
  void give(Job job);
  /// Waits until everything given is done. Throws as give() does; nothing may be given afterwards.
  void finish();

  bool is_full() const { return jobs_.is_full(); }

 private:
  void work();
  void rethrow();

  BoundedQueue<Job> jobs_;
  std::mutex mutex_;
  std::exception_ptr failure_;
  std::thread thread_;  ///< last: it uses the others
};

}  // namespace trigpoint
