// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/shell/shell.hpp"

#include "alive_check.hpp"
#include "bus_survey.hpp"
#include "doctor_findings.hpp"
#include "gps_filter_check.hpp"
#include "incomplete_datagrams.hpp"
#include "input.hpp"
#include "measurement_checks.hpp"
#include "number_checks.hpp"
#include "progress.hpp"
#include "silent_programs.hpp"
#include "verbs.hpp"

#include <algorithm>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <memory>
#include <optional>
#include <variant>

namespace trigpoint::cli {

namespace {

constexpr std::int64_t kWantedSocketBuffer_bytes = 4'194'304;

struct DoctorOptions {
  InputOptions input;
  double seconds{5.0};
  bool gps_filter{false};
  double rate{5.0};
  std::string alive;  ///< program
};

/// 0 when nothing is wrong.
int tell(const std::string& topic, const std::vector<std::string>& remarks) {
  for (const std::string& remark : remarks) {
    std::cout << "  ! " << topic << ": " << remark << "\n";
  }
  return remarks.empty() ? 0 : 1;
}

/// 0 when it is a hint only.
int tell(const Finding& finding) {
  if (finding.is_wrong) {
    return tell(finding.topic, {finding.sentence});
  }
  std::cout << "  " << finding.topic << ": " << finding.sentence << "\n";
  return 0;
}

std::string refused_advice(const std::string& policy) {
  return "a writer offers less than we ask for (" + policy + ")" +
         (policy == "RELIABILITY" ? ": read as best effort; set it to reliable where clouds or IMU "
                                    "samples get lost"
          : policy == "DURABILITY" ? ": set it to transient local"
                                   : ": remove that policy from the writer");
}

void tell_socket_buffer_limit() {
  std::ifstream file("/proc/sys/net/core/rmem_max");
  std::int64_t limit = 0;
  if (file >> limit) {
    const std::string advice = buffer_advice(limit, kWantedSocketBuffer_bytes);
    std::cout << (advice.empty() ? "" : "  ! " + advice + "\n");
  }
}

/// 1 when there were some since `failed_before` was asked for; older ones are told only.
int tell_incomplete_datagrams(std::optional<std::int64_t> failed_before) {
  const auto failed_after = failed_reassemblies();
  const std::string note = past_reassembly_note(failed_before, failed_after);
  std::cout << (note.empty() ? "" : "  " + note + "\n");
  const std::string advice = reassembly_advice(failed_before, failed_after);
  return advice.empty() ? 0 : tell("the network", {advice});
}

int examine_bus(const DoctorOptions& options) {
  const shell::EventLog log("doctor");
  const SystemConfig config = load_config_of(options.input);
  const int domain = bus::domain_of(config.bus);  // throws: before half a line is printed
  std::cout << "DDS domain " << domain << ", listening for " << options.seconds << " s\n";
  std::vector<bus::DiscoveredEndpoint> endpoints;
  const auto failed_before = failed_reassemblies();
  const auto surveys = recording::survey_bus(
      {config.bus,
       recording::known_topics(config.cores.robot),
       options.seconds,
       [&log](const Event& event) { log(event); },
       [&endpoints](std::vector<bus::DiscoveredEndpoint> found) { endpoints = std::move(found); }});
  int wrong = 0;
  bool anybody = false;
  for (const recording::TopicSurvey& survey : surveys) {
    const std::size_t writers = survey.writers.size() + survey.silent_writers.size();
    anybody = anybody || writers > 0;
    std::cout << std::left << std::setw(24) << survey.topic.name << std::setw(34)
              << survey.topic.ros_type << std::right << std::setw(3) << writers
              << (writers == 1 ? " writer  " : " writers ") << std::setw(7) << survey.messages
              << " messages " << std::fixed << std::setprecision(1) << std::setw(7)
              << survey.rate_hz << " Hz\n";
    wrong |= tell(survey.topic.name, survey.remarks);
    for (const std::string& policy : survey.refused) {
      wrong |= tell(survey.topic.name, {refused_advice(policy)});
    }
  }
  const std::vector<LocalProcess> local = local_processes();
  const RobotConfig& robot = config.cores.robot;
  for (const std::vector<Finding>& findings :
       {findings_of(surveys, endpoints, robot),
        silent_on_the_bus(surveys, local, robot),
        not_on_the_bus(surveys, local, domain, options.seconds),
        mapper_without_track(surveys, robot)}) {
    for (const Finding& finding : findings) {
      wrong |= tell(finding);
    }
  }
  std::cout << (endpoints.empty() ? "on the bus: nobody else\n" : "on the bus:\n");
  for (const std::string& line : who_is_there(endpoints)) {
    std::cout << "  " << line << "\n";
  }
  tell_socket_buffer_limit();
  wrong |= tell_incomplete_datagrams(failed_before);
  if (!anybody) {
    std::cerr << "trigpoint doctor: nobody writes any of these topics; is ROS_DOMAIN_ID the same "
                 "everywhere?\n";
    return 1;
  }
  return wrong;
}

/// Reads the log through; 1 when something is wrong.
int examine_entries(recording::LogReader& reader, const RobotConfig& robot) {
  recording::MeasurementChecks points;
  recording::MeasurementChecks imu;
  recording::MeasurementChecks fixes;
  Progress progress("examining");
  int wrong = 0;
  try {
    while (const auto entry = reader.next()) {
      progress(reader.progress());
      if (const auto* sample = std::get_if<ImuSample>(&entry->measurement)) {
        imu.take(*sample);
      } else if (const auto* fix = std::get_if<GnssFix>(&entry->measurement)) {
        fixes.take(*fix);
      } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry->measurement)) {
        points.take(*cloud);
      }
    }
  } catch (const recording::LogError& broken) {
    std::cout << "  ! the log breaks off: " << broken.what() << "\n";
    wrong = 1;
  }
  for (const Event& event : recording::undecodable_events(reader)) {
    std::cout << "  ! " << event.text << "\n";
    wrong = 1;
  }
  return wrong | tell(robot.points_topic, points.remarks()) | tell(robot.imu_topic, imu.remarks()) |
         tell(robot.fix_topic, fixes.remarks());
}

std::string plain_topic(const std::string& topic) {
  return topic.starts_with('/') ? topic.substr(1) : topic;
}

/// A table of the log's topics, then the inputs that it lacks; 1 when it lacks one. A KITTI drive
/// has no topic names: its inputs are told apart by type.
int tell_topics(const recording::LogSummary& summary, const RobotConfig& robot) {
  const double duration_s = to_seconds(summary.last_ns - summary.first_ns);
  for (const recording::TopicSummary& topic : summary.topics) {
    std::cout << std::left << std::setw(24) << topic.topic << " " << std::setw(34) << topic.type
              << " " << std::right << std::setw(9) << topic.messages << " messages " << std::fixed
              << std::setprecision(1) << std::setw(7)
              << static_cast<double>(topic.messages) / std::max(duration_s, 1e-9) << " Hz\n";
  }
  const auto messages_of = [&](const std::string& name, const std::string& type) {
    std::uint64_t count = 0;
    for (const recording::TopicSummary& topic : summary.topics) {
      const bool named = summary.format == "kitti" || plain_topic(topic.topic) == plain_topic(name);
      count += named && topic.type == type ? topic.messages : 0;
    }
    return count;
  };
  int wrong = 0;
  const auto require = [&](const std::string& key, const std::string& name, const char* type) {
    if (messages_of(name, type) == 0) {
      wrong |= tell(name,
                    {std::string("no message of type ") + type +
                     " under this name; if the log has it under another, set " + key});
    }
  };
  if (summary.format != "scenario") {
    require("robot.points_topic", robot.points_topic, "sensor_msgs/msg/PointCloud2");
    require("robot.imu_topic", robot.imu_topic, "sensor_msgs/msg/Imu");
    require("robot.fix_topic", robot.fix_topic, "sensor_msgs/msg/NavSatFix");
    if (!robot.twist_topic.empty()) {
      require("robot.twist_topic",
              robot.twist_topic,
              robot.twist_message == "Odometry" ? "nav_msgs/msg/Odometry"
                                                : "geometry_msgs/msg/TwistWithCovarianceStamped");
    }
    if (!robot.yaw_topic.empty()) {
      require("robot.yaw_topic", robot.yaw_topic, "sensor_msgs/msg/Imu");
    }
  }
  return wrong;
}

int examine_log(const DoctorOptions& options) {
  InputOptions lenient = options.input;
  lenient.lenient = true;
  Input input = open_input(lenient);
  const recording::LogSummary& summary = input.reader->summary();
  const RobotConfig& robot = input.config.cores.robot;
  int wrong = tell_topics(summary, robot) | tell("the log", summary.faults);
  wrong |= examine_entries(*input.reader, robot);
  std::cout << (wrong == 0 ? "nothing wrong found\n" : "");
  return wrong;
}

}  // namespace

void add_doctor(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand("doctor",
                                      "Tell what is on the bus (or in LOG), what is missing, which "
                                      "program is silent or has no track, and which unit, frame "
                                      "or QoS is wrong");
  const auto options = std::make_shared<DoctorOptions>();
  verb->add_option("LOG", options->input.log, "examine this log instead of the bus");
  add_config_options(*verb, options->input);
  verb->add_option("--seconds", options->seconds, "listen to the bus for this long")
      ->capture_default_str()
      ->check(more_than_zero());
  verb->add_flag("--gps-filter",
                 options->gps_filter,
                 "hold the GPS filter that runs on the bus against its contract, on a simulated "
                 "drive that this command publishes (needs a bus without sensors)")
      ->excludes("LOG");
  verb->add_option("--rate", options->rate, "of that drive: at most so many times real time")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 100.0))
      ->needs("--gps-filter");
  verb->add_option(
          "--alive",
          options->alive,
          "only tell whether this program (trigpoint_lio_mapper) runs here and is heard on "
          "the bus, for at most --seconds; ends as soon as it is. For health checks")
      ->excludes("LOG")
      ->excludes("--gps-filter");
  verb->footer("Exit code 0: nothing wrong found; 1: see the lines with '!' or 'FAIL'.");
  verb->callback([options, &chosen] {
    chosen = [options] {
      if (!options->alive.empty()) {
        return check_alive(load_config_of(options->input), options->alive, options->seconds);
      }
      if (options->gps_filter) {
        return check_gps_filter(load_config_of(options->input), options->rate);
      }
      return options->input.log.empty() ? examine_bus(*options) : examine_log(*options);
    };
  });
}

}  // namespace trigpoint::cli
