// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <fstream>
#include <string>

namespace trigpoint::exporter {

/// A binary file that gets its name in finish(): one that is there is whole. It is open only while
/// something is appended, so that thousands of tiles can be written side by side. Throws
/// std::runtime_error naming the file and the cause.
class PartFile {
 public:
  PartFile(const std::string& file, const std::string& head);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  void append(const char* bytes, std::size_t count);
  /// `head` takes the place of the first one and has its length.
  void finish(const std::string& head);

  const std::string& file() const { return file_; }

 private:
  void write(std::ios::openmode mode, const char* bytes, std::size_t count);

  std::string file_;
  std::string part_;
  bool finished_{false};
};

}  // namespace trigpoint::exporter
