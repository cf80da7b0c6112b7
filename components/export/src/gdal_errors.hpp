// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>

namespace trigpoint::exporter {

/// While it lives GDAL prints nothing and is ready to be used, and what it reported can be asked.
class GdalErrors {
 public:
  GdalErrors();
  ~GdalErrors();
  GdalErrors(const GdalErrors&) = delete;
  GdalErrors& operator=(const GdalErrors&) = delete;

  /// Throws "FILE: cannot WHAT: GDAL's words" when `done` is false or GDAL reported a failure.
  static void check(bool done, const std::string& file, const std::string& what);
};

/// The name under which a file is made, with the same extension, and its end: renamed in commit(),
/// removed without.
class GdalTarget {
 public:
  explicit GdalTarget(const std::string& file);
  ~GdalTarget();
  GdalTarget(const GdalTarget&) = delete;
  GdalTarget& operator=(const GdalTarget&) = delete;

  const std::string& part() const { return part_; }

  void commit();

 private:
  std::string file_;
  std::string part_;
};

}  // namespace trigpoint::exporter
