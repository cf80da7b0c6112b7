// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The file that a recording's messages go into, whatever its storage.
#pragma once

#include "trigpoint/recording/rosbag2_writer.hpp"

#include "rosbag2_metadata.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace trigpoint::recording {

/// What was committed survives a killed process. Every call may throw LogError.
class BagOutput {
 public:
  virtual ~BagOutput() = default;

  /// Its number, for add_message.
  virtual std::int64_t add_topic(const Rosbag2Topic& topic) = 0;
  virtual void add_message(std::int64_t topic,
                           Nanoseconds receive_ns,
                           std::span<const std::uint8_t> cdr) = 0;
  /// Makes durable what was added since. False when the storage has given it up by itself.
  virtual bool commit() = 0;
  /// Room to keep free for a last commit() and finish() on a full disk, when a message of so many
  /// bytes is added.
  virtual std::uint64_t closing_bytes(std::uint64_t message_bytes) const = 0;

  /// Tidies up after a commit; what is committed is durable without it.
  virtual void settle() {}

  /// Ends the file with what is committed; `metadata` is rosbag2's, as YAML, nullopt when there may
  /// be no room for it.
  virtual void finish(const std::optional<std::string>& metadata) = 0;
};

/// Messages are committed about once a second and when they are so many bytes.
inline constexpr std::uint64_t kCommit_bytes = 4U << 20U;

/// `file` must not exist; beyond `largest_bytes` (0 = none) it is as if the disk were full.
std::unique_ptr<BagOutput> create_db3(const std::filesystem::path& file,
                                      std::uint64_t largest_bytes);
std::unique_ptr<BagOutput> create_mcap(const std::filesystem::path& file,
                                       std::uint64_t largest_bytes);

}  // namespace trigpoint::recording
