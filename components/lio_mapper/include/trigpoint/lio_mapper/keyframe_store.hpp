// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/lio_mapper/lio_mapper.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace trigpoint::lio_mapper {

/// Append-only keyframes on disk (SQLite, one row each, format in KEYFRAMES.md): what was written
/// survives the death of the writer.
class KeyframeWriter {
 public:
  /// Creates or continues `file`. Throws std::runtime_error naming the file and the cause.
  explicit KeyframeWriter(const std::string& file);
  ~KeyframeWriter();
  /// Throws std::runtime_error when the disk is full or the file is gone.
  void append(const Keyframe& keyframe);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Calls `visit` with every keyframe in order of time. Throws std::runtime_error when the file
/// cannot be read. Returns the number of keyframes.
std::uint64_t read_keyframes(const std::string& file,
                             const std::function<void(const Keyframe&)>& visit);

}  // namespace trigpoint::lio_mapper
