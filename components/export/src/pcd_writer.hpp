// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <cstdint>
#include <fstream>
#include <string>

namespace trigpoint::exporter {

/// Binary PCD 0.7 with x y z intensity, written as it comes, since PCL's own writer wants the whole
/// cloud in memory. The file gets its name in finish(): one that is there is whole.
class PcdWriter {
 public:
  /// `frame` is told in a comment of the header; empty: nothing is told.
  explicit PcdWriter(const std::string& file, const std::string& frame = "");
  ~PcdWriter();
  PcdWriter(const PcdWriter&) = delete;
  PcdWriter& operator=(const PcdWriter&) = delete;

  void append(const PointCloud& points);
  /// Returns the number of points written.
  std::uint64_t finish();

 private:
  std::string header() const;
  void check(const std::string& what);

  std::string file_;
  std::string part_;
  std::string frame_;
  std::ofstream out_;
  std::uint64_t points_{0};
  bool finished_{false};
};

}  // namespace trigpoint::exporter
