// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cstdint>
#include <string>

namespace trigpoint::recording {

/// Room on the disk that belongs to nobody else until it is given back: a file without a name,
/// which also vanishes with a killed process.
class DiskReserve {
 public:
  /// `name` is the file's until it has none; nothing may be there.
  explicit DiskReserve(std::string name);
  ~DiskReserve();
  DiskReserve(const DiskReserve&) = delete;
  DiskReserve& operator=(const DiskReserve&) = delete;

  /// Throws LogError when the disk has not so much left.
  void hold(std::uint64_t bytes);
  void release();

 private:
  std::string name_;
  int file_{-1};
  std::uint64_t bytes_{0};
};

}  // namespace trigpoint::recording
