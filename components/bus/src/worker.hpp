// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace trigpoint::bus {

/// One thread for what must not be done inside a listener, such as deleting its reader.
class Worker {
 public:
  Worker();
  ~Worker();

  void post(const void* owner, std::function<void()> job);
  /// Forgets the owner's jobs; when it returns none of them runs.
  void cancel(const void* owner);

 private:
  struct Job {
    const void* owner;
    std::function<void()> run;
  };

  void work();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  const void* running_{nullptr};
  bool ended_{false};
  std::thread thread_;
};

}  // namespace trigpoint::bus
