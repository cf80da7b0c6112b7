// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "silent_programs.hpp"

#include "trigpoint/bus/participant_of.hpp"

#include "program_name.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <map>
#include <set>

namespace trigpoint::cli {

namespace {

using recording::TopicSurvey;

/// Two words missed.
constexpr double kSilent_s = 2.0;
/// One that ends with nothing left to write leaves within a second of its last word.
constexpr double kLeftInSilence_s = 1.5;

/// What tells that a program is one of these, and what its silence is told under.
constexpr std::array<const char*, 4> kMainTopics{"lio/status",
                                                 "gps/odometry",
                                                 "fusion/status",
                                                 "clock_probe"};

constexpr const char* kWord = "diagnostics";

std::string seconds_text(double seconds) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f s", seconds);
  return text.data();
}

std::string joined(const std::set<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : ", ") + word;
  }
  return text;
}

bool comes(const std::vector<TopicSurvey>& surveys, const std::string& topic) {
  const auto survey = std::find_if(surveys.begin(), surveys.end(), [&](const TopicSurvey& each) {
    return each.topic.name == topic;
  });
  return survey != surveys.end() && survey->messages > 0 &&
         std::any_of(survey->silent_s.begin(), survey->silent_s.end(), [](const auto& silence) {
           return silence.second < kSilent_s;
         });
}

/// All that one participant writes of our topics.
struct Party {
  std::string main_topic;  ///< empty: none of ours
  std::set<std::string> topics;
  double silent_s{1e9};  ///< the shortest of all its topics
  bool gives_its_word{false};
  bool left_in_silence{false};
  bool left{false};
  std::optional<unsigned> process;
};

std::map<std::string, Party> parties_of(const std::vector<TopicSurvey>& surveys) {
  std::map<std::string, Party> parties;
  for (const TopicSurvey& survey : surveys) {
    const std::string& topic = survey.topic.name;
    for (const auto& [writer, silent_s] : survey.silent_s) {
      Party& party = parties[bus::participant_of(writer)];
      party.topics.insert(topic);
      party.silent_s = std::min(party.silent_s, silent_s);
      party.gives_its_word = party.gives_its_word || topic == kWord;
      if (std::find(kMainTopics.begin(), kMainTopics.end(), topic) != kMainTopics.end()) {
        party.main_topic = topic;
      }
      if (const auto left = survey.silent_before_leaving_s.find(writer);
          left != survey.silent_before_leaving_s.end()) {
        party.left = true;
        party.left_in_silence =
            party.left_in_silence || (topic == kWord && left->second > kLeftInSilence_s);
      }
      if (const auto process = survey.processes.find(writer); process != survey.processes.end()) {
        party.process = process->second;
      }
    }
  }
  return parties;
}

std::optional<char> state_of(const Party& party, const std::vector<LocalProcess>& local) {
  for (const LocalProcess& process : local) {
    if (party.process == process.number) {
      return process.state;
    }
  }
  return std::nullopt;
}

std::string named(const Party& party, const std::string& participant) {
  return owner_text(party.process, participant);
}

/// What the bus takes its environment for; nothing when that cannot be read or is no number.
std::optional<int> domain_in_environment(const LocalProcess& process) {
  if (!process.domain || process.domain->empty()) {
    return process.domain ? std::optional(0) : std::nullopt;
  }
  int domain = 0;
  const char* end = process.domain->data() + process.domain->size();
  const auto [read_to, error] = std::from_chars(process.domain->data(), end, domain);
  return error == std::errc{} && read_to == end ? std::optional(domain) : std::nullopt;
}

/// A debugger's hold is another state (t) since Linux 2.6.33.
bool is_stopped(std::optional<char> state) {
  return state == 'T' || state == 't';
}

/// A clause: what a silent process of this kind does, and what to do about it.
std::string remedy(const std::string& main_topic, std::optional<char> state, unsigned process) {
  if (state == 'T') {
    return "it is stopped by a signal (SIGSTOP, Ctrl-Z): kill -CONT " + std::to_string(process) +
           " lets it go on";
  }
  if (state == 't') {
    return "a debugger holds it, and alone can let it go on";
  }
  if (state == 'D') {
    return "it waits for its disk";
  }
  return (main_topic == "lio/status"
              ? std::string("it looks for its place in the map, in which it may be silent for 20 "
                            "s, or ends and writes what it has, or hangs. Listen again with "
                            "--seconds 25; if it is silent then too, ")
              : std::string("it hangs, or gets no processor: ")) +
         "end it and start it again, it goes on in its session (trigpoint_supervise does so by "
         "itself)";
}

std::string inputs_text(const std::vector<std::string>& topics) {
  std::string text;
  for (const std::string& topic : topics) {
    text += (text.empty() ? ", while " : " and ") + topic;
  }
  return text.empty() ? "" : text + (topics.size() > 1 ? " come" : " comes");
}

std::vector<std::string> inputs_that_come(const std::vector<TopicSurvey>& surveys,
                                          const std::string& main_topic,
                                          const RobotConfig& robot) {
  std::vector<std::string> inputs;
  if (main_topic == "lio/status") {
    inputs = {robot.points_topic, robot.imu_topic};
  } else if (main_topic == "gps/odometry") {
    inputs = {robot.imu_topic, robot.fix_topic};
  } else if (main_topic == "fusion/status") {
    inputs = {robot.fix_topic, "gps/odometry", "lio/odometry"};
  }
  std::erase_if(inputs, [&](const std::string& topic) { return !comes(surveys, topic); });
  return inputs;
}

Finding silence_of(const Party& party,
                   const std::string& participant,
                   const std::vector<TopicSurvey>& surveys,
                   const std::vector<LocalProcess>& local,
                   const RobotConfig& robot) {
  return {party.main_topic,
          named(party, participant) + " is there and has said nothing for " +
              seconds_text(party.silent_s) + " (on " + joined(party.topics) + ")" +
              inputs_text(inputs_that_come(surveys, party.main_topic, robot)) + ": " +
              remedy(party.main_topic, state_of(party, local), party.process.value_or(0))};
}

/// A filter that lives, or tells nothing of its life, and does not do what it is there for.
std::vector<Finding> silent_filters(const std::vector<TopicSurvey>& surveys,
                                    const std::map<std::string, Party>& parties,
                                    const RobotConfig& robot) {
  std::vector<Finding> found;
  if (!comes(surveys, robot.imu_topic) || !comes(surveys, robot.fix_topic)) {
    return found;
  }
  for (const TopicSurvey& survey : surveys) {
    if (survey.topic.name != "gps/odometry") {
      continue;
    }
    for (const auto& [writer, silent_s] : survey.silent_s) {
      const std::string participant = bus::participant_of(writer);
      const Party& party = parties.at(participant);
      const bool told_already = party.gives_its_word && party.silent_s > kSilent_s;
      if (silent_s > kSilent_s && !told_already && !party.left) {
        found.push_back({survey.topic.name,
                         named(party, participant) + " has published none for " +
                             seconds_text(silent_s) + ", while " + robot.imu_topic + " and " +
                             robot.fix_topic +
                             " come: it refuses the fixes or waits for more of them (gps/status "
                             "and its log say why), or hangs"});
      }
    }
  }
  return found;
}

std::string refusals(const LioStatus& status) {
  std::string text;
  for (const auto& [reason, count] : status.scans_refused) {
    text += (text.empty() ? "; refused: " : ", ") + reason + " " + std::to_string(count);
  }
  return text;
}

/// After "has told of no track for 4.0 s, and says".
std::string why_without_track(const LioStatus& status) {
  const std::string counts = " (" + std::to_string(status.scans_received) +
                             " clouds received so far, " + std::to_string(status.scans_used) +
                             " used" + refusals(status) + ")";
  if (status.health == LioHealth::kLost) {
    return "LOST: it is looking for its place in its map" + counts +
           ". Stand still where it has been before; after lio_mapper.recovery.give_up_s a new odom "
           "epoch begins";
  }
  if (status.health == LioHealth::kStale) {
    return "STALE" + counts + ": its log says what it lacks";
  }
  if (status.scans_used > 0) {
    return "INIT: it is looking for its place in the map of the session that it goes on with" +
           counts +
           ". Where it does not find it, after lio_mapper.recovery.attempts, a new odom epoch "
           "begins";
  }
  return "INIT: it has not begun" + counts +
         ". It takes a second of clouds and IMU samples whose stamps agree; its log says what it "
         "lacks";
}

}  // namespace

std::vector<Finding> silent_on_the_bus(const std::vector<TopicSurvey>& surveys,
                                       const std::vector<LocalProcess>& local,
                                       const RobotConfig& robot) {
  const std::map<std::string, Party> parties = parties_of(surveys);
  std::vector<Finding> found;
  for (const auto& [participant, party] : parties) {
    if (party.main_topic.empty() || !party.gives_its_word || party.silent_s <= kSilent_s) {
      continue;
    }
    const bool is_here = state_of(party, local).has_value();
    if (!party.left || is_here) {
      found.push_back(silence_of(party, participant, surveys, local, robot));
    } else if (party.left_in_silence) {
      found.push_back({party.main_topic,
                       named(party, participant) + " was there, said nothing any more and left " +
                           "the bus: it has ended and wrote for long what it had, or it was killed "
                           "or stopped, or its network is gone (its log, or that of its "
                           "supervisor, says which)"});
    }
  }
  const std::vector<Finding> filters = silent_filters(surveys, parties, robot);
  found.insert(found.end(), filters.begin(), filters.end());
  return found;
}

std::vector<Finding> not_on_the_bus(const std::vector<TopicSurvey>& surveys,
                                    const std::vector<LocalProcess>& local,
                                    int domain,
                                    double listened_s) {
  std::set<unsigned> on_the_bus;
  for (const TopicSurvey& survey : surveys) {
    for (const auto& [writer, process] : survey.processes) {
      on_the_bus.insert(process);
    }
  }
  std::vector<Finding> found;
  for (const LocalProcess& process : local) {
    if (domain_in_environment(process) != domain || process.age_s <= listened_s ||
        on_the_bus.contains(process.number)) {
      continue;
    }
    const bool its_state_tells = is_stopped(process.state) || process.state == 'D';
    found.push_back(
        {process.program,
         "process " + std::to_string(process.number) + " runs here " +
             (process.domain->empty() ? std::string("without ROS_DOMAIN_ID")
                                      : "with ROS_DOMAIN_ID " + *process.domain) +
             " and was not found on the bus in " + seconds_text(listened_s) + ": " +
             (its_state_tells
                  ? remedy("", process.state, process.number)
                  : "it is for another bus (a container's, or its configuration has another "
                    "bus.domain_id, network_interface or security_folder than this "
                    "command's), or it still starts, or hangs"),
         is_stopped(process.state)});
  }
  return found;
}

std::vector<Finding> mapper_without_track(const std::vector<TopicSurvey>& surveys,
                                          const RobotConfig& robot) {
  std::vector<Finding> found;
  if (!comes(surveys, robot.points_topic) || !comes(surveys, robot.imu_topic)) {
    return found;
  }
  const std::map<std::string, Party> parties = parties_of(surveys);
  for (const TopicSurvey& survey : surveys) {
    if (survey.last_lio_status && survey.without_track_s > kSilent_s && !survey.writers.empty()) {
      const std::string participant = bus::participant_of(*survey.writers.begin());
      found.push_back({survey.topic.name,
                       named(parties.at(participant), participant) + " has told of no track for " +
                           seconds_text(survey.without_track_s) + ", while " + robot.points_topic +
                           " and " + robot.imu_topic + " come, and says " +
                           why_without_track(*survey.last_lio_status)});
    }
  }
  return found;
}

}  // namespace trigpoint::cli
