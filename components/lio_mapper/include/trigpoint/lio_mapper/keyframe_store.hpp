// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/lio_mapper/checkpoint.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// Append-only keyframes and GPS rows, and the newest checkpoint, on disk (SQLite, format in
/// KEYFRAMES.md): what was written survives the death of the writer.
class KeyframeWriter {
 public:
  /// Creates or continues `file`. Throws std::runtime_error naming the file and the cause.
  explicit KeyframeWriter(const std::string& file);
  ~KeyframeWriter();
  /// The three below throw std::runtime_error when the disk is full or the file is gone.
  void append(const Keyframe& keyframe);
  /// What one scan left, all of it or nothing: its keyframe if it made one, rows that were decided
  /// since the last scan, and the checkpoint in place of the one before.
  void commit(const Checkpoint& checkpoint,
              const std::vector<StoredRow>& rows,
              const std::optional<Keyframe>& keyframe);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// What the clouds of a store take on disk.
struct CloudSizes {
  std::uint64_t keyframes{0};
  std::uint64_t points{0};
  std::uint64_t bytes{0};  ///< as stored, without the database around them

  std::uint64_t raw_bytes() const { return points * sizeof(PointXyzi); }

  /// 1 for float32 x y z intensity; NaN without a point.
  double ratio() const {
    return points > 0 ? static_cast<double>(bytes) / static_cast<double>(raw_bytes()) : kNaN;
  }
};

/// A store that is open for reading; may be while another writes. All throw std::runtime_error
/// naming file and cause. Holds one keyframe at a time.
class KeyframeReader {
 public:
  explicit KeyframeReader(const std::string& file);
  ~KeyframeReader();

  /// In order of time. Returns their number.
  std::uint64_t visit(const std::function<void(const Keyframe&)>& visit);
  /// In order of time, without their points: no cloud is read.
  std::uint64_t visit_places(const std::function<void(const Keyframe&)>& visit);
  /// Those of a region, in order of time; others are not read from the disk.
  std::uint64_t visit(const MapRegion& region, const std::function<void(const Keyframe&)>& visit);
  /// The `place`-th in order of time, from 0; nothing beyond the last. What was appended after the
  /// first call is not found.
  std::optional<Keyframe> at(std::size_t place);
  /// In the order in which they were decided. Returns their number.
  std::uint64_t visit_rows(const std::function<void(const StoredRow&)>& visit);
  /// The newest; nothing when the store has none, as one of format 3.
  std::optional<Checkpoint> checkpoint();
  /// Without unpacking any.
  CloudSizes cloud_sizes();
  /// Where the epoch's first keyframe was taken.
  std::optional<Pose> first_pose(std::uint32_t odom_epoch);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Calls `visit` with every keyframe in order of time. Throws std::runtime_error when the file
/// cannot be read. Returns the number of keyframes.
std::uint64_t read_keyframes(const std::string& file,
                             const std::function<void(const Keyframe&)>& visit);

/// The points of a store as a mapper wants them that goes on from it. Opens the file at each call.
StoredPoints stored_points_of(const std::string& file);

}  // namespace trigpoint::lio_mapper
