// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "input.hpp"

#include "trigpoint/export/session.hpp"
#include "trigpoint/simulator/scenario.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <filesystem>
#include <optional>

namespace trigpoint::cli {

namespace {

namespace fs = std::filesystem;

/// A folder made by `trigpoint simulate`: log/, truth.tum, scenario.yaml.
bool is_simulated_drive(const fs::path& folder) {
  return fs::is_directory(folder / "log") && fs::is_regular_file(folder / "scenario.yaml");
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

/// What a log knows by itself.
struct Known {
  std::optional<RobotConfig> robot;
  std::optional<Datum> datum;  ///< the surveyed origin of a simulated world
};

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
    load_config_text("fusion_gate: {mode: " + options.mode + "}",
                     "--mode",
                     [&config](ConfigFields& fields) { describe(config, fields); });
  }
  if (options.duration_s > 0.0) {
    config.log.duration_s = options.duration_s;
  }
  if (options.lenient) {
    config.log.require_points = config.log.require_imu = config.log.require_fix = false;
  }
  return config;
}

Input open_scenario(const InputOptions& options, const std::string& truth_file) {
  const simulator::Scenario scenario = simulator::load_scenario(options.log);
  std::optional<double> duration_s;
  if (options.duration_s > 0.0) {
    duration_s = options.duration_s;
  }
  auto reader = simulator::open_scenario(scenario, options.seed, duration_s);
  if (!truth_file.empty()) {
    exporter::create_session_folder(fs::path(truth_file).parent_path().string());
    reader->write_truth(truth_file);
  }
  Input input;
  input.config = configure(options, {reader->robot(), scenario.datum});
  input.reader = std::move(reader);
  return input;
}

/// The folder made by `trigpoint simulate` that `path` is or lies in (as its log/), if so.
std::optional<fs::path> simulated_drive_of(const fs::path& path) {
  fs::path plain = fs::absolute(path).lexically_normal();
  if (!plain.has_filename()) {
    plain = plain.parent_path();  // "log/" as a shell completes it
  }
  if (is_simulated_drive(plain)) {
    return plain;
  }
  const bool is_its_log = plain.filename() == "log" && is_simulated_drive(plain.parent_path());
  return is_its_log ? std::optional(plain.parent_path()) : std::nullopt;
}

Input open_simulated_drive(const InputOptions& options, const fs::path& folder) {
  const simulator::Scenario scenario =
      simulator::load_scenario((folder / "scenario.yaml").string());
  Input input;
  input.config = configure(options, {scenario.robot, scenario.datum});
  input.reader =
      recording::open_log((folder / "log").string(), input.config.cores.robot, input.config.log);
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
  input.reader = recording::open_log(options.log, input.config.cores.robot, input.config.log);
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
  verb.add_option("--mode", options.mode, "of the gate: lio, fusion, literal or hard");
}

void add_input_options(CLI::App& verb, InputOptions& options) {
  verb.add_option("LOG",
                  options.log,
                  "ROS 1 bag, rosbag2 folder, KITTI raw drive folder, folder made by trigpoint "
                  "simulate, or a scenario (name or .yaml), which is streamed")
      ->required();
  add_config_options(verb, options);
  verb.add_option("--seed", options.seed, "of the world and the noise, when LOG is a scenario")
      ->capture_default_str();
  verb.add_option("--duration", options.duration_s, "use only this much of the log, s")
      ->check(CLI::NonNegativeNumber);
}

Input open_input(const InputOptions& options, const std::string& truth_file) {
  const fs::path path = options.log;
  const bool recorded =
      fs::exists(path) && (path.extension() != ".yaml" || path.filename() == "metadata.yaml");
  return !recorded && simulator::is_scenario(options.log) ? open_scenario(options, truth_file)
                                                          : open_recording(options);
}

SystemConfig load_config_of(const InputOptions& options) {
  return configure(options, {});
}

}  // namespace trigpoint::cli
