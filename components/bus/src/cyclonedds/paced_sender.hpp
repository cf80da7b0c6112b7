// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "cyclone_type.hpp"
#include "pacer.hpp"

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

namespace trigpoint::bus::cyclonedds {

/// One thread that sends the clouds of a participant in portions, so that nobody who publishes
/// waits for them. Like a history of KEEP_LAST it keeps so many samples of a writer and drops the
/// oldest.
class PacedSender {
 public:
  /// A sample that Cyclone refuses later is told on the sender's thread.
  using Refused = std::function<void(std::size_t size_bytes, dds_return_t why)>;

  PacedSender(std::int64_t portion_bytes, std::chrono::milliseconds period, Refused refused);
  ~PacedSender();

  /// An error when the sample cannot be serialised or is too large.
  dds_return_t send(dds_entity_t writer, const Topic& topic, const WireSample& sample, int depth);

  /// Until nothing of this writer waits to be sent; false when that takes longer.
  bool wait_until_sent(dds_entity_t writer, std::chrono::steady_clock::time_point deadline);

  /// Forgets the writer's samples; when it returns none of them is being sent.
  void cancel(dds_entity_t writer);

 private:
  struct Waiting {
    dds_entity_t writer;
    WireData data;
  };

  void work();
  void forward(Waiting& next) const;
  bool has_sent_all_of(dds_entity_t writer) const;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Waiting> waiting_;
  std::optional<dds_entity_t> sending_;
  bool ended_{false};
  const std::int64_t portion_bytes_;
  const std::chrono::milliseconds period_;
  const Refused refused_;
  std::optional<Pacer> pacer_;  ///< made by the thread that it holds back
  std::thread thread_;
};

}  // namespace trigpoint::bus::cyclonedds
