// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <csignal>
#include <string>

namespace trigpoint::cli {

/// Exit code of a run that the user stopped (SIGINT or SIGTERM), as a shell has it for Ctrl-C.
inline constexpr int kInterrupted = 130;

/// Thrown out of a work's progress when the user stops it: files that are not whole go on the way.
struct Interrupted {};

/// While it lives, SIGINT and SIGTERM write `last_words` to standard error and end the program with
/// kInterrupted: for the end of a run, when what counts is on the disk already. One at a time.
class LastWords {
 public:
  explicit LastWords(const std::string& last_words);
  ~LastWords();
  LastWords(const LastWords&) = delete;
  LastWords& operator=(const LastWords&) = delete;

 private:
  struct sigaction previous_interrupt_ {};

  struct sigaction previous_terminate_ {};
};

}  // namespace trigpoint::cli
