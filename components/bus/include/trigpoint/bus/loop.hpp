// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The single thread on which a process shell runs its core.
#pragma once

#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <thread>

namespace trigpoint::bus {

/// What post() does when the queue is full.
enum class WhenFull : std::uint8_t {
  kBlock,      ///< waits for room; the caller's thread is held back
  kDropOldest  ///< drops and counts the oldest task that was posted so (or this one, if there is
               ///< none)
};

/// Runs posted tasks and timers one after another in run(). Make it before every other thread of
/// the process (before the Participant too): it blocks SIGINT and SIGTERM so that only it gets
/// them.
class Loop {
 public:
  using Task = std::function<void()>;
  using TimerId = std::uint64_t;

  explicit Loop(std::size_t capacity = 4096);
  ~Loop();
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  /// From any thread. False when the task was not taken: the loop has stopped, or it was dropped.
  /// From the loop's own thread it never blocks and may exceed the capacity.
  bool post(Task task, WhenFull when_full = WhenFull::kBlock);

  /// Wall-clock timer, first after one period; missed periods are skipped, not made up for.
  TimerId every(std::chrono::nanoseconds period, Task task);
  void cancel(TimerId timer);

  /// Until stop() or a signal; tasks still queued then are discarded. An exception of a task ends
  /// the loop and is thrown on. Returns the signal's number, or 0.
  int run();

  /// From any thread, also before run(). Final: the loop does not run again.
  void stop();

  bool stopped() const;
  /// Nothing to do at this moment: what is posted now, it runs at once.
  bool is_waiting() const;
  std::uint64_t dropped() const;
  std::size_t queued() const;

 private:
  using Clock = std::chrono::steady_clock;

  struct Queued {
    Task task;
    bool droppable;
  };

  struct Timer {
    Clock::time_point due;
    Clock::duration period;
    Task task;
  };

  void wait_for_signals();
  bool make_room(std::unique_lock<std::mutex>& lock, WhenFull when_full);
  bool drop_oldest();
  Task next_task(std::unique_lock<std::mutex>& lock);
  std::map<TimerId, Timer>::iterator earliest_timer();

  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable work_;
  std::condition_variable room_;
  std::deque<Queued> tasks_;
  std::map<TimerId, Timer> timers_;
  TimerId last_timer_{0};
  std::uint64_t dropped_{0};
  bool stopped_{false};
  bool waiting_{false};
  int signal_{0};
  std::thread::id runner_;
  int signal_fd_{-1};
  int quit_fd_{-1};
  sigset_t previous_mask_{};
  std::thread signal_thread_;
};

}  // namespace trigpoint::bus
