// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "input.hpp"

#include "trigpoint/export/session.hpp"
#include "trigpoint/pipeline/lockstep.hpp"
#include "trigpoint/simulator/scenario.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "number_checks.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>

namespace trigpoint::cli {

namespace {

namespace fs = std::filesystem;

/// A folder made by `trigpoint simulate`: log/, truth.tum, scenario.yaml.
bool is_simulated_drive(const fs::path& folder) {
  std::error_code unreadable;  // told with its name when it is opened
  return fs::is_directory(folder / "log", unreadable) &&
         fs::is_regular_file(folder / "scenario.yaml", unreadable);
}

/// Hands everything on and knows where the truth of a simulated drive lies.
class WithTruth final : public recording::LogReader {
 public:
  WithTruth(std::unique_ptr<recording::LogReader> reader, std::string truth)
      : reader_(std::move(reader)), truth_(std::move(truth)) {}

  const recording::LogSummary& summary() const override { return reader_->summary(); }

  std::optional<recording::LogEntry> next() override { return reader_->next(); }

  double progress() const override { return reader_->progress(); }

  std::vector<recording::Undecodable> undecodable() const override {
    return reader_->undecodable();
  }

  Events take_events() override { return reader_->take_events(); }

  std::optional<std::string> truth_file() const override { return truth_; }

  std::optional<RobotConfig> robot() const override { return reader_->robot(); }

 private:
  std::unique_ptr<recording::LogReader> reader_;
  std::string truth_;
};

/// As a YAML scalar.
std::string quoted(const std::string& text) {
  std::string yaml = "'";
  for (const char c : text) {
    yaml += c == '\'' ? "\'\'" : std::string(1, c);
  }
  return yaml + "'";
}

/// What a log knows by itself.
struct Known {
  std::optional<RobotConfig> robot;
  std::optional<Datum> datum;  ///< the surveyed origin of a simulated world
};

void set_mode(SystemConfig& config, const std::string& mode) {
  try {
    load_config_text("fusion_gate:\n  mode: " + quoted(mode),
                     "--mode",
                     [&config](ConfigFields& fields) { describe(config, fields); });
  } catch (const ConfigError& error) {
    // "--mode:2: fusion_gate.mode must be one of ...": the line and the key say nothing here.
    const std::string text = error.what();
    const std::size_t rule = text.find("must be");
    throw ConfigError(rule == std::string::npos ? text : "--mode " + text.substr(rule));
  }
}

/// Defaults, then what the log knows, then the user's files.
SystemConfig configure(const InputOptions& options, const Known& known) {
  SystemConfig config;
  if (known.robot) {
    config.cores.robot = *known.robot;
  }
  if (known.datum) {
    gps_odometry::Config& gps = config.cores.gps_odometry;
    gps.use_configured_datum = true;
    gps.datum_latitude_deg = known.datum->latitude_deg;
    gps.datum_longitude_deg = known.datum->longitude_deg;
    gps.datum_height_m = known.datum->height_m;
  }
  load(config, options.config_files);
  if (!options.mode.empty()) {
    set_mode(config, options.mode);
  }
  if (mode_of(config) == "lio") {
    config.log.require_fix = config.log.require_aiding = false;  // nothing would use them
  }
  if (options.duration_s > 0.0) {
    config.log.duration_s = options.duration_s;
  }
  if (options.lenient) {
    config.log.require_points = config.log.require_imu = config.log.require_fix = false;
    config.log.require_aiding = false;
  }
  return config;
}

/// Whether the user named a topic that the log does not have as this type, whatever else is wrong
/// with it.
bool names_a_wrong_topic(const std::string& log, const SystemConfig& config) {
  recording::LogOptions any = config.log;
  any.require_points = any.require_imu = any.require_fix = any.require_aiding = false;
  const RobotConfig defaults;
  const RobotConfig& robot = config.cores.robot;
  RobotConfig nothing;  // of a log, so that it is opened
  nothing.points_topic = nothing.imu_topic = nothing.fix_topic = "";
  try {
    const auto topics = recording::open_log(log, nothing, any)->summary().topics;
    const auto is_wrong = [&](const std::string RobotConfig::*topic, const std::string& type) {
      return robot.*topic != defaults.*topic &&
             std::none_of(topics.begin(), topics.end(), [&](const auto& there) {
               return (there.topic == robot.*topic || there.topic == "/" + robot.*topic) &&
                      (type.empty() || there.type == type);
             });
    };
    return is_wrong(&RobotConfig::points_topic, "sensor_msgs/msg/PointCloud2") ||
           is_wrong(&RobotConfig::imu_topic, "sensor_msgs/msg/Imu") ||
           is_wrong(&RobotConfig::fix_topic, "sensor_msgs/msg/NavSatFix") ||
           is_wrong(&RobotConfig::twist_topic, "") || is_wrong(&RobotConfig::yaw_topic, "");
  } catch (const recording::LogError&) {
    return false;
  }
}

std::unique_ptr<recording::LogReader> open_recorded(const std::string& log,
                                                    const SystemConfig& config) {
  try {
    return recording::open_log(log, config.cores.robot, config.log);
  } catch (const recording::LogError& error) {
    if (names_a_wrong_topic(log, config)) {
      throw ConfigError(error.what());
    }
    throw;
  }
}

/// The simulator has neither wheels nor a heading: what was named would be missed in silence.
void refuse_aiding(const std::string& scenario, const SystemConfig& config) {
  const RobotConfig& robot = config.cores.robot;
  if (config.log.require_aiding && !(robot.twist_topic.empty() && robot.yaw_topic.empty())) {
    throw ConfigError(scenario +
                      ": a scenario has no topic for robot.twist_topic or robot.yaw_topic; leave "
                      "them empty, or set log.require_aiding to false");
  }
}

Input open_scenario(const InputOptions& options) {
  const simulator::Scenario scenario =
      simulator::load_scenario(with_changes(options.log, options.changes));
  const std::optional<double> duration_s = scenario_duration_s(options.duration_s);
  Input input;
  input.config = configure(options, {scenario.robot, scenario.datum});
  check_cores(input.config);
  refuse_aiding(options.log, input.config);
  auto reader = simulator::open_scenario(scenario, options.seed.value_or(1), duration_s);
  input.write_truth = [stream = reader.get()](const std::string& file) {
    exporter::create_session_folder(fs::path(file).parent_path().string());
    stream->write_truth(file);
  };
  input.reader = std::move(reader);
  return input;
}

/// The folder made by `trigpoint simulate` that `path` is, or is the log/ of, or a file of that, if
/// so.
std::optional<fs::path> simulated_drive_of(const fs::path& path) {
  fs::path plain = fs::absolute(path).lexically_normal();
  if (!plain.has_filename()) {
    plain = plain.parent_path();  // "log/" as a shell completes it
  }
  if (is_simulated_drive(plain)) {
    return plain;
  }
  if (fs::is_regular_file(plain)) {
    plain = plain.parent_path();
  }
  const bool is_its_log = plain.filename() == "log" && is_simulated_drive(plain.parent_path());
  return is_its_log ? std::optional(plain.parent_path()) : std::nullopt;
}

Input open_simulated_drive(const InputOptions& options, const fs::path& folder) {
  const simulator::Scenario scenario =
      simulator::load_scenario((folder / "scenario.yaml").string());
  Input input;
  input.config = configure(options, {scenario.robot, scenario.datum});
  const std::string log =
      fs::is_regular_file(options.log) ? options.log : (folder / "log").string();
  input.reader = open_recorded(log, input.config);
  const fs::path truth = folder / "truth.tum";
  if (fs::is_regular_file(truth)) {
    input.reader = std::make_unique<WithTruth>(std::move(input.reader), truth.string());
  }
  return input;
}

Input open_recording(const InputOptions& options) {
  if (const auto folder = simulated_drive_of(options.log)) {
    return open_simulated_drive(options, *folder);
  }
  Input input;
  input.config = configure(options, {});
  input.reader = open_recorded(options.log, input.config);
  if (const auto robot = input.reader->robot()) {
    input.config = configure(options, {robot, std::nullopt});
  }
  return input;
}

}  // namespace

void add_config_options(CLI::App& verb, InputOptions& options) {
  verb.add_option("--config",
                  options.config_files,
                  "YAML with the keys to change (trigpoint config prints all); may be repeated, "
                  "later files win");
  verb.add_option("--mode", options.mode, "of the gate: lio, fusion, literal, hard or smooth");
}

void add_input_options(CLI::App& verb, InputOptions& options) {
  verb.add_option(
          "LOG",
          options.log,
          "ROS 1 bag, rosbag2 folder, MCAP file, KITTI raw drive folder, folder made by trigpoint "
          "simulate, or a scenario (name or .yaml), which is streamed; "
          "SCENARIO+CHANGE+... alters it (see trigpoint simulate --help)")
      ->required();
  add_config_options(verb, options);
  verb.add_option(
          "--seed", options.seed, "of the world and the noise, when LOG is a scenario (default 1)")
      ->check(whole_number());
  add_scenario_options(verb, options.changes);
  verb.add_option("--duration", options.duration_s, "use only this much of the log, s")
      ->check(more_than_zero());
}

void add_scenario_options(CLI::App& verb, ScenarioChanges& changes) {
  verb.add_option("--beams", changes.beams, "of a scenario's LiDAR: 16, 32 or 64")
      ->check(CLI::IsMember({16, 32, 64}));
  verb.add_option("--start", changes.start_m, "along a scenario's route: where the drive begins, m")
      ->check(zero_or_more());
  verb.add_option("--day",
                  changes.day,
                  "of a scenario: the same world (with the same seed), other noise, later stamps")
      ->check(whole_number());
}

void add_storage_option(CLI::App& verb, std::optional<recording::Storage>& storage) {
  verb.add_option_function<std::string>(
          "--storage",
          [&storage](const std::string& name) {
            storage = name == "mcap" ? recording::Storage::kMcap : recording::Storage::kSqlite3;
          },
          "of the rosbag2: sqlite3 (default) or mcap")
      ->check(CLI::IsMember({"sqlite3", "mcap"}));
}

std::string with_changes(const std::string& scenario, const ScenarioChanges& changes) {
  std::string composed = scenario;
  if (changes.beams != 0) {
    composed += "+beams_" + std::to_string(changes.beams);
  }
  if (changes.start_m) {
    composed += "+motion.start_m=" + std::to_string(*changes.start_m);
  }
  if (changes.day) {
    composed += "+day=" + std::to_string(*changes.day);
  }
  return composed;
}

void leave_truth(const Input& input, const std::string& session) {
  if (input.write_truth) {
    input.write_truth(exporter::path_in(session, exporter::session_file::kTruth));
  }
}

Input open_input(const InputOptions& given) {
  InputOptions options = given;
  if (fs::path(given.log).filename() == "metadata.yaml" && fs::exists(given.log)) {
    options.log = fs::absolute(given.log).parent_path().string();  // a rosbag2's, by its index
  }
  const bool recorded = fs::exists(options.log) && fs::path(options.log).extension() != ".yaml";
  if (!recorded && simulator::is_scenario(options.log)) {
    return open_scenario(options);
  }
  if (!recorded) {
    throw ConfigError(options.log + ": no such file or folder, nor a scenario; scenarios are: " +
                      known_scenarios());
  }
  if (options.seed) {
    throw ConfigError("--seed: " + options.log + " is a recorded drive; only a scenario has one");
  }
  if (options.changes.any()) {
    throw ConfigError("--beams, --start, --day: " + options.log +
                      " is a recorded drive; only a scenario has them");
  }
  Input input = open_recording(options);
  check_cores(input.config);
  return input;
}

void check_cores(const SystemConfig& config) {
  const pipeline::Lockstep cores(config.cores);
}

SystemConfig load_config_of(const InputOptions& options) {
  return configure(options, {});
}

void refuse_used_folder(const std::string& out) {
  namespace file = exporter::session_file;
  constexpr std::array kResults{file::kConfig,
                                file::kDatum,
                                file::kRun,
                                file::kFused,
                                file::kLio,
                                file::kGps,
                                file::kTruth,
                                file::kFixes,
                                file::kKeyframes,
                                file::kMap,
                                "scenario.yaml",
                                "metadata.yaml"};
  for (const char* name : kResults) {
    if (fs::is_regular_file(fs::path(out) / name)) {
      throw ConfigError("--out: " + out + " holds results already (" + name +
                        "); name another folder, or remove it");
    }
  }
  if (fs::exists(out) && !fs::is_directory(out)) {
    throw ConfigError("--out: " + out + " is no folder");
  }
}

namespace {

std::string listed(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) {
    list += (list.empty() ? "" : ", ") + name;
  }
  return list;
}

}  // namespace

std::string known_scenarios() {
  return listed(simulator::shipped_scenarios());
}

std::string known_scenario_changes() {
  return listed(simulator::shipped_overlays());
}

void require_scenario(const std::string& file_or_name) {
  if (!simulator::is_scenario(file_or_name)) {
    throw ConfigError(file_or_name + ": no such scenario file (.yaml), nor a scenario's name; " +
                      "scenarios are: " + known_scenarios());
  }
}

}  // namespace trigpoint::cli
