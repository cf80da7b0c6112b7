// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <chrono>
#include <string>

namespace trigpoint::shell {

/// Tells a supervisor (systemd with Type=notify, or trigpoint_supervise) how this program is doing:
/// the datagrams of sd_notify(3) to the socket that NOTIFY_SOCKET names. Without one it does
/// nothing. To be used on the thread whose hanging is to be found out.
class ServiceNotice {
 public:
  /// How often alive() is said; supervisors wait for several of them (bringup/run: --still).
  static constexpr std::chrono::milliseconds kPeriod{200};

  ServiceNotice();
  ~ServiceNotice();
  ServiceNotice(const ServiceNotice&) = delete;
  ServiceNotice& operator=(const ServiceNotice&) = delete;

  void ready() const { send("READY=1\nWATCHDOG=1"); }

  void alive() const { send("WATCHDOG=1"); }

  /// From now on silence may last this long before it counts as hanging. Nothing is asked of a
  /// supervisor that does not watch (no WATCHDOG_USEC), nor less than it allows anyhow.
  void allow_silence(std::chrono::microseconds longest) const;

  /// As before allow_silence().
  void allow_usual_silence() const { allow_silence(usual_silence_); }

  /// What follows may take long.
  void stopping() const { send("STOPPING=1"); }

 private:
  void send(const std::string& text) const;

  std::string address_;  ///< of the supervisor; empty: none
  int socket_{-1};
  std::chrono::microseconds usual_silence_{0};  ///< the supervisor's; 0: it does not watch
};

}  // namespace trigpoint::shell
