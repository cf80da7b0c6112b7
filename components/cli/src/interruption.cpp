// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "interruption.hpp"

#include <unistd.h>

namespace trigpoint::cli {

namespace {

// A signal handler has no argument of its own: set before it is installed, only read by it.
std::string words_of_handler;

void end_here(int /*signal*/) {
  // Only what is safe in a handler.
  [[maybe_unused]] const ssize_t written =
      write(STDERR_FILENO, words_of_handler.data(), words_of_handler.size());
  _exit(kInterrupted);
}

}  // namespace

LastWords::LastWords(const std::string& last_words) {
  words_of_handler = last_words;

  struct sigaction action {};

  action.sa_handler = end_here;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, &previous_interrupt_);
  sigaction(SIGTERM, &action, &previous_terminate_);
}

LastWords::~LastWords() {
  sigaction(SIGINT, &previous_interrupt_, nullptr);
  sigaction(SIGTERM, &previous_terminate_, nullptr);
}

}  // namespace trigpoint::cli
