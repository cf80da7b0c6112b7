// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "input_file.hpp"

#include "trigpoint/recording/log.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace trigpoint::recording {

namespace {

constexpr std::uint64_t kPage_bytes = 4096;

}  // namespace

InputFile::InputFile(const std::string& name)
    : name_(name), file_(::open(name.c_str(), O_RDONLY | O_CLOEXEC)) {
  struct stat status {};

  if (file_ < 0 || ::fstat(file_, &status) != 0) {
    throw LogError(name + ": cannot be opened: " + std::strerror(errno));
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

InputFile::~InputFile() {
  ::close(file_);
}

std::optional<std::vector<std::uint8_t>> InputFile::read(std::uint64_t begin,
                                                         std::uint64_t size) const {
  if (begin > size_ || size > size_ - begin) {
    return std::nullopt;
  }
  std::vector<std::uint8_t> bytes(size);
  return read_into(begin, bytes) ? std::optional(std::move(bytes)) : std::nullopt;
}

std::span<const std::uint8_t> InputFile::peek(std::uint64_t begin, std::size_t size) {
  const bool there = begin >= page_begin_ && begin + size <= page_begin_ + page_.size();
  if (!there) {
    page_.resize(begin < size_ ? std::min(kPage_bytes, size_ - begin) : 0);
    page_begin_ = begin;
    if (!read_into(begin, page_)) {
      page_.clear();
    }
  }
  const std::size_t at = begin - page_begin_;
  return std::span(page_).subspan(at, std::min(size, page_.size() - at));
}

bool InputFile::read_into(std::uint64_t begin, std::span<std::uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t got = ::pread(file_, bytes.data(), bytes.size(), static_cast<off_t>(begin));
    if (got < 0 && errno == EINTR) {
      continue;
    }
    if (got <= 0) {
      return false;
    }
    begin += static_cast<std::uint64_t>(got);
    bytes = bytes.subspan(static_cast<std::size_t>(got));
  }
  return true;
}

}  // namespace trigpoint::recording
