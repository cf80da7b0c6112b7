// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "line_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

namespace trigpoint::exporter {

namespace {

constexpr mode_t kReadableByAll = 0644;

/// Bytes written; fewer than asked for with errno set when the system takes no more.
std::size_t write_all(int descriptor, const std::string& text) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t n = ::write(descriptor, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n <= 0) {
      break;
    }
    done += static_cast<std::size_t>(n);
  }
  return done;
}

}  // namespace

void throw_errno(const std::string& file, const std::string& what) {
  const int cause = errno;
  throw std::runtime_error(file + ": cannot " + what + ": " + std::strerror(cause));
}

LineFile::LineFile(const std::string& file, const std::string& head, Opening opening)
    : file_(file) {
  const int fresh = opening == Opening::kFresh ? O_TRUNC : 0;
  descriptor_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | fresh, kReadableByAll);
  if (descriptor_ < 0) {
    throw_errno(file_, "open for writing");
  }
  try {
    continue_after_last_whole_line();
    if (size_ == 0) {
      append(head);
    }
  } catch (...) {
    ::close(descriptor_);
    throw;
  }
}

LineFile::~LineFile() {
  ::close(descriptor_);
}

void LineFile::continue_after_last_whole_line() {
  const off_t end = ::lseek(descriptor_, 0, SEEK_END);
  size_ = end < 0 ? 0 : end;  // a pipe has no position
  char last = '\n';
  while (size_ > 0 && ::pread(descriptor_, &last, 1, size_ - 1) == 1 && last != '\n') {
    --size_;
  }
  if (size_ == end || end < 0) {
    return;
  }
  if (::ftruncate(descriptor_, size_) != 0 || ::lseek(descriptor_, size_, SEEK_SET) < 0) {
    throw_errno(file_, "continue");
  }
}

void LineFile::append(const std::string& line_with_newline) {
  if (write_all(descriptor_, line_with_newline) == line_with_newline.size()) {
    size_ += static_cast<std::int64_t>(line_with_newline.size());
    return;
  }
  const int cause = errno;
  // A torn line would make the whole file invalid: take it back. Its own failure changes nothing
  // (devices such as /dev/full cannot be cut).
  if (::ftruncate(descriptor_, size_) == 0) {
    ::lseek(descriptor_, size_, SEEK_SET);
  }
  errno = cause;
  throw_errno(file_, "write");
}

}  // namespace trigpoint::exporter
