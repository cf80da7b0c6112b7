// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <numeric>

namespace trigpoint::recording {

/// Keeps a player from running ahead of those who listen: it counts their answers. Thread-safe; the
/// answers come on the bus's threads.
class Pace {
 public:
  void on_lio_status(const LioStatus& status) {
    std::uint64_t done = status.scans_used;
    for (const NamedCount& refused : status.scans_refused) {
      done += refused.count;
    }
    if (status.health == LioHealth::kInit) {
      done = status.scans_received;  // it collects sweeps until it knows where odom begins
    }
    tell([&] {
      // `done` itself steps back when the collected sweeps begin to be worked off.
      sweeps_.heard(done, status.scans_received < scans_received_);
      scans_received_ = status.scans_received;
      imu_.heard(status.imu_received);
    });
  }

  void on_gps_status(const GpsStatus& status) {
    tell([&] { fixes_.heard(status.fixes_received); });
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

  bool wait_for_sweeps(std::uint64_t published, std::chrono::milliseconds patience) {
    return wait(patience, [&] { return sweeps_.answered() >= published; });
  }

  bool wait_for_imu(std::uint64_t published, std::chrono::milliseconds patience) {
    return wait(patience, [&] { return imu_.answered() >= published; });
  }

  bool wait_for_fixes(std::uint64_t published, std::chrono::milliseconds patience) {
    return wait(patience, [&] { return fixes_.answered() >= published; });
  }

  bool wait_for_verdict(Nanoseconds fix_stamp_ns, std::chrono::milliseconds patience) {
    return wait(patience, [&] { return verdict_ns_ >= fix_stamp_ns; });
  }

 private:
  /// A counter of another program, which starts anew when that program does.
  struct Answers {
    void heard(std::uint64_t count) { heard(count, count < newest_); }

    void heard(std::uint64_t count, bool started_anew) {
      if (started_anew) {
        before_ += newest_;
      }
      newest_ = count;
    }

    void begin() { base_ = before_ + newest_; }

    /// Not below zero: what was answered before the first message may step back, too.
    std::uint64_t answered() const {
      const std::uint64_t all = before_ + newest_;
      return all > base_ ? all - base_ : 0;
    }

    std::uint64_t before_{0};
    std::uint64_t newest_{0};
    std::uint64_t base_{0};
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

  std::mutex mutex_;
  std::condition_variable changed_;
  Answers sweeps_;
  Answers fixes_;
  Answers imu_;
  std::uint64_t scans_received_{0};
  Nanoseconds verdict_ns_{0};
};

}  // namespace trigpoint::recording
