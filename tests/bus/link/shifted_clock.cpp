// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Preloaded into a program, it shifts the wall clock that this sees by SHIFTED_CLOCK_S seconds: a
// second computer whose clock is wrong. Time that only runs (CLOCK_MONOTONIC) stays as it is.
// Waiting until a moment of the wall clock is shifted back, since the kernel knows the true one.
#include <pthread.h>
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

extern "C" int pthread_cond_timedwait(pthread_cond_t* condition,
                                      pthread_mutex_t* mutex,
                                      const timespec* until) {
  // Which clock a condition variable was made for cannot be asked; time since boot is far smaller.
  constexpr time_t kYears = 1'000'000'000;
  timespec moment = *until;
  const bool is_wall_clock = moment.tv_sec > kYears;
  moment.tv_sec -= is_wall_clock ? shift_s() : 0;
  return pthread_cond_clockwait(
      condition, mutex, is_wall_clock ? CLOCK_REALTIME : CLOCK_MONOTONIC, &moment);
}
