// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "topic_choice.hpp"

#include <algorithm>
#include <numeric>
#include <string_view>
#include <utility>

namespace trigpoint::recording {

namespace {

std::string_view without_slash(std::string_view name) {
  return name.starts_with('/') ? name.substr(1) : name;
}

/// Levenshtein's edit distance.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

std::string list_of(const std::vector<TopicSummary>& topics) {
  std::string text;
  for (const auto& topic : topics) {
    text += (text.empty() ? "" : ", ") + topic.topic + " (" + topic.type + ", " +
            std::to_string(topic.messages) + ")";
  }
  return text;
}

/// One of the inputs: its name by configuration and its type.
struct Wanted {
  const char* key;
  std::string topic;
  const char* type;
  bool required;
};

/// The nearest name, among topics of the right type when there are such.
std::string suggestion(const std::vector<TopicSummary>& topics, const Wanted& wanted) {
  std::vector<TopicSummary> candidates;
  std::copy_if(
      topics.begin(), topics.end(), std::back_inserter(candidates), [&](const TopicSummary& topic) {
        return topic.type == wanted.type;
      });
  if (candidates.empty()) {
    return std::string("; no topic of type ") + wanted.type + " is in the log.";
  }
  const auto nearest = std::min_element(
      candidates.begin(), candidates.end(), [&](const TopicSummary& a, const TopicSummary& b) {
        return distance(without_slash(a.topic), without_slash(wanted.topic)) <
               distance(without_slash(b.topic), without_slash(wanted.topic));
      });
  return "; did you mean '" + nearest->topic + "'?";
}

std::string find(const LogSummary& log, const Wanted& wanted) {
  const auto found =
      std::find_if(log.topics.begin(), log.topics.end(), [&](const TopicSummary& topic) {
        return without_slash(topic.topic) == without_slash(wanted.topic);
      });
  const std::string what = log.path + ": topic '" + wanted.topic + "' (" + wanted.key + ") ";
  if (found == log.topics.end()) {
    if (!wanted.required) {
      return "";
    }
    throw LogError(what + "is not in the log" + suggestion(log.topics, wanted) +
                   " The log has: " + list_of(log.topics));
  }
  if (found->type != wanted.type) {
    throw LogError(what + "is of type " + found->type + ", expected " + wanted.type +
                   suggestion(log.topics, wanted));
  }
  if (found->messages == 0 && wanted.required) {
    throw LogError(what + "is in the log but has no messages");
  }
  return found->topic;
}

}  // namespace

std::string ros2_type_name(const std::string& type) {
  const auto slash = type.find('/');
  const bool ros1 = slash != std::string::npos && type.find('/', slash + 1) == std::string::npos;
  return ros1 ? type.substr(0, slash) + "/msg" + type.substr(slash) : type;
}

TopicChoice choose_topics(const LogSummary& log,
                          const RobotConfig& robot,
                          const LogOptions& options) {
  const bool empty = std::all_of(log.topics.begin(),
                                 log.topics.end(),
                                 [](const TopicSummary& topic) { return topic.messages == 0; });
  if (empty && !log.faults.empty()) {
    throw LogError(log.faults.front() + "; nothing is left to be used");
  }
  if (empty) {
    throw LogError(log.path + ": the log is empty (no message in " +
                   std::to_string(log.topics.size()) + " topics)");
  }
  TopicChoice choice;
  choice.points = find(log,
                       {"robot.points_topic",
                        robot.points_topic,
                        "sensor_msgs/msg/PointCloud2",
                        options.require_points});
  choice.imu =
      find(log, {"robot.imu_topic", robot.imu_topic, "sensor_msgs/msg/Imu", options.require_imu});
  choice.twist_is_odometry = robot.twist_message == "Odometry";
  if (!robot.twist_topic.empty()) {
    choice.twist = find(log,
                        {"robot.twist_topic",
                         robot.twist_topic,
                         choice.twist_is_odometry ? "nav_msgs/msg/Odometry"
                                                  : "geometry_msgs/msg/TwistWithCovarianceStamped",
                         options.require_aiding});
  }
  if (!robot.yaw_topic.empty()) {
    choice.yaw = find(
        log, {"robot.yaw_topic", robot.yaw_topic, "sensor_msgs/msg/Imu", options.require_aiding});
  }
  choice.fix = find(
      log, {"robot.fix_topic", robot.fix_topic, "sensor_msgs/msg/NavSatFix", options.require_fix});
  return choice;
}

}  // namespace trigpoint::recording
