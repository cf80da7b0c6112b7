// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "stillness.hpp"

#include <fstream>
#include <sstream>
#include <string>

namespace trigpoint::supervisor {

namespace {

struct Look {
  char state{'?'};  ///< R runs or could, S sleeps, D waits for a device, T is stopped
  unsigned long long used_ticks{0};
};

/// proc(5), /proc/PID/task/TID/stat. The name, which may hold anything, ends with the last ')'.
std::optional<Look> look_at(pid_t program) {
  const std::string number = std::to_string(program);
  std::ifstream file("/proc/" + number + "/task/" + number + "/stat");
  std::string line;
  std::getline(file, line);
  const auto name_end = line.rfind(')');
  if (name_end == std::string::npos) {
    return std::nullopt;
  }
  std::istringstream fields(line.substr(name_end + 1));
  Look look;
  fields >> look.state;
  constexpr int kBetween = 10;  // fields 4 to 13, before utime and stime
  std::string skipped;
  for (int i = 0; i < kBetween; ++i) {
    fields >> skipped;
  }
  unsigned long long user_ticks = 0;
  unsigned long long system_ticks = 0;
  fields >> user_ticks >> system_ticks;
  look.used_ticks = user_ticks + system_ticks;
  return fields ? std::optional(look) : std::nullopt;
}

}  // namespace

int Stillness::looks_at(pid_t program) {
  const std::optional<Look> look = look_at(program);
  const bool is_still = look && (look->state == 'S' || look->state == 'T') &&
                        (!used_ticks_ || *used_ticks_ == look->used_ticks);
  looks_ = is_still ? looks_ + 1 : 0;
  used_ticks_ = look ? std::optional(look->used_ticks) : std::nullopt;
  return looks_;
}

}  // namespace trigpoint::supervisor
