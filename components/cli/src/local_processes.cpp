// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "local_processes.hpp"

#include "program_name.hpp"
#include <unistd.h>

#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

namespace trigpoint::cli {

namespace {

std::string proc(unsigned number, const std::string& file) {
  return "/proc/" + std::to_string(number) + "/" + file;
}

struct Stat {
  char state{'?'};
  double started_s{0.0};  ///< since the computer was
};

/// man 5 proc; the program's name, in brackets, may hold anything.
std::optional<Stat> stat_of(unsigned number) {
  std::ifstream file(proc(number, "stat"));
  std::string line;
  std::getline(file, line);
  const std::size_t bracket = line.rfind(')');
  if (bracket == std::string::npos) {
    return std::nullopt;
  }
  std::istringstream rest(line.substr(bracket + 1));
  Stat stat;
  rest >> stat.state;
  constexpr int kFieldsBeforeStart = 18;  // from the fourth to the 21st
  std::string skipped;
  for (int i = 0; i < kFieldsBeforeStart; ++i) {
    rest >> skipped;
  }
  double ticks = 0.0;
  if (!(rest >> ticks)) {
    return std::nullopt;
  }
  stat.started_s = ticks / static_cast<double>(::sysconf(_SC_CLK_TCK));
  return stat;
}

double uptime_s() {
  std::ifstream file("/proc/uptime");
  double seconds = 0.0;
  file >> seconds;
  return seconds;
}

std::optional<std::string> domain_of_process(unsigned number) {
  std::ifstream file(proc(number, "environ"), std::ios::binary);
  if (!file) {
    return std::nullopt;
  }
  const std::string name = "ROS_DOMAIN_ID=";
  for (std::string variable; std::getline(file, variable, '\0');) {
    if (variable.starts_with(name)) {
      return variable.substr(name.size());
    }
  }
  return "";
}

bool is_of_interest(const std::string& program) {
  return program.starts_with("trigpoint_gps_") || program == "trigpoint_lio_mapper" ||
         program == "trigpoint_fusion_gate" || program == "trigpoint_clock_watch";
}

}  // namespace

std::vector<LocalProcess> local_processes() {
  std::vector<LocalProcess> found;
  const double now_s = uptime_s();
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    unsigned number = 0;
    const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (error != std::errc{} || end != name.data() + name.size()) {
      continue;
    }
    const std::string program = program_of(number);
    const auto stat = is_of_interest(program) ? stat_of(number) : std::nullopt;
    if (stat && stat->state != 'Z') {
      found.push_back(
          {number, program, stat->state, now_s - stat->started_s, domain_of_process(number)});
    }
  }
  return found;
}

}  // namespace trigpoint::cli
