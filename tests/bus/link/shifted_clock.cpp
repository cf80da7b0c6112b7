// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Preloaded into a program, it shifts the wall clock that this sees by SHIFTED_CLOCK_S seconds: a
// second computer whose clock is wrong. Time that only runs (CLOCK_MONOTONIC) stays as it is.
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <cstdlib>
#include <ctime>

namespace {

long shift_s() {
  static const char* text = std::getenv("SHIFTED_CLOCK_S");
  static const long seconds = text == nullptr ? 0 : std::strtol(text, nullptr, 10);
  return seconds;
}

}  // namespace

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const auto result = static_cast<int>(syscall(SYS_clock_gettime, clock, time));
  if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
    time->tv_sec += shift_s();
  }
  return result;
}

extern "C" int gettimeofday(timeval* time, void*) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  time->tv_sec = now.tv_sec;
  time->tv_usec = now.tv_nsec / 1000;
  return 0;
}

extern "C" time_t time(time_t* out) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (out != nullptr) {
    *out = now.tv_sec;
  }
  return now.tv_sec;
}
