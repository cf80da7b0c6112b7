// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion_drive.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/base/so3.hpp"
#include "trigpoint/geodesy/local_frame.hpp"
#include "trigpoint/pipeline/lockstep.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <utility>
#include <variant>

namespace trigpoint::fusion_table {

namespace {

using recording::LogEntry;

/// Reads the choices of one key out of a description, and leaves every value alone.
class ChoicesOf final : public ConfigFields {
 public:
  explicit ChoicesOf(std::string key) : key_(std::move(key)) {}

  const std::vector<std::string>& found() const { return found_; }

  void number(const std::string&, double&, const std::string&, Bounds) override {}

  void integer(const std::string&, std::int64_t&, const std::string&, Bounds) override {}

  void flag(const std::string&, bool&, const std::string&) override {}

  void text(const std::string&, std::string&, const std::string&) override {}

  void choice(const std::string& key,
              std::string&,
              const std::string&,
              const std::vector<std::string>& choices) override {
    if (key == key_) {
      found_ = choices;
    }
  }

  void vector3(const std::string&, Eigen::Vector3d&, const std::string&, Bounds) override {}

  void texts(const std::string&, std::vector<std::string>&, const std::string&) override {}

  void section(const std::string&,
               const std::string&,
               const std::function<void(ConfigFields&)>&) override {}

  void list(const std::string&,
            std::size_t,
            const std::string&,
            const std::function<void(std::size_t)>&,
            const std::function<void(ConfigFields&, std::size_t)>&) override {}

  void other_section(const std::string&) override {}

 private:
  std::string key_;
  std::vector<std::string> found_;
};

double processor_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Three cores in one mode, and what they said.
class Cores {
 public:
  Cores(pipeline::CoreConfigs configs,
        const std::string& mode,
        std::shared_ptr<const simulator::Truth> truth)
      : cores_(with_mode(std::move(configs), mode)), truth_(std::move(truth)) {}

  void feed(const LogEntry& entry) {
    const double before_s = processor_s();
    const pipeline::Step step = cores_.step(entry);
    run_.process_s += processor_s() - before_s;
    take(step);
  }

  Run finish() {
    take(cores_.finish());
    if (nees_count_ > 0) {
      run_.nees_pose = nees_sum_.pose / static_cast<double>(nees_count_);
      run_.nees_position = nees_sum_.position / static_cast<double>(nees_count_);
      run_.rms_error = (error_sum_ / static_cast<double>(nees_count_)).cwiseSqrt();
      run_.rms_sigma = (variance_sum_ / static_cast<double>(nees_count_)).cwiseSqrt();
    }
    return std::move(run_);
  }

 private:
  static pipeline::CoreConfigs with_mode(pipeline::CoreConfigs configs, const std::string& mode) {
    configs.fusion_gate.mode = mode;
    return configs;
  }

  void take(const pipeline::Step& step) {
    for (const Odometry& gps : step.gps_odometry) {
      const double variance_m2 = gps.pose_covariance.diagonal().head<2>().maxCoeff();
      run_.gps_sigmas.push_back({gps.stamp_ns, std::sqrt(variance_m2)});
    }
    for (const Odometry& odometry : step.lio_imu_rate) {
      run_.odom.push_back({odometry.stamp_ns, odometry.T_frame_child});
    }
    for (const Odometry& odometry : step.fused) {
      take(odometry);
    }
    for (const Odometry& raw : step.fused_raw) {
      run_.raw_pairs.push_back(
          {raw.stamp_ns, raw.T_frame_child, truth_->at(raw.stamp_ns).T_map_base});
    }
    for (const StateUpdate& update : step.state_updates) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (update.decision[axis] == AxisDecision::kFused) {
          run_.judgements[update.fix_stamp_ns].moves[axis] = true;
        }
      }
    }
    for (const FusionStatus& status : step.fusion_status) {
      run_.verdicts = status.verdicts;
      for (const FixVerdict& verdict : status.judged) {
        take(verdict);
      }
    }
  }

  void take(const Odometry& fused) {
    run_.fused.push_back({fused.stamp_ns, fused.T_frame_child});
    const Pose reference = truth_->at(fused.stamp_ns).T_map_base;
    run_.pairs.push_back({fused.stamp_ns, fused.T_frame_child, reference});
    const auto nees = evaluation::nees_of(fused.T_frame_child, fused.pose_covariance, reference);
    nees_sum_.pose += nees.pose;
    nees_sum_.position += nees.position;
    ++nees_count_;
    const Eigen::Quaterniond turn = fused.T_frame_child.q * reference.q.conjugate();
    Eigen::Matrix<double, 6, 1> error;
    error << fused.T_frame_child.p - reference.p, so3_log(turn.normalized());
    error_sum_ += error.cwiseAbs2();
    variance_sum_ += fused.pose_covariance.diagonal();
  }

  /// The first verdict on a fix stands: a copy of it that comes later is another message.
  void take(const FixVerdict& verdict) {
    if (verdict.reason.empty()) {
      return;
    }
    Judgement& judgement = run_.judgements[verdict.fix_stamp_ns];
    if (judgement.reason.empty() || (verdict.used && !judgement.used)) {
      judgement.reason = verdict.reason;
      judgement.used = verdict.used;
    }
  }

  pipeline::Lockstep cores_;
  std::shared_ptr<const simulator::Truth> truth_;
  Run run_;
  evaluation::Nees nees_sum_;
  Eigen::Matrix<double, 6, 1> error_sum_{Eigen::Matrix<double, 6, 1>::Zero()};
  Eigen::Matrix<double, 6, 1> variance_sum_{Eigen::Matrix<double, 6, 1>::Zero()};
  std::size_t nees_count_{0};
};

const simulator::ScenarioReader& scenario_of(const cli::Input& input) {
  return dynamic_cast<const simulator::ScenarioReader&>(*input.reader);
}

std::optional<double> duration_of(const cli::InputOptions& options) {
  return options.duration_s > 0.0 ? std::optional(options.duration_s) : std::nullopt;
}

/// All fixes of a drive as they come, which takes no ray.
std::vector<LogEntry> fixes_of(const simulator::Scenario& scenario,
                               const cli::InputOptions& options) {
  simulator::StreamOptions stream;
  stream.lidar = false;
  const auto reader =
      simulator::open_scenario(scenario, options.seed.value_or(1), duration_of(options), stream);
  std::vector<LogEntry> fixes;
  while (auto entry = reader->next()) {
    if (std::holds_alternative<GnssFix>(entry->measurement)) {
      fixes.push_back(std::move(*entry));
    }
  }
  return fixes;
}

Nanoseconds stamp_of(const LogEntry& entry) {
  return std::get<GnssFix>(entry.measurement).stamp_ns;
}

/// Once each, in order, `latency_s` after they were measured.
std::vector<LogEntry> sorted_once(std::vector<LogEntry> fixes, double latency_s) {
  const auto earlier = [](const LogEntry& a, const LogEntry& b) {
    return stamp_of(a) < stamp_of(b);
  };
  const auto same = [](const LogEntry& a, const LogEntry& b) { return stamp_of(a) == stamp_of(b); };
  std::stable_sort(fixes.begin(), fixes.end(), earlier);
  fixes.erase(std::unique(fixes.begin(), fixes.end(), same), fixes.end());
  for (LogEntry& fix : fixes) {
    fix.receive_ns = stamp_of(fix) + from_seconds(latency_s);
  }
  return fixes;
}

std::vector<ReceivedFix> errors_of(const std::vector<LogEntry>& sorted_fixes,
                                   const simulator::Scenario& scenario,
                                   const simulator::Truth& truth) {
  const geodesy::LocalFrame frame(scenario.datum);
  std::vector<ReceivedFix> received;
  for (const LogEntry& entry : sorted_fixes) {
    const auto& fix = std::get<GnssFix>(entry.measurement);
    const auto place = frame.to_map({fix.latitude_deg, fix.longitude_deg, fix.altitude_m});
    if (place) {
      const Eigen::Vector3d antenna_m =
          truth.at(fix.stamp_ns).T_map_base * scenario.robot.antenna_position_base_m;
      received.push_back({fix.stamp_ns, *place - antenna_m});
    }
  }
  return received;
}

using AllCores = std::map<std::string, std::unique_ptr<Cores>>;

void feed_all(AllCores& cores, const LogEntry& entry) {
  for (auto& [mode, core] : cores) {
    core->feed(entry);
  }
}

std::map<std::string, Run> finish_all(AllCores& cores) {
  std::map<std::string, Run> runs;
  for (auto& [mode, core] : cores) {
    runs.emplace(mode, core->finish());
  }
  return runs;
}

}  // namespace

const Run* Drive::run_of(const std::string& mode) const {
  const auto found = runs.find(mode);
  return found == runs.end() ? nullptr : &found->second;
}

std::vector<std::string> known_modes() {
  fusion_gate::Config config;
  ChoicesOf modes("mode");
  fusion_gate::describe(config, modes);
  return modes.found();
}

Drive drive(const DriveOptions& options) {
  cli::Input input = cli::open_input(options.input);
  const simulator::Scenario& scenario = scenario_of(input).scenario();
  Drive result;
  result.scenario = options.input.log;
  result.seed = options.input.seed.value_or(1);
  result.truth = scenario_of(input).truth();
  result.fixes = scenario_of(input).true_fixes();
  const auto sorted = sorted_once(fixes_of(scenario, options.input), scenario.gnss.latency_s);
  result.received = errors_of(sorted, scenario, *result.truth);

  AllCores cores;
  AllCores sorted_cores;
  for (const std::string& mode : options.modes) {
    cores[mode] = std::make_unique<Cores>(input.config.cores, mode, result.truth);
    if (options.sorted) {
      sorted_cores[mode] = std::make_unique<Cores>(input.config.cores, mode, result.truth);
    }
  }
  auto next_sorted = sorted.begin();
  while (const auto entry = input.reader->next()) {
    for (; next_sorted != sorted.end() && next_sorted->receive_ns <= entry->receive_ns;
         ++next_sorted) {
      feed_all(sorted_cores, *next_sorted);
    }
    feed_all(cores, *entry);
    if (!std::holds_alternative<GnssFix>(entry->measurement)) {
      feed_all(sorted_cores, *entry);
    }
  }
  result.runs = finish_all(cores);
  result.sorted_runs = finish_all(sorted_cores);
  return result;
}

Drive without_runs(const cli::InputOptions& input) {
  const simulator::Scenario scenario = simulator::load_scenario(input.log);
  simulator::StreamOptions stream;
  stream.lidar = false;
  const auto reader =
      simulator::open_scenario(scenario, input.seed.value_or(1), duration_of(input), stream);
  Drive result;
  result.scenario = input.log;
  result.seed = input.seed.value_or(1);
  result.truth = reader->truth();
  result.fixes = reader->true_fixes();
  const auto sorted = sorted_once(fixes_of(scenario, input), scenario.gnss.latency_s);
  result.received = errors_of(sorted, scenario, *result.truth);
  return result;
}

std::vector<evaluation::Window> stretches(
    const Drive& drive,
    const std::function<bool(const simulator::FixTruth&)>& is) {
  std::vector<evaluation::Window> found;
  bool inside = false;
  for (const simulator::FixTruth& fix : drive.fixes) {
    if (fix.lost) {
      continue;
    }
    if (inside) {
      found.back().end_ns = fix.stamp_ns;
    } else if (is(fix)) {
      found.push_back({fix.stamp_ns, fix.stamp_ns});
    }
    inside = is(fix);
  }
  if (inside) {
    found.back().end_ns = drive.truth->last_ns();
  }
  return found;
}

std::vector<evaluation::Window> outages(const Drive& drive) {
  std::vector<Nanoseconds> delivered_ns;
  for (const simulator::FixTruth& fix : drive.fixes) {
    if (!fix.lost) {
      delivered_ns.push_back(fix.stamp_ns);
    }
  }
  return delivered_ns.empty() ? std::vector<evaluation::Window>{}
                              : evaluation::find_outages(delivered_ns, delivered_ns.back());
}

}  // namespace trigpoint::fusion_table
