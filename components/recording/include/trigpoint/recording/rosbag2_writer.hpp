// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Records what `ros2 bag` (Humble and later) and Foxglove open: rosbag2 (sqlite3 or MCAP), or one
// MCAP file.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/recording/log.hpp"

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace trigpoint::recording {

/// What a topic's metadata says of its writer.
enum class Durability { kVolatile, kTransientLocal };

enum class Storage { kSqlite3, kMcap };

/// Whether a recording of this name is one MCAP file ("drive.mcap") and not a folder.
bool names_mcap_file(const std::string& path);

/// Writes a rosbag2 folder: FOLDER/metadata.yaml and FOLDER/<folder's name>_0.db3 or .mcap; or one
/// .mcap file alone, which is told by its name. Messages become durable about once a second (a
/// transaction, a chunk): a killed recorder loses at most that, and what it wrote stays readable
/// without metadata.yaml. Not thread-safe.
class Rosbag2Writer {
 public:
  /// Creates the folder and its parents. Throws LogError when it exists and is not empty, when the
  /// file exists, or it can't be created. `largest_bytes` limits the size of the .db3 or .mcap (0 =
  /// none): what would exceed it fails as on a full disk.
  explicit Rosbag2Writer(const std::string& path,
                         Storage storage = Storage::kSqlite3,
                         std::uint64_t largest_bytes = 0);
  /// Closes; errors are swallowed, so call close() to hear of them.
  ~Rosbag2Writer();
  Rosbag2Writer(const Rosbag2Writer&) = delete;
  Rosbag2Writer& operator=(const Rosbag2Writer&) = delete;

  /// Appends a message; `topic` with or without a leading slash. Throws LogError when the disk is
  /// full or the folder is lost; what was written before stays readable, and the writer is closed.
  /// Plain is any of the structs that bus/cdr.hpp encodes.
  template <class Plain>
  void write(const std::string& topic, Nanoseconds receive_ns, const Plain& message);

  /// The same for a serialised message (CDR with its 4-byte encapsulation header).
  void write_cdr(const std::string& topic,
                 const std::string& ros_type,
                 Nanoseconds receive_ns,
                 std::span<const std::uint8_t> cdr);

  /// Names a topic before its first message, to record its durability or that it stayed silent.
  void declare_topic(const std::string& topic, const std::string& ros_type, Durability durability);

  /// Makes all durable now, without waiting for the second to pass.
  void flush();

  /// Finishes the .db3 or .mcap and writes metadata.yaml. Further writes throw LogError.
  void close();

  std::uint64_t messages_written() const;

 private:
  class Bag;
  std::unique_ptr<Bag> bag_;
};

}  // namespace trigpoint::recording
