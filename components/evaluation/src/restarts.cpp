// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "restarts.hpp"

#include "session_data.hpp"
#include "table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

constexpr double kGapIntervals = 1.5;

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

std::vector<MissedScans> find_missed_scans(const std::vector<exporter::LoggedScan>& scans) {
  std::vector<double> intervals_s;
  for (std::size_t i = 1; i < scans.size(); ++i) {
    intervals_s.push_back(to_seconds(scans[i].status.stamp_ns - scans[i - 1].status.stamp_ns));
  }
  if (intervals_s.empty()) {
    return {};
  }
  std::vector<double> sorted = intervals_s;
  std::nth_element(sorted.begin(),
                   sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const double usual_s = sorted[sorted.size() / 2];
  std::vector<MissedScans> missed;
  for (std::size_t i = 0; i < intervals_s.size(); ++i) {
    if (usual_s > 0.0 && intervals_s[i] > kGapIntervals * usual_s) {
      missed.push_back({scans[i].status.stamp_ns,
                        scans[i + 1].status.stamp_ns,
                        static_cast<std::uint64_t>(std::llround(intervals_s[i] / usual_s)) - 1});
    }
  }
  return missed;
}

std::string print_restarts(const SessionData& data) {
  if (data.restarts.empty()) {
    return "";
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
  text += table.str() + "\n";
  const std::vector<MissedScans> missed = find_missed_scans(data.scans);
  std::uint64_t sum = 0;
  std::string list;
  for (const MissedScans& gap : missed) {
    sum += gap.scans;
    list += "- " + std::to_string(gap.scans) + " between " + exporter::stamp_text(gap.after_ns) +
            " and " + exporter::stamp_text(gap.before_ns) + " (" +
            fixed(to_seconds(gap.before_ns - gap.after_ns), 2) + " s)\n";
  }
  return text + "Scans missed: " + std::to_string(sum) + (list.empty() ? ".\n" : "\n\n" + list) +
         "\n";
}

}  // namespace trigpoint::evaluation
