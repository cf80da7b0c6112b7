// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/shell/service_notice.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace trigpoint::shell {

ServiceNotice::ServiceNotice() {
  if (const char* watchdog_us = std::getenv("WATCHDOG_USEC"); watchdog_us != nullptr) {
    usual_silence_ = std::chrono::microseconds(std::strtoll(watchdog_us, nullptr, 10));
  }
  const char* named = std::getenv("NOTIFY_SOCKET");
  address_ = named == nullptr ? "" : named;
  const bool usable = (address_.starts_with('/') || address_.starts_with('@')) &&
                      address_.size() < sizeof(sockaddr_un::sun_path);
  if (usable) {
    socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  }
}

ServiceNotice::~ServiceNotice() {
  if (socket_ >= 0) {
    ::close(socket_);
  }
}

void ServiceNotice::allow_silence(std::chrono::microseconds longest) const {
  if (usual_silence_.count() > 0) {
    send("WATCHDOG_USEC=" + std::to_string(std::max(longest, usual_silence_).count()) +
         "\nWATCHDOG=1");
  }
}

/// A supervisor that does not listen must not disturb the program: failures are ignored.
void ServiceNotice::send(const std::string& text) const {
  if (socket_ < 0) {
    return;
  }
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, address_.data(), address_.size());
  if (address_.front() == '@') {
    to.sun_path[0] = '\0';  // a name in the kernel, without a file
  }
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  ::sendto(socket_, text.data(), text.size(), MSG_NOSIGNAL, reinterpret_cast<sockaddr*>(&to), size);
}

}  // namespace trigpoint::shell
