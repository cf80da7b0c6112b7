// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "restarts.hpp"

#include "session_data.hpp"
#include "table.hpp"

#include <array>
#include <ctime>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

std::string local_time(std::int64_t unix_s) {
  const std::time_t seconds = unix_s;
  std::tm local{};
  localtime_r(&seconds, &local);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%H:%M:%S", &local);
  return text.data();
}

std::string without_quotes(const std::string& text) {
  return text.size() >= 2 && text.front() == '"' ? text.substr(1, text.size() - 2) : text;
}

}  // namespace

std::vector<Restart> read_restarts(const std::string& file) {
  std::ifstream in(file);
  std::vector<Restart> restarts;
  std::string line;
  std::getline(in, line);  // names of the columns
  for (int number = 2; std::getline(in, line); ++number) {
    std::istringstream cells(line);
    Restart restart;
    char comma{};
    int restarted = 0;
    const bool whole = cells >> restart.unix_s >> comma &&
                       std::getline(cells, restart.program, ',') &&
                       cells >> restarted >> comma >> restart.lived_s >> comma &&
                       std::getline(cells, restart.what);
    if (!whole) {
      throw std::runtime_error(file + ":" + std::to_string(number) + ": not a line of restarts");
    }
    restart.restarted = restarted != 0;
    restart.what = without_quotes(restart.what);
    restarts.push_back(restart);
  }
  return restarts;
}

std::string print_restarts(const SessionData& data, const std::vector<MissedScans>& missed) {
  if (data.restarts.empty()) {
    return missed.empty() ? "" : "## Scans missed\n\n" + print_missed(data, missed) + "\n";
  }
  std::string text =
      "## Restarts\n\n**Processes failed in the middle of the drive**; what each said is in "
      "logs/.\n\n";
  Table table({"time", "program", "had run, s", "what happened", "then"});
  for (const Restart& restart : data.restarts) {
    table.add({local_time(restart.unix_s),
               restart.program,
               fixed(restart.lived_s, 1),
               restart.what,
               restart.restarted ? "started again" : "given up"});
  }
  return text + table.str() + "\n" + print_missed(data, missed) + "\n";
}

}  // namespace trigpoint::evaluation
