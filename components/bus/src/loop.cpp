// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/loop.hpp"

#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/poll.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace trigpoint::bus {

namespace {

sigset_t ending_signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  return set;
}

int checked(int descriptor, const char* what) {
  if (descriptor < 0) {
    throw std::system_error(errno, std::generic_category(), what);
  }
  return descriptor;
}

}  // namespace

Loop::Loop(std::size_t capacity) : capacity_(std::max<std::size_t>(capacity, 1)) {
  const sigset_t signals = ending_signals();
  pthread_sigmask(SIG_BLOCK, &signals, &previous_mask_);
  signal_fd_ = checked(signalfd(-1, &signals, SFD_CLOEXEC), "signalfd");
  quit_fd_ = checked(eventfd(0, EFD_CLOEXEC), "eventfd");
  signal_thread_ = std::thread([this] { wait_for_signals(); });
}

Loop::~Loop() {
  stop();
  eventfd_write(quit_fd_, 1);
  signal_thread_.join();
  close(signal_fd_);
  close(quit_fd_);
  pthread_sigmask(SIG_SETMASK, &previous_mask_, nullptr);
}

void Loop::wait_for_signals() {
  std::array<pollfd, 2> sources{pollfd{signal_fd_, POLLIN, 0}, pollfd{quit_fd_, POLLIN, 0}};
  while (sources[1].revents == 0) {
    poll(sources.data(), sources.size(), -1);
    signalfd_siginfo info{};
    if (sources[0].revents != 0 && read(signal_fd_, &info, sizeof info) == sizeof info) {
      {
        const std::lock_guard lock(mutex_);
        signal_ = static_cast<int>(info.ssi_signo);
      }
      stop();
    }
  }
}

bool Loop::post(Task task, WhenFull when_full) {
  std::unique_lock lock(mutex_);
  if (!task || !make_room(lock, when_full)) {
    return false;
  }
  tasks_.push_back({std::move(task), when_full == WhenFull::kDropOldest});
  work_.notify_one();
  return true;
}

bool Loop::make_room(std::unique_lock<std::mutex>& lock, WhenFull when_full) {
  const bool full = tasks_.size() >= capacity_;
  if (full && when_full == WhenFull::kDropOldest) {
    return !stopped_ && drop_oldest();
  }
  if (full && std::this_thread::get_id() != runner_) {
    room_.wait(lock, [this] { return stopped_ || tasks_.size() < capacity_; });
  }
  return !stopped_;
}

bool Loop::drop_oldest() {
  ++dropped_;
  const auto oldest =
      std::find_if(tasks_.begin(), tasks_.end(), [](const Queued& each) { return each.droppable; });
  if (oldest == tasks_.end()) {
    return false;
  }
  tasks_.erase(oldest);
  return true;
}

Loop::TimerId Loop::every(std::chrono::nanoseconds period, Task task) {
  if (period <= std::chrono::nanoseconds::zero()) {
    throw std::invalid_argument("the period of a timer is " + std::to_string(period.count()) +
                                " ns; expected more than 0");
  }
  const std::lock_guard lock(mutex_);
  const Clock::time_point due = Clock::now() + period;
  timers_.emplace(++last_timer_, Timer{due, period, std::move(task)});
  work_.notify_one();
  return last_timer_;
}

void Loop::cancel(TimerId timer) {
  const std::lock_guard lock(mutex_);
  timers_.erase(timer);
}

std::map<Loop::TimerId, Loop::Timer>::iterator Loop::earliest_timer() {
  return std::min_element(timers_.begin(), timers_.end(), [](const auto& a, const auto& b) {
    return a.second.due < b.second.due;
  });
}

/// Waits for work; an empty task when the loop stops. A due timer goes before queued tasks, so that
/// a busy queue cannot starve it.
Loop::Task Loop::next_task(std::unique_lock<std::mutex>& lock) {
  while (!stopped_) {
    const auto timer = earliest_timer();
    const Clock::time_point now = Clock::now();
    if (timer != timers_.end() && timer->second.due <= now) {
      Timer& due = timer->second;
      due.due += due.period * ((now - due.due) / due.period + 1);
      return due.task;
    }
    if (!tasks_.empty()) {
      Task task = std::move(tasks_.front().task);
      tasks_.pop_front();
      room_.notify_one();
      return task;
    }
    waiting_ = true;
    if (timer == timers_.end()) {
      work_.wait(lock);
    } else {
      const Clock::time_point due = timer->second.due;
      work_.wait_until(lock, due);
    }
    waiting_ = false;
  }
  return {};
}

int Loop::run() {
  std::unique_lock lock(mutex_);
  runner_ = std::this_thread::get_id();
  try {
    while (Task task = next_task(lock)) {
      lock.unlock();
      task();
      task = nullptr;  // what it holds is released outside the lock
      lock.lock();
    }
  } catch (...) {
    if (lock.owns_lock()) {
      lock.unlock();
    }
    stop();
    throw;
  }
  runner_ = {};
  return signal_;
}

void Loop::stop() {
  std::deque<Queued> discarded;
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    discarded.swap(tasks_);
  }
  work_.notify_all();
  room_.notify_all();
}

bool Loop::stopped() const {
  const std::lock_guard lock(mutex_);
  return stopped_;
}

bool Loop::is_waiting() const {
  const std::lock_guard lock(mutex_);
  return waiting_ && tasks_.empty();
}

std::uint64_t Loop::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

std::size_t Loop::queued() const {
  const std::lock_guard lock(mutex_);
  return tasks_.size();
}

}  // namespace trigpoint::bus
