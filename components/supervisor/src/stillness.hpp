// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <sys/types.h>

#include <optional>

namespace trigpoint::supervisor {

/// Looks at a program's main thread from outside. One that computes, waits for a processor or for
/// the disk may just be late; one that is stopped, or sleeps although it should long have spoken,
/// will not speak.
class Stillness {
 public:
  /// Looks again. How many looks in a row, this one too, have found it stopped or asleep with no
  /// processor time used since the look before; 0: it runs, or cannot be looked at.
  int looks_at(pid_t program);

  void forget() { *this = {}; }

 private:
  std::optional<unsigned long long> used_ticks_;
  int looks_{0};
};

}  // namespace trigpoint::supervisor
