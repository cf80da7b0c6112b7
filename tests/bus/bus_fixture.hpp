// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the tests of the bus share: a domain of one's own, and waiting for conditions.
#pragma once

#include "trigpoint/bus/bus.hpp"

#include "run_command.hpp"

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace trigpoint::bus::testing {

// Far above anything a loaded machine needs; only a broken bus waits so long.
inline constexpr std::chrono::seconds kForever{30};

inline Config config_of_domain(int id) {
  Config config;
  config.domain_id = id;
  config.network_interface = "lo";
  return config;
}

/// On a domain that no other test has.
inline Config own_domain() {
  return config_of_domain(tests::own_domain_id());
}

/// Collects what callbacks bring, from any thread.
template <class T>
class Collected {
 public:
  void add(T item) {
    {
      const std::lock_guard lock(mutex_);
      items_.push_back(std::move(item));
    }
    changed_.notify_all();
  }

  /// False when `count` items did not come.
  bool wait_for(std::size_t count) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kForever, [&] { return items_.size() >= count; });
  }

  std::vector<T> items() const {
    const std::lock_guard lock(mutex_);
    return items_;
  }

  std::size_t size() const {
    const std::lock_guard lock(mutex_);
    return items_.size();
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<T> items_;
};

/// Publisher events that let a test wait for its readers.
class Readers {
 public:
  PublisherEvents events() {
    return {[this](int readers) {
              {
                const std::lock_guard lock(mutex_);
                readers_ = readers;
              }
              changed_.notify_all();
            },
            {}};
  }

  bool wait_for(int readers) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kForever, [&] { return readers_ == readers; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int readers_{0};
};

template <class T>
struct Heard {
  T message;
  MessageInfo info;
};

}  // namespace trigpoint::bus::testing
