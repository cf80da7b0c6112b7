// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "notify_socket.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string_view>

namespace trigpoint::supervisor {

/// The kernel chooses the name: one made of our process number would be everybody's in containers,
/// which share the host's network, and with it these names, but number their processes from 1.
NotifySocket::NotifySocket()
    : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
  sockaddr_un own{};
  own.sun_family = AF_UNIX;
  socklen_t size = sizeof(sa_family_t);
  if (socket_ < 0 || ::bind(socket_, reinterpret_cast<sockaddr*>(&own), size) != 0) {
    throw std::runtime_error(std::string("cannot listen to the program's notices: ") +
                             std::strerror(errno));
  }
  size = sizeof own;
  ::getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size);
  address_ = "@" + std::string(own.sun_path + 1, size - offsetof(sockaddr_un, sun_path) - 1);
}

NotifySocket::~NotifySocket() {
  ::close(socket_);
}

NotifySocket::Heard NotifySocket::take() const {
  Heard heard;
  std::array<char, 512> text{};
  for (;;) {
    const ssize_t size = ::recv(socket_, text.data(), text.size(), 0);
    if (size < 0) {
      return heard;
    }
    heard.anything = true;
    const std::string_view words(text.data(), static_cast<std::size_t>(size));
    constexpr std::string_view kWatchdog = "WATCHDOG_USEC=";
    if (const auto at = words.find(kWatchdog); at != std::string_view::npos) {
      heard.watchdog_s =
          1e-6 * std::strtod(std::string(words.substr(at + kWatchdog.size())).c_str(), nullptr);
    }
    heard.stopping = heard.stopping || words.find("STOPPING=1") != std::string_view::npos;
  }
}

}  // namespace trigpoint::supervisor
