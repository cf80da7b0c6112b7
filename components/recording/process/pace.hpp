// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace trigpoint::recording {

/// Keeps a player from running ahead of those who listen: it counts their answers. Thread-safe; the
/// answers come on the bus's threads.
class Pace {
 public:
  /// `writer`: GUID of who says it; one that is started again is another one.
  void on_lio_status(const LioStatus& status, const std::string& writer) {
    std::uint64_t done = status.scans_used;
    for (const NamedCount& refused : status.scans_refused) {
      done += refused.count;
    }
    if (status.health == LioHealth::kInit) {
      done = status.scans_received;  // it collects sweeps until it knows where odom begins
    }
    tell([&] {
      sweeps_.heard(writer, done);
      imu_.heard(writer, status.imu_received);
    });
  }

  void on_gps_status(const GpsStatus& status, const std::string& writer) {
    tell([&] { fixes_.heard(writer, status.fixes_received); });
  }

  void on_fusion_status(const FusionStatus& status) {
    tell([&] { verdict_ns_ = std::max(verdict_ns_, status.verdict.fix_stamp_ns); });
  }

  /// Counts from before the first message are not answers to it.
  void begin() {
    tell([&] {
      sweeps_.begin();
      fixes_.begin();
      imu_.begin();
    });
  }

  /// What has gone out so far, also when nobody is waited for.
  void published(std::uint64_t sweeps, std::uint64_t imu, std::uint64_t fixes) {
    const std::scoped_lock lock(mutex_);
    sweeps_.ask(sweeps);
    imu_.ask(imu);
    fixes_.ask(fixes);
  }

  bool wait_for_sweeps(std::uint64_t published, std::chrono::milliseconds patience) {
    return wait_for(sweeps_, published, patience);
  }

  bool wait_for_imu(std::uint64_t published, std::chrono::milliseconds patience) {
    return wait_for(imu_, published, patience);
  }

  bool wait_for_fixes(std::uint64_t published, std::chrono::milliseconds patience) {
    return wait_for(fixes_, published, patience);
  }

  bool wait_for_verdict(Nanoseconds fix_stamp_ns, std::chrono::milliseconds patience) {
    return wait(patience, [&] { return verdict_ns_ >= fix_stamp_ns; });
  }

 private:
  /// A counter that other programs keep: the mapper, or GPS filters, one of which is enough. One
  /// that comes later, in place of one that died or beside it, will never answer what was asked
  /// before: that counts as answered.
  struct Answers {
    void heard(const std::string& writer, std::uint64_t count) {
      const auto newest = static_cast<std::int64_t>(count);
      const auto [known, is_new] = writers_.try_emplace(writer);
      if (is_new && writers_.size() > 1) {
        known->second.base = newest - asked_;
      }
      known->second.newest = newest;
    }

    void begin() {
      asked_ = 0;
      for (auto& [writer, count] : writers_) {
        count.base = count.newest;
      }
    }

    void ask(std::uint64_t published) {
      asked_ = std::max(asked_, static_cast<std::int64_t>(published));
    }

    bool has(std::uint64_t published) const {
      return published == 0 ||
             std::any_of(writers_.begin(), writers_.end(), [&](const auto& entry) {
               return entry.second.newest - entry.second.base >=
                      static_cast<std::int64_t>(published);
             });
    }

   private:
    struct Count {
      std::int64_t newest{0};
      std::int64_t base{0};
    };

    std::map<std::string, Count> writers_;
    std::int64_t asked_{0};
  };

  template <typename Change>
  void tell(Change change) {
    {
      const std::scoped_lock lock(mutex_);
      change();
    }
    changed_.notify_all();
  }

  template <typename Condition>
  bool wait(std::chrono::milliseconds patience, Condition condition) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, patience, condition);
  }

  bool wait_for(Answers& answers, std::uint64_t published, std::chrono::milliseconds patience) {
    tell([&] { answers.ask(published); });
    return wait(patience, [&] { return answers.has(published); });
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  Answers sweeps_;
  Answers fixes_;
  Answers imu_;
  Nanoseconds verdict_ns_{0};
};

}  // namespace trigpoint::recording
