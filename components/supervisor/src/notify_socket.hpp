// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <optional>
#include <string>

namespace trigpoint::supervisor {

/// Where a program's sd_notify(3) datagrams come in. Its name lives in the kernel: no file is left.
class NotifySocket {
 public:
  /// Throws std::runtime_error.
  NotifySocket();
  ~NotifySocket();
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  const std::string& address() const { return address_; }  ///< for NOTIFY_SOCKET

  int descriptor() const { return socket_; }

  struct Heard {
    bool anything{false};
    bool stopping{false};
    std::optional<double> watchdog_s;  ///< another one is asked for
  };

  /// What has come since the last call.
  Heard take() const;

 private:
  std::string address_;
  int socket_{-1};
};

}  // namespace trigpoint::supervisor
