// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "disk_reserve.hpp"

#include "trigpoint/recording/log.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace trigpoint::recording {

DiskReserve::DiskReserve(std::string name) : name_(std::move(name)) {}

DiskReserve::~DiskReserve() {
  release();
}

void DiskReserve::hold(std::uint64_t bytes) {
  if (bytes <= bytes_) {
    return;
  }
  if (file_ < 0) {
    file_ = ::open(name_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (file_ >= 0) {
      ::unlink(name_.c_str());
    }
  }
  const int error = file_ < 0 ? errno : ::posix_fallocate(file_, 0, static_cast<off_t>(bytes));
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) {
    throw LogError(name_ + ": " + std::to_string(bytes) +
                   " bytes can't be kept free for the end: " + std::strerror(error));
  }
  bytes_ = bytes;  // where a file system refuses for another reason there is no reserve
}

void DiskReserve::release() {
  if (file_ >= 0) {
    ::close(std::exchange(file_, -1));
  }
}

}  // namespace trigpoint::recording
