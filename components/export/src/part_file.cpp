// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "part_file.hpp"

#include "line_file.hpp"

#include <cerrno>
#include <cstdio>

namespace trigpoint::exporter {

PartFile::PartFile(const std::string& file, const std::string& head)
    : file_(file), part_(file + ".part") {
  try {
    write(std::ios::binary | std::ios::trunc, head.data(), head.size());
  } catch (...) {
    std::remove(part_.c_str());  // no destructor will
    throw;
  }
}

PartFile::~PartFile() {
  if (!finished_) {
    std::remove(part_.c_str());
  }
}

void PartFile::write(std::ios::openmode mode, const char* bytes, std::size_t count) {
  errno = 0;
  std::ofstream out(part_, mode);
  if (!out) {
    throw_errno(file_, "open for writing");
  }
  out.write(bytes, static_cast<std::streamsize>(count));
  out.close();
  if (!out) {
    throw_errno(file_, "write");
  }
}

void PartFile::append(const char* bytes, std::size_t count) {
  write(std::ios::binary | std::ios::app, bytes, count);
}

void PartFile::finish(const std::string& head) {
  write(std::ios::binary | std::ios::in, head.data(), head.size());
  if (std::rename(part_.c_str(), file_.c_str()) != 0) {
    throw_errno(file_, "replace");
  }
  finished_ = true;
}

}  // namespace trigpoint::exporter
