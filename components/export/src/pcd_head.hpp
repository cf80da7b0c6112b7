// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::exporter {

/// What a PCD file says of itself. PCL's reader of heads makes room for all points.
struct PcdHead {
  struct Field {
    std::string name;
    std::size_t offset{0};  ///< bytes from the start of the point
    bool is_float32{false};
  };

  std::vector<Field> fields;
  std::size_t point_bytes{0};
  std::uint64_t points{0};
  std::string storage;  ///< ascii, binary or binary_compressed
  std::uint64_t data_begin{0};

  /// Offset of a float32 field; -1 when there is none.
  int offset_of(const std::string& name) const;
};

/// Throws std::runtime_error naming the file when it is none.
PcdHead read_pcd_head(const std::string& file);

}  // namespace trigpoint::exporter
