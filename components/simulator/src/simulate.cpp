// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/simulator.hpp"

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <variant>

namespace trigpoint::simulator {

namespace {

namespace fs = std::filesystem;

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.close();
  if (!file) {
    throw std::runtime_error(path.string() +
                             ": cannot be written (does the folder exist, is the disk full?)");
  }
}

/// What the configuration of the processes needs to know of the robot.
std::string robot_overlay(RobotConfig robot) {
  return "# The robot of a simulated drive: an overlay for the configuration.\n" +
         print_config([&robot](ConfigFields& fields) {
           fields.section("robot", "where the sensors sit", [&robot](ConfigFields& below) {
             describe(robot, below);
           });
         });
}

/// A simulated robot has neither twists nor yaws.
const std::string& topic_of(const recording::Measurement& measurement, const RobotConfig& robot) {
  if (std::holds_alternative<ImuSample>(measurement)) {
    return robot.imu_topic;
  }
  return std::holds_alternative<GnssFix>(measurement) ? robot.fix_topic : robot.points_topic;
}

void write_log(ScenarioReader& reader,
               const std::string& folder,
               recording::Storage storage,
               const Progress& progress) {
  const RobotConfig robot = reader.scenario().robot;
  recording::Rosbag2Writer writer(folder, storage);
  while (const auto entry = reader.next()) {
    std::visit(
        [&](const auto& message) {
          writer.write(topic_of(entry->measurement, robot), entry->receive_ns, message);
        },
        entry->measurement);
    if (progress) {
      progress(reader.progress());
    }
  }
  writer.close();
}

}  // namespace

void simulate(const Scenario& scenario,
              std::uint64_t seed,
              std::optional<double> duration_s,
              const std::string& out_dir,
              const Progress& progress,
              const StreamOptions& options,
              recording::Storage storage) {
  const fs::path out(out_dir);
  std::error_code error;
  fs::create_directories(out, error);
  if (error) {
    throw std::runtime_error(out_dir + ": cannot be created: " + error.message());
  }
  // Before anything is written: another drive's log must not end up beside this one's truth.
  if (const fs::path log = out / "log"; fs::exists(log, error) && !fs::is_empty(log, error)) {
    throw recording::LogError(
        log.string() + ": exists already and is not empty; choose another folder or remove it");
  }
  const auto reader = open_scenario(scenario, seed, duration_s, options);
  const std::string made = "# simulated with seed " + std::to_string(seed) + ", " +
                           std::to_string(duration_s.value_or(scenario.duration_s)) + " s\n";
  write_text(out / "scenario.yaml", made + scenario.source_yaml);
  write_text(out / "robot.yaml", robot_overlay(scenario.robot));
  reader->write_truth((out / "truth.tum").string());
  write_log(*reader, (out / "log").string(), storage, progress);
}

}  // namespace trigpoint::simulator
