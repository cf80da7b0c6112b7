// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "alive_check.hpp"

#include "trigpoint/bus/config.hpp"

#include "process_heard.hpp"
#include "program_name.hpp"

#include <chrono>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <set>
#include <sstream>

namespace trigpoint::cli {

namespace {

std::set<unsigned> processes_of(const std::string& program) {
  std::set<unsigned> found;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") == std::string::npos) {
      const auto number = static_cast<unsigned>(std::stoul(name));
      if (program_of(number) == program) {
        found.insert(number);
      }
    }
  }
  return found;
}

std::string list_of(const std::set<unsigned>& numbers) {
  std::string list;
  for (const unsigned number : numbers) {
    list += (list.empty() ? "" : ", ") + std::to_string(number);
  }
  return list;
}

std::string seconds_text(double seconds) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << seconds << " s";
  return text.str();
}

}  // namespace

int check_alive(const SystemConfig& config, const std::string& program, double patience_s) {
  const std::string domain = "DDS domain " + std::to_string(bus::domain_of(config.bus));
  const std::set<unsigned> processes = processes_of(program);
  if (processes.empty()) {
    std::cerr << "trigpoint doctor: no " << program << " runs here\n";
    return 1;
  }
  const auto begin = std::chrono::steady_clock::now();
  if (!recording::is_heard(config.bus, processes, patience_s)) {
    std::cerr << "trigpoint doctor: " << program << " (process " << list_of(processes)
              << ") runs, but said nothing on " << domain << " within " << seconds_text(patience_s)
              << ": it hangs, is still starting, or is on another domain or network interface\n";
    return 1;
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  std::cout << program << " (process " << list_of(processes) << ") was heard on " << domain
            << " after " << seconds_text(took.count()) << "\n";
  return 0;
}

}  // namespace trigpoint::cli
