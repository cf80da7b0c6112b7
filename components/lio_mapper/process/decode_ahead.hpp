// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/lio_mapper/cloud_decoder.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace trigpoint::lio_mapper {

/// What the mapper does when a cloud comes.
enum class MapperIs : std::uint8_t { kWaiting, kBusy };

/// Decodes clouds, in the order in which they came, on a thread of its own while the mapper matches
/// the ones before. A mapper that waits for a cloud decodes it itself: nothing is handed from
/// thread to thread then, no third thread is woken beside the two that have work, and the points
/// are in the mapper's processor's cache.
class DecodeAhead {
 public:
  /// So many decoded clouds may wait for the mapper; then add() waits.
  DecodeAhead(const Config& config, std::size_t most)
      : decoder_(config), most_(std::max<std::size_t>(most, 1)), thread_([this] { work(); }) {}

  ~DecodeAhead() {
    stop();
    thread_.join();
  }

  DecodeAhead(const DecodeAhead&) = delete;
  DecodeAhead& operator=(const DecodeAhead&) = delete;

  /// False when it was stopped. What a waiting mapper is given, it decodes, unless it is busy again
  /// when the next one comes.
  bool add(PointCloudMessage cloud, MapperIs mapper) {
    std::unique_lock lock(mutex_);
    room_.wait(lock, [this] { return stopped_ || raw_.size() < kRaw; });
    if (stopped_) {
      return false;
    }
    raw_.push_back(std::move(cloud));
    called_ = called_ || mapper == MapperIs::kBusy;
    wake_if_called();
    return true;
  }

  /// The oldest one; waits until it is decoded. One call for each add().
  std::optional<DecodedCloud> take() {
    std::unique_lock lock(mutex_);
    for (;;) {
      if (!decoded_.empty()) {
        std::optional<DecodedCloud> oldest(std::move(decoded_.front()));
        decoded_.pop_front();
        wake_if_called();
        return oldest;
      }
      if (stopped_) {
        return std::nullopt;
      }
      if (!decoding_ && !raw_.empty()) {
        decode_front(lock);
      } else {
        ready_.wait(lock);
      }
    }
  }

  /// The bytes of a cloud that was decoded, or none: with memory that is there already, the next
  /// one arrives without a page fault for each of its pages.
  std::vector<std::uint8_t> take_spare_bytes() {
    const std::lock_guard lock(mutex_);
    return std::exchange(spare_, {});
  }

  /// Nobody takes any more: wakes who waits in add().
  void stop() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = true;
    }
    work_.notify_all();
    room_.notify_all();
    ready_.notify_all();
  }

 private:
  using Clock = std::chrono::steady_clock;

  static constexpr std::size_t kRaw = 2;  ///< beside the one in work
  /// Who sends larger clouds, or one such, does not make us keep its memory.
  static constexpr std::size_t kMostSpare_bytes = 16'000'000;

  void work() {
    std::unique_lock lock(mutex_);
    while (!stopped_) {
      if (!called_ || decoding_ || raw_.empty() || decoded_.size() >= most_) {
        work_.wait(lock);
      } else {
        decode_front(lock);
      }
    }
  }

  /// By one thread at a time, so that clouds stay in order.
  void decode_front(std::unique_lock<std::mutex>& lock) {
    decoding_ = true;
    PointCloudMessage cloud = std::move(raw_.front());
    raw_.pop_front();
    called_ = called_ && !raw_.empty();
    lock.unlock();
    room_.notify_one();
    const Clock::time_point before = Clock::now();
    DecodedCloud decoded = decoder_.decode(cloud);
    decoded.set_decoding_ms(
        std::chrono::duration<double, std::milli>(Clock::now() - before).count());
    lock.lock();
    decoding_ = false;
    decoded_.push_back(std::move(decoded));
    if (cloud.data.capacity() <= kMostSpare_bytes) {
      spare_ = std::move(cloud.data);
    }
    ready_.notify_one();
    wake_if_called();
  }

  /// With mutex_ held.
  void wake_if_called() {
    if (called_) {
      work_.notify_one();
    }
  }

  CloudDecoder decoder_;
  const std::size_t most_;
  std::mutex mutex_;
  std::condition_variable work_;   ///< for the thread
  std::condition_variable room_;   ///< for add()
  std::condition_variable ready_;  ///< for take()
  std::deque<PointCloudMessage> raw_;
  std::deque<DecodedCloud> decoded_;
  std::vector<std::uint8_t> spare_;
  bool decoding_{false};
  bool called_{false};  ///< the thread, for what is raw
  bool stopped_{false};
  std::thread thread_;  ///< last: it uses the others
};

}  // namespace trigpoint::lio_mapper
