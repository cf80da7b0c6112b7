// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include "part_file.hpp"

#include <cstdint>
#include <string>

namespace trigpoint::exporter {

/// Binary PCD 0.7 with x y z intensity, written as it comes, since PCL's own writer wants the whole
/// cloud in memory.
class PcdWriter {
 public:
  /// `frame` is told in a comment of the header; empty: nothing is told.
  explicit PcdWriter(const std::string& file, const std::string& frame = "");

  void append(const PointCloud& points);
  /// Returns the number of points written.
  std::uint64_t finish();

 private:
  std::string header() const;

  std::string frame_;
  std::uint64_t points_{0};
  PartFile file_;
};

}  // namespace trigpoint::exporter
