// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Writes what is on the bus into a rosbag2 or an MCAP file.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/recording/log.hpp"
#include "trigpoint/recording/rosbag2_writer.hpp"

#include "known_topics.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace trigpoint::recording {

struct RecordOptions {
  bus::Config bus;
  std::vector<KnownTopic> topics;
  std::string out;  ///< folder of the bag, or a .mcap file; must not exist
  Storage storage{Storage::kSqlite3};
  double duration_s{0.0};                      ///< wall time; 0: until a signal
  std::function<void(const Event&)> on_event;  ///< may be empty
  /// Called about once a second with what has been written so far; may be empty.
  std::function<void(const std::vector<TopicSummary>&)> progress;
};

struct RecordResult {
  std::vector<TopicSummary> topics;
  std::uint64_t dropped{0};  ///< came faster than the disk took them
};

/// Runs until SIGINT, SIGTERM or the duration's end. Throws LogError or std::runtime_error naming
/// the file when the disk refuses; what was written before stays readable.
RecordResult record(const RecordOptions& options);

}  // namespace trigpoint::recording
