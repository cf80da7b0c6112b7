// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "bus_guard.hpp"

#include "bus_trial.hpp"
#include "known_topics.hpp"
#include "program_name.hpp"

#include <chrono>
#include <set>
#include <stdexcept>

namespace trigpoint::cli {

namespace {

// Processes on one computer find each other within about 0.2 s; the rest is for a loaded one.
constexpr double kListen_s = 1.5;

std::vector<recording::KnownTopic> guarded_topics(const RobotConfig& robot, Guarded guarded) {
  std::set<std::string> names{robot.points_topic, robot.imu_topic, robot.fix_topic};
  names.insert("clock");
  if (guarded == Guarded::kSensorsAndCores) {
    names.insert({"gps/odometry", "lio/odometry", "fusion/odometry"});
  }
  std::vector<recording::KnownTopic> guards = recording::known_topics(robot);
  std::erase_if(guards, [&names](const auto& topic) { return !names.contains(topic.name); });
  if (guards.size() != names.size()) {
    throw std::logic_error("a guarded topic is not among the known ones");
  }
  return guards;
}

/// What the bus says of a key of the configuration is a mistake of the user's.
template <typename Work>
auto blaming_the_configuration(Work work) {
  try {
    return work();
  } catch (const ConfigError&) {
    throw;
  } catch (const std::runtime_error& error) {
    if (std::string(error.what()).starts_with("bus.")) {
      throw ConfigError(error.what());
    }
    throw;
  }
}

std::vector<recording::TopicSurvey> listen(const SystemConfig& config, Guarded guarded) {
  recording::SurveyOptions survey;
  survey.bus = config.bus;
  survey.topics = guarded_topics(config.cores.robot, guarded);
  survey.duration_s = kListen_s;
  return blaming_the_configuration([&] { return recording::survey_bus(survey); });
}

}  // namespace

BusFindings look_for_writers(const SystemConfig& config, Guarded guarded) {
  const auto begin = std::chrono::steady_clock::now();
  const std::vector<recording::TopicSurvey> surveys = listen(config, guarded);
  const std::chrono::duration<double> listened = std::chrono::steady_clock::now() - begin;
  BusFindings findings;
  findings.interrupted = listened.count() < kListen_s;
  for (const recording::TopicSurvey& survey : surveys) {
    std::set<std::string> owners;
    for (const auto& guids : {survey.writers, survey.silent_writers}) {
      for (const std::string& guid : guids) {
        owners.insert(owner_of(guid, survey));
      }
    }
    std::string list;
    for (const std::string& owner : owners) {
      list += (list.empty() ? "" : ", ") + owner;
    }
    if (!list.empty()) {
      findings.writers.push_back(survey.topic.name + ": " + list);
    }
  }
  return findings;
}

std::string try_to_join(const SystemConfig& config) {
  return blaming_the_configuration([&] { return recording::try_to_join(config.bus); });
}

std::string refusal(const BusFindings& findings, const SystemConfig& config) {
  std::string text =
      "others write already on DDS domain " + std::to_string(bus::domain_of(config.bus)) + ":\n";
  for (const std::string& line : findings.writers) {
    text += "  " + line + "\n";
  }
  return text + "Both would be mixed: end them, or take another domain (ROS_DOMAIN_ID=N).";
}

std::string owner_of(const std::string& writer_guid, const recording::TopicSurvey& survey) {
  if (const auto process = survey.processes.find(writer_guid); process != survey.processes.end()) {
    const std::string program = program_of(process->second);
    if (program.starts_with("trigpoint")) {
      return program + " (process " + std::to_string(process->second) + ")";
    }
  }
  return "another program (DDS writer " + writer_guid.substr(0, 24) + ")";
}

}  // namespace trigpoint::cli
