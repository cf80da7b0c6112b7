// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/export/session.hpp"

#include <cstdint>
#include <string>

namespace trigpoint::exporter {

/// Appends whole lines with one write(2) each: what was appended survives the death of the process.
class LineFile {
 public:
  /// A new or empty file begins with `head` (which ends with a newline).
  LineFile(const std::string& file, const std::string& head, Opening opening);
  ~LineFile();
  LineFile(const LineFile&) = delete;
  LineFile& operator=(const LineFile&) = delete;

  void append(const std::string& line_with_newline);

 private:
  void continue_after_last_whole_line();

  std::string file_;
  int descriptor_{-1};
  std::int64_t size_{0};
};

/// "FILE: cannot WHAT: cause" from errno.
[[noreturn]] void throw_errno(const std::string& file, const std::string& what);

}  // namespace trigpoint::exporter
