// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/bounded_queue.hpp"
#include "trigpoint/lio_mapper/cloud_decoder.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace trigpoint::lio_mapper {

/// Decodes clouds on a thread of its own, in the order in which they came, while the mapper matches
/// the ones before.
class DecodeAhead {
 public:
  /// So many decoded clouds may wait for the mapper; then add() waits.
  DecodeAhead(const Config& config, std::size_t most)
      : decoder_(config), decoded_(most), thread_([this] { decode(); }) {}

  ~DecodeAhead() {
    stop();
    thread_.join();
  }

  DecodeAhead(const DecodeAhead&) = delete;
  DecodeAhead& operator=(const DecodeAhead&) = delete;

  /// False when it was stopped.
  bool add(PointCloudMessage cloud) { return raw_.push(std::move(cloud)); }

  /// The oldest one; waits until it is decoded. One call for each add().
  std::optional<DecodedCloud> take() { return decoded_.pop(); }

  /// The bytes of a cloud that was decoded, or none: with memory that is there already, the next
  /// one arrives without a page fault for each of its pages.
  std::vector<std::uint8_t> take_spare_bytes() {
    const std::lock_guard lock(spare_mutex_);
    return std::move(spare_);
  }

  /// Nobody takes any more: wakes who waits in add().
  void stop() {
    raw_.close();
    decoded_.close();
  }

 private:
  using Clock = std::chrono::steady_clock;

  static constexpr std::size_t kRaw = 2;  ///< beside the one in work
  /// Who sends larger clouds, or one such, does not make us keep its memory.
  static constexpr std::size_t kMostSpare_bytes = 16'000'000;

  void decode() {
    while (auto cloud = raw_.pop()) {
      const Clock::time_point before = Clock::now();
      DecodedCloud decoded = decoder_.decode(*cloud);
      decoded.set_decoding_ms(
          std::chrono::duration<double, std::milli>(Clock::now() - before).count());
      if (!decoded_.push(std::move(decoded))) {
        return;
      }
      keep_spare(std::move(cloud->data));
    }
  }

  void keep_spare(std::vector<std::uint8_t> bytes) {
    if (bytes.capacity() <= kMostSpare_bytes) {
      const std::lock_guard lock(spare_mutex_);
      spare_ = std::move(bytes);
    }
  }

  CloudDecoder decoder_;
  BoundedQueue<PointCloudMessage> raw_{kRaw};
  BoundedQueue<DecodedCloud> decoded_;
  std::mutex spare_mutex_;
  std::vector<std::uint8_t> spare_;
  std::thread thread_;  ///< last: it uses the others
};

}  // namespace trigpoint::lio_mapper
