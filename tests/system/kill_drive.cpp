// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "kill_drive.hpp"

#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/participant_of.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/evaluation/trajectory_error.hpp"
#include "trigpoint/export/session.hpp"

#include "run_command.hpp"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <regex>
#include <set>
#include <stdexcept>
#include <thread>

namespace trigpoint::tests {

namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;
namespace topics = bus::topics;

constexpr auto kPause = 500ms;    ///< shorter than a supervisor's patience (--still)
constexpr auto kHangFound = 25s;  ///< more than any watchdog's patience
constexpr auto kFirstWord = 120s;
constexpr auto kReport = 300s;

/// When each process said something.
class Ear {
 public:
  Ear() : participant_(bus::Config{}, "kill_drive") {
    listen(kMapper, topics::lio_odometry);
    listen(kFilter, topics::gps_odometry);
    listen(kGate, topics::fusion_odometry);
  }

  Words words() {
    const std::scoped_lock lock(mutex_);
    return words_;
  }

  bool heard(const std::string& process) {
    const std::scoped_lock lock(mutex_);
    return !words_[process].empty();
  }

 private:
  void listen(const std::string& process, const bus::Topic<nav_msgs::msg::Odometry>& topic) {
    subscriptions_.push_back(std::make_unique<bus::Subscription<nav_msgs::msg::Odometry>>(
        participant_,
        topic,
        [this, process](const nav_msgs::msg::Odometry& odometry, const bus::MessageInfo& info) {
          const std::scoped_lock lock(mutex_);
          words_[process].push_back({Clock::now(),
                                     bus::from_message(odometry.header().stamp()),
                                     bus::participant_of(info.writer_guid)});
        }));
  }

  std::mutex mutex_;
  Words words_;
  bus::Participant participant_;
  std::vector<std::unique_ptr<bus::Subscription<nav_msgs::msg::Odometry>>> subscriptions_;
};

pid_t number_of(const std::string& session, const std::string& process) {
  std::ifstream file(session + "/logs/" + process + ".pid");
  pid_t pid = 0;
  file >> pid;
  return pid;
}

/// Files in /dev/shm that a process has mapped: what it would leave there when it is killed. (The
/// folder itself also holds what others on this computer leave.)
std::set<std::string> shared_memory_of(pid_t pid) {
  std::set<std::string> names;
  std::ifstream maps("/proc/" + std::to_string(pid) + "/maps");
  for (std::string line; std::getline(maps, line);) {
    if (const auto at = line.find("/dev/shm/"); at != std::string::npos) {
      names.insert(line.substr(at));
    }
  }
  return names;
}

/// Strikes and waits until the successor's number is known, or the pause is over.
Struck strike(const Blow& blow, const std::string& session) {
  const pid_t pid = number_of(session, blow.process);
  if (pid <= 0) {
    throw std::runtime_error("no process number of " + blow.process);
  }
  Struck struck{blow, Clock::now(), {}, false, shared_memory_of(pid)};
  kill(pid, blow.kind == Kind::kKill ? SIGKILL : SIGSTOP);
  if (blow.kind == Kind::kPause) {
    std::this_thread::sleep_for(kPause);
    kill(pid, SIGCONT);
    struck.returned = Clock::now();
    return struck;
  }
  const auto deadline = Clock::now() + kHangFound;
  pid_t now = pid;
  while (Clock::now() < deadline && (now == pid || now == 0)) {
    std::this_thread::sleep_for(10ms);
    now = number_of(session, blow.process);
  }
  struck.returned = Clock::now();
  struck.restarted = now != pid;
  return struck;
}

double listed_in(const std::string& report) {
  std::smatch found;
  return std::regex_search(report, found, std::regex("Scans missed: ([0-9]+)"))
             ? std::stod(found[1])
             : 0.0;
}

std::uint64_t points_of_map(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  for (std::string line; std::getline(in, line) && !line.starts_with("DATA");) {
    if (line.starts_with("POINTS ")) {
      return std::stoull(line.substr(7));
    }
  }
  return 0;
}

void score(const std::string& session,
           const std::vector<Struck>& struck,
           const Words& words,
           DriveResult& result) {
  const auto truth = exporter::read_trajectory(session + "/truth.tum");
  const auto against_truth = [&](const char* name) {
    return evaluation::associate(exporter::read_trajectory(session + "/" + name), truth);
  };
  const auto fused = against_truth("fused.tum");
  const auto error = evaluation::absolute_error(fused.pairs).position_m;
  result.rmse_m = error.rmse;
  result.worst_m = error.max;
  result.smoothed_rmse_m =
      evaluation::absolute_error(against_truth("fused_smoothed.tum").pairs).position_m.rmse;
  result.truth_s = to_seconds(truth.back().stamp_ns - truth.front().stamp_ns);
  result.covered_s = fused.coverage.whole * result.truth_s;
  for (const Struck& one : struck) {
    result.blows.push_back(judge_blow(one, words, truth.back().stamp_ns, fused.pairs));
    result.left_in_shared_memory.insert(one.shared_memory.begin(), one.shared_memory.end());
  }
  result.map_points = points_of_map(session + "/map.pcd");
  result.scans_done = exporter::read_trajectory(session + "/lio.tum").size();
  for (const NamedCount& count : exporter::read_counts(session + "/log.counts.yaml")) {
    result.scans_played = count.name == "points.published" ? count.count : result.scans_played;
  }
  result.scans_listed = static_cast<std::uint64_t>(listed_in(read_file(session + "/report.md")));
}

}  // namespace

const char* name_of(Kind kind) {
  return kind == Kind::kKill ? "kill -9" : kind == Kind::kPause ? "stop 0.5 s" : "hang";
}

DriveResult drive(const DriveSettings& settings, const std::vector<Blow>& blows) {
  setenv("ROS_DOMAIN_ID", settings.domain.c_str(), 1);
  Ear ear;
  std::vector<std::string> arguments{std::string(TRIGPOINT_SOURCE_DIR) + "/bringup/run",
                                     settings.scenario,
                                     "--no-build",
                                     "--rate",
                                     settings.rate,
                                     "--seed",
                                     std::to_string(settings.seed),
                                     "--duration",
                                     std::to_string(settings.duration_s),
                                     "--out",
                                     settings.session};
  arguments.insert(arguments.end(), settings.more_arguments.begin(), settings.more_arguments.end());
  Command job(arguments, {{"TRIGPOINT_BIN", TRIGPOINT_BIN_DIR}});
  const auto give_up = Clock::now() + kFirstWord;
  while (!ear.heard(kFilter) && job.running() && Clock::now() < give_up) {
    std::this_thread::sleep_for(10ms);
  }
  const Clock::time_point began = Clock::now();
  std::vector<Struck> struck;
  for (const Blow& blow : blows) {
    std::this_thread::sleep_until(began + std::chrono::duration_cast<Clock::duration>(
                                              std::chrono::duration<double>(blow.at_s)));
    if (job.running()) {
      struck.push_back(strike(blow, settings.session));
    }
  }
  const auto rest = std::chrono::duration_cast<std::chrono::seconds>(
      std::chrono::duration<double>(settings.duration_s));
  const CommandResult ended = job.wait(rest + kReport);
  DriveResult result;
  result.exit_code = ended.exit_code;
  result.output = ended.output;
  score(settings.session, struck, ear.words(), result);
  return result;
}

}  // namespace trigpoint::tests
