// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// An hour of driving through the three cores in one process, streamed and never held as a whole:
// is the resident memory flat, and is the session complete although the process was killed on the
// way? This program drives itself as a child, kills it, and resumes the session with a second one.
#include "trigpoint/export/session.hpp"
#include "trigpoint/pipeline/map_log.hpp"
#include "trigpoint/pipeline/session_parts.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <CLI/CLI.hpp>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using namespace trigpoint;
namespace fs = std::filesystem;

struct Options {
  std::string session;
  double duration_s{3600.0};
  double kill_s{1200.0};  ///< 0: not killed
  double report_s{120.0};
  double settle_s{600.0};  ///< before the slope counts, of each process
  std::int64_t azimuth_steps{450};
  std::uint64_t seed{1};
  bool child{false};
};

/// Few points, so that an hour is through in minutes; everything else as on a real drive.
simulator::Scenario scenario_of(const Options& options) {
  return simulator::load_scenario_text(
      "name: hour\n"
      "route: {type: figure_eight, length_m: 300.0, width_m: 160.0, speed_mps: 4.0, laps: 30}\n"
      "lidar: {model: vlp16, azimuth_steps: " +
          std::to_string(options.azimuth_steps) +
          "}\n"
          "imu: {rate_hz: 100.0}\n"
          "gnss: {gnss_class: fixed, rate_hz: 5.0, latency_s: 0.12}\n",
      "hour");
}

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  long total = 0;
  long resident = 0;
  statm >> total >> resident;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

/// The part of a drive that a checkpoint does not cover yet; tells the memory on the way.
class RestOfDrive final : public recording::LogReader {
 public:
  RestOfDrive(recording::LogReader& drive, Nanoseconds after_ns, double report_s)
      : drive_(drive),
        first_ns_(drive.summary().first_ns),
        after_ns_(after_ns),
        report_s_(report_s) {}

  const recording::LogSummary& summary() const override { return drive_.summary(); }

  double progress() const override { return drive_.progress(); }

  std::optional<recording::LogEntry> next() override {
    auto entry = drive_.next();
    while (entry && entry->receive_ns <= after_ns_) {
      entry = drive_.next();
    }
    if (entry) {
      report(to_seconds(entry->receive_ns - first_ns_));
    }
    return entry;
  }

 private:
  void report(double now_s) {
    if (now_s >= next_s_) {
      std::printf("%.1f %.2f\n", now_s, resident_mb());
      std::fflush(stdout);
      next_s_ = report_s_ * (std::floor(now_s / report_s_) + 1.0);
    }
  }

  recording::LogReader& drive_;
  Nanoseconds first_ns_;
  Nanoseconds after_ns_;
  double report_s_;
  double next_s_{0.0};
};

/// The last point of a sweep comes this long before its message: nothing is fed twice.
constexpr Nanoseconds kTransport_ns = 10'000'000;

pipeline::CoreConfigs configs_of(const simulator::Scenario& scenario) {
  pipeline::CoreConfigs configs;
  configs.robot = scenario.robot;
  configs.gps_odometry.use_configured_datum = true;
  configs.gps_odometry.datum_latitude_deg = scenario.datum.latitude_deg;
  configs.gps_odometry.datum_longitude_deg = scenario.datum.longitude_deg;
  configs.gps_odometry.datum_height_m = scenario.datum.height_m;
  return configs;
}

/// One process: begins the session, or goes on with it when there is one.
int drive(const Options& options) {
  const simulator::Scenario scenario = scenario_of(options);
  const auto reader = simulator::open_scenario(scenario, options.seed, options.duration_s);
  pipeline::MapLogOptions run;
  run.session = options.session;
  run.config_text = "# an hour\n";
  run.mode = "smooth";
  run.on_event = [](const Event& event) {
    if (event.severity != Severity::kInfo || event.code == "lio_resumed") {
      std::fprintf(stderr, "  %s: %s\n", event.code.c_str(), event.text.c_str());
    }
  };
  Nanoseconds after_ns = 0;
  if (pipeline::stored_checkpoint(options.session)) {
    run.use = pipeline::UseOfStored::kResume;
    run.stored = pipeline::open_stored_session(options.session);
    after_ns = run.stored->checkpoint.stamp_ns + kTransport_ns;
  }
  RestOfDrive rest(*reader, after_ns, options.report_s);
  const auto result = pipeline::map_log(rest, configs_of(scenario), run);
  std::fprintf(stderr, "  %.0f s of data in %.0f s\n", result.data_s, result.wall_s);
  return 0;
}

struct Sample {
  double time_s{0.0};
  double memory_mb{0.0};
};

/// Least squares, MB an hour, over what lies `settle_s` or more after the first sample.
double slope_mb_per_h(const std::vector<Sample>& samples, double settle_s) {
  double n = 0.0, t = 0.0, m = 0.0, tt = 0.0, tm = 0.0;
  for (const Sample& s : samples) {
    if (s.time_s - samples.front().time_s >= settle_s) {
      const double hours = s.time_s / 3600.0;
      n += 1.0;
      t += hours;
      m += s.memory_mb;
      tt += hours * hours;
      tm += hours * s.memory_mb;
    }
  }
  return (n * tm - t * m) / (n * tt - t * t);
}

/// Starts this program as a child, prints what it reports and kills it at `kill_s` (0: never).
/// Returns its samples.
std::vector<Sample> run_child(const Options& options, const std::string& program, double kill_s) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) {
    throw std::runtime_error("no pipe");
  }
  const std::vector<std::string> arguments{
      program,
      "--child",
      "--session=" + options.session,
      "--duration=" + std::to_string(options.duration_s),
      "--report=" + std::to_string(options.report_s),
      "--seed=" + std::to_string(options.seed),
      "--azimuth-steps=" + std::to_string(options.azimuth_steps)};
  std::vector<char*> pointers;
  for (const std::string& argument : arguments) {
    pointers.push_back(const_cast<char*>(argument.c_str()));
  }
  pointers.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    dup2(ends[1], STDOUT_FILENO);
    close(ends[0]);
    close(ends[1]);
    execv("/proc/self/exe", pointers.data());
    _exit(127);
  }
  close(ends[1]);
  std::vector<Sample> samples;
  bool killed = false;
  FILE* lines = fdopen(ends[0], "r");
  Sample sample;
  while (std::fscanf(lines, "%lf %lf", &sample.time_s, &sample.memory_mb) == 2) {
    std::printf("%7.0f s %8.1f MB\n", sample.time_s, sample.memory_mb);
    std::fflush(stdout);
    samples.push_back(sample);
    if (kill_s > 0.0 && sample.time_s >= kill_s) {
      kill(child, SIGKILL);
      killed = true;
      std::printf("killed\n");
      break;
    }
  }
  std::fclose(lines);
  int status = 0;
  waitpid(child, &status, 0);
  if (!killed && (!WIFEXITED(status) || WEXITSTATUS(status) != 0)) {
    throw std::runtime_error("the drive failed");
  }
  if (kill_s > 0.0 && !killed) {
    throw std::runtime_error("the drive ended before it was to be killed");
  }
  return samples;
}

/// Every keyframe of the store, with its cloud.
std::vector<std::uint64_t> ids_of(const std::string& session) {
  std::vector<std::uint64_t> ids;
  lio_mapper::read_keyframes(session + "/" + exporter::session_file::kKeyframes,
                             [&](const lio_mapper::Keyframe& k) { ids.push_back(k.id); });
  return ids;
}

/// Horizontal, of what was published online in map; m.
double fused_rmse_m(const Options& options) {
  const auto truth = simulator::make_truth(scenario_of(options), options.seed, options.duration_s);
  double sum = 0.0;
  double n = 0.0;
  for (const auto& [stamp_ns, pose] : exporter::read_trajectory(options.session + "/fused.tum")) {
    sum += (pose.p - truth->at(stamp_ns).T_map_base.p).head<2>().squaredNorm();
    n += 1.0;
  }
  return std::sqrt(sum / n);
}

class Checks {
 public:
  void expect(bool holds, const std::string& what) {
    std::printf("%s  %s\n", holds ? "ok  " : "FAIL", what.c_str());
    failed_ = failed_ || !holds;
  }

  bool failed() const { return failed_; }

 private:
  bool failed_{false};
};

void check_keyframes(const Options& options,
                     const lio_mapper::Checkpoint& last,
                     const std::vector<std::uint64_t>& at_kill,
                     Checks& checks) {
  const std::vector<std::uint64_t> ids = ids_of(options.session);
  const std::set<std::uint64_t> distinct(ids.begin(), ids.end());
  checks.expect(ids.size() == last.next_keyframe && distinct.size() == ids.size() &&
                    *distinct.rbegin() + 1 == last.next_keyframe,
                std::to_string(ids.size()) +
                    " keyframes read, each with its cloud; the mapper made " +
                    std::to_string(last.next_keyframe));
  checks.expect(std::all_of(at_kill.begin(),
                            at_kill.end(),
                            [&](std::uint64_t id) { return distinct.count(id) == 1; }),
                "those at the kill, " + std::to_string(at_kill.size()) + ", are still there");
}

void check_scans(const Options& options, const lio_mapper::Checkpoint& last, Checks& checks) {
  std::uint64_t refused = 0;
  for (const NamedCount& count : last.scans_refused) {
    refused += count.count;
  }
  const auto sweeps = static_cast<std::uint64_t>(std::llround(options.duration_s * 10.0));
  checks.expect(last.scans_used + refused == last.scans_received,
                std::to_string(last.scans_received) +
                    " scans received = " + std::to_string(last.scans_used) + " used + " +
                    std::to_string(refused) + " refused");
  // The last sweep of the drive may not be complete, and one may be in flight at the kill.
  checks.expect(last.scans_received + 2 >= sweeps && last.scans_received <= sweeps + 1,
                "the drive has " + std::to_string(sweeps) + " sweeps");
  const std::size_t poses = exporter::read_trajectory(options.session + "/lio.tum").size();
  checks.expect(poses >= last.scans_used && poses <= last.scans_used + 1,
                std::to_string(poses) + " poses in lio.tum");
}

int orchestrate(const Options& options, const std::string& program) {
  exporter::create_session_folder(options.session);
  if (pipeline::stored_checkpoint(options.session)) {
    throw std::runtime_error(options.session + " holds a session already");
  }
  std::vector<std::uint64_t> at_kill;
  std::optional<lio_mapper::Checkpoint> killed;
  Checks checks;
  const auto tell_slope = [&](const std::vector<Sample>& samples) {
    if (samples.empty() || samples.back().time_s - samples.front().time_s < options.settle_s) {
      return;
    }
    std::printf("slope after the first %.0f s: %+.1f MB an hour\n",
                options.settle_s,
                slope_mb_per_h(samples, options.settle_s));
  };
  if (options.kill_s > 0.0) {
    tell_slope(run_child(options, program, options.kill_s));
    killed = pipeline::stored_checkpoint(options.session);
    checks.expect(killed.has_value(), "there is a checkpoint after the kill");
    at_kill = ids_of(options.session);
    checks.expect(killed && at_kill.size() == killed->next_keyframe,
                  "all keyframes of the checkpoint at the kill are readable");
  }
  tell_slope(run_child(options, program, 0.0));
  const auto last = pipeline::stored_checkpoint(options.session);
  if (!last) {
    throw std::runtime_error("no checkpoint at the end");
  }
  check_keyframes(options, *last, at_kill, checks);
  check_scans(options, *last, checks);
  checks.expect(last->odom_epoch == (killed ? killed->odom_epoch : 0),
                "odom epoch " + std::to_string(last->odom_epoch));
  const std::string store = options.session + "/" + exporter::session_file::kKeyframes;
  const lio_mapper::CloudSizes stored = lio_mapper::KeyframeReader(store).cloud_sizes();
  std::printf("driven %.0f m; fused.tum off by %.3f m (rms, horizontal)\n",
              last->distance_m,
              fused_rmse_m(options));
  std::printf("keyframes.sqlite %.1f MB, its clouds %.1f MB, %.3f of float32\n",
              static_cast<double>(fs::file_size(store)) / 1e6,
              static_cast<double>(stored.bytes) / 1e6,
              stored.ratio());
  return checks.failed() ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "An hour of driving, streamed: resident memory, and a session that survives kill -9");
  Options options;
  app.add_option("--session", options.session, "folder, made anew")->required();
  app.add_option("--duration", options.duration_s, "of the drive, s");
  app.add_option("--kill-at", options.kill_s, "s of the drive; 0: not killed");
  app.add_option("--report", options.report_s, "memory is told every so many s of the drive");
  app.add_option("--settle", options.settle_s, "s of each process before its slope counts");
  app.add_option("--azimuth-steps", options.azimuth_steps, "firings a sweep, 16 beams");
  app.add_option("--seed", options.seed, "of the simulated drive");
  app.add_flag("--child", options.child)->group("");
  CLI11_PARSE(app, argc, argv);
  try {
    return options.child ? drive(options) : orchestrate(options, argv[0]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lio_hour: %s\n", error.what());
    return 1;
  }
}
