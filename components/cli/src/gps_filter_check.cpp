// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gps_filter_check.hpp"

#include "trigpoint/bus/participant_of.hpp"
#include "trigpoint/shell/shell.hpp"
#include "trigpoint/shell/stop_signal.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "bus_survey.hpp"
#include "gps_filter_contract.hpp"
#include "known_topics.hpp"

#include <algorithm>
#include <chrono>
#include <iomanip>
#include <iostream>

namespace trigpoint::cli {

namespace {

using namespace std::chrono_literals;
using recording::TopicSurvey;

constexpr double kSurvey_s = 2.0;
constexpr double kOutageFrom_s = 40.0;
constexpr double kOutageTo_s = 52.0;
constexpr std::uint64_t kSeed = 7;

// Turns both ways, changes of speed, fixes of an RTK receiver that come 0.12 s late, and no fixes
// for 12 s.
constexpr const char* kDrive = R"(
name: gps_filter_check
duration_s: 70.0
route: {type: figure_eight, length_m: 60.0, width_m: 30.0, speed_mps: 3.0, laps: 8}
imu: {grade: low, rate_hz: 100.0}
gnss: {gnss_class: fixed, driver: ublox, rate_hz: 5.0, latency_s: 0.12, latency_jitter_s: 0.02}
faults:
  - {type: gps_outage, start_s: 40.0, duration_s: 12.0}
)";

std::set<std::string> writers_of(const TopicSurvey& survey) {
  std::set<std::string> writers = survey.writers;
  writers.insert(survey.silent_writers.begin(), survey.silent_writers.end());
  return writers;
}

const TopicSurvey& survey_of(const std::vector<TopicSurvey>& surveys, const std::string& topic) {
  return *std::find_if(surveys.begin(), surveys.end(), [&](const TopicSurvey& survey) {
    return survey.topic.name == topic;
  });
}

/// What else the program of this writer writes: the best hint at who it is.
std::string company_of(const std::vector<TopicSurvey>& surveys, const std::string& writer) {
  std::string names;
  for (const TopicSurvey& survey : surveys) {
    for (const std::string& other : writers_of(survey)) {
      if (bus::participant_of(other) == bus::participant_of(writer)) {
        names += (names.empty() ? "" : ", ") + survey.topic.name;
        break;
      }
    }
  }
  return "program " + bus::participant_of(writer) + ", which writes " + names;
}

/// False, with the reason on standard error, when a check would disturb somebody or cannot be made.
bool is_free(const std::vector<TopicSurvey>& surveys, const RobotConfig& robot) {
  bool free = true;
  for (const std::string& topic : {robot.imu_topic, robot.fix_topic}) {
    for (const std::string& writer : writers_of(survey_of(surveys, topic))) {
      std::cerr << "trigpoint doctor: " << topic
                << " has a writer already: " << company_of(surveys, writer)
                << ". The check publishes sensors of its own; stop it, or use another "
                   "ROS_DOMAIN_ID.\n";
      free = false;
    }
  }
  const std::set<std::string> filters = writers_of(survey_of(surveys, "gps/odometry"));
  if (filters.empty()) {
    std::cerr << "trigpoint doctor: nobody writes gps/odometry: start the filter first, on the "
                 "same ROS_DOMAIN_ID.\n";
    return false;
  }
  if (filters.size() > 1) {
    std::cerr << "trigpoint doctor: " << filters.size() << " programs write gps/odometry:\n";
    for (const std::string& writer : filters) {
      std::cerr << "  " << company_of(surveys, writer) << "\n";
    }
    std::cerr << "Leave one of them running.\n";
    return false;
  }
  return free;
}

simulator::Scenario scripted_drive(const RobotConfig& robot, const std::optional<Datum>& datum) {
  simulator::Scenario scenario = simulator::load_scenario_text(kDrive, "the drive of the check");
  scenario.robot = robot;
  scenario.datum = datum.value_or(scenario.datum);  // a filter that knows where `map` is stays near
  scenario.start_time_s = std::chrono::duration_cast<std::chrono::seconds>(
                              std::chrono::system_clock::now().time_since_epoch())
                              .count();
  return scenario;
}

int print(const std::vector<ContractCheck>& checks) {
  std::size_t failed = 0;
  for (const ContractCheck& check : checks) {
    failed += check.passed ? 0 : 1;
    std::cout << (check.passed ? "  pass  " : "  FAIL  ") << std::left << std::setw(30)
              << check.name << check.figures << "\n";
  }
  if (failed == 0) {
    std::cout << "all " << checks.size() << " checks passed\n";
    return 0;
  }
  std::cout << failed << " of " << checks.size() << " checks failed; docs/write_a_gps_filter.md\n";
  return 1;
}

}  // namespace

int check_gps_filter(const SystemConfig& config, double rate) {
  const shell::EventLog log("doctor");
  const RobotConfig& robot = config.cores.robot;
  const auto on_event = [&log](const Event& event) { log(event); };
  const auto surveys =
      recording::survey_bus({config.bus, recording::known_topics(robot), kSurvey_s, on_event});
  if (!is_free(surveys, robot)) {
    return 1;
  }
  const shell::StopSignal stop;
  const auto datum = recording::hear_datum(config.bus, 500ms);
  const simulator::Scenario scenario = scripted_drive(robot, datum);
  const auto drive = simulator::open_scenario(scenario, kSeed, std::nullopt, {.lidar = false});
  std::cout << "DDS domain " << bus::domain_of(config.bus) << ": a simulated drive of "
            << scenario.duration_s << " s with no fixes from " << kOutageFrom_s << " to "
            << kOutageTo_s << " s, at most " << rate << " times as fast as real" << std::endl;
  recording::FilterDriveOptions options;
  options.robot = robot;
  options.bus = config.bus;
  options.rate = rate;
  options.on_event = on_event;
  options.stop = [&stop] { return stop.requested(); };
  const recording::FilterRecord record = recording::drive_filter(*drive, options);
  if (record.stopped) {
    std::cerr << "trigpoint doctor: stopped before the end; nothing is judged.\n";
    return 1;
  }
  const auto truth = drive->truth();
  FilterScript script;
  script.start_ns = truth->first_ns();
  script.end_ns = truth->last_ns();
  script.outage_from_ns = script.start_ns + from_seconds(kOutageFrom_s);
  script.outage_to_ns = script.start_ns + from_seconds(kOutageTo_s);
  script.fix_rate_hz = scenario.gnss.rate_hz;
  script.antenna_position_base_m = robot.antenna_position_base_m;
  script.datum = scenario.datum;
  return print(judge_filter(record, script, *truth));
}

}  // namespace trigpoint::cli
