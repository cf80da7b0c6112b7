// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <csignal>

namespace trigpoint::shell {

/// Ctrl-C for programs that work through a log: SIGINT and SIGTERM are held back from construction
/// on, and asked for between two pieces of work. Make it before any thread.
class StopSignal {
 public:
  StopSignal();
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  /// One of the two has come.
  bool requested() const;

 private:
  sigset_t signals_{};
  sigset_t previous_{};
};

}  // namespace trigpoint::shell
