// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/bounded_queue.hpp"
#include "trigpoint/lio_mapper/cloud_decoder.hpp"

#include <cstddef>
#include <optional>
#include <thread>
#include <utility>

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

  /// Nobody takes any more: wakes who waits in add().
  void stop() {
    raw_.close();
    decoded_.close();
  }

 private:
  static constexpr std::size_t kRaw = 2;  ///< beside the one in work

  void decode() {
    while (auto cloud = raw_.pop()) {
      if (!decoded_.push(decoder_.decode(*cloud))) {
        return;
      }
    }
  }

  CloudDecoder decoder_;
  BoundedQueue<PointCloudMessage> raw_{kRaw};
  BoundedQueue<DecodedCloud> decoded_;
  std::thread thread_;  ///< last: it uses the others
};

}  // namespace trigpoint::lio_mapper
