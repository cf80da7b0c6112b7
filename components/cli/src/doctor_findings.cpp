// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "doctor_findings.hpp"

#include "program_name.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

namespace trigpoint::cli {

namespace {

using bus::DiscoveredEndpoint;
using recording::TopicSurvey;

constexpr std::string_view kRosPrefix = "rt/";

std::string without_prefix(const std::string& dds_topic) {
  return dds_topic.starts_with(kRosPrefix) ? dds_topic.substr(kRosPrefix.size()) : dds_topic;
}

std::string without_slash(const std::string& topic) {
  return topic.starts_with('/') ? topic.substr(1) : topic;
}

/// "sensor_msgs/msg/Imu" from "sensor_msgs::msg::dds_::Imu_"; other names as they are.
std::string ros_type_of(const std::string& dds_type) {
  const std::string middle = "::msg::dds_::";
  const std::size_t at = dds_type.find(middle);
  if (at == std::string::npos || !dds_type.ends_with('_')) {
    return dds_type;
  }
  const std::size_t name = at + middle.size();
  return dds_type.substr(0, at) + "/msg/" + dds_type.substr(name, dds_type.size() - name - 1);
}

std::string owner_of(const DiscoveredEndpoint& endpoint) {
  return owner_text(endpoint.process, endpoint.guid);
}

std::string vendor_of(const std::string& guid) {
  static const std::map<std::string, std::string> kVendors{
      {"010f", "Fast DDS"}, {"0110", "Cyclone DDS"}, {"0101", "RTI Connext"}, {"0103", "OpenDDS"}};
  const auto known = kVendors.find(guid.substr(0, 4));
  return known != kVendors.end() ? known->second : "DDS vendor " + guid.substr(0, 4);
}

bool nobody_writes(const TopicSurvey& survey) {
  return survey.writers.empty() && survey.silent_writers.empty();
}

std::string joined(const std::set<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : ", ") + word;
  }
  return text;
}

/// On a sphere; good to half a percent.
double distance_m(double latitude_a_deg,
                  double longitude_a_deg,
                  double latitude_b_deg,
                  double longitude_b_deg) {
  constexpr double kEarthRadius_m = 6'371'000.0;
  constexpr double kRadiansPerDegree = M_PI / 180.0;
  const double north_rad = (latitude_b_deg - latitude_a_deg) * kRadiansPerDegree;
  const double east_rad = (longitude_b_deg - longitude_a_deg) * kRadiansPerDegree;
  const double haversine =
      std::pow(std::sin(north_rad / 2.0), 2) + std::cos(latitude_a_deg * kRadiansPerDegree) *
                                                   std::cos(latitude_b_deg * kRadiansPerDegree) *
                                                   std::pow(std::sin(east_rad / 2.0), 2);
  return 2.0 * kEarthRadius_m * std::asin(std::min(1.0, std::sqrt(haversine)));
}

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f", value);
  return text.data();
}

void append(std::vector<Finding>& all, std::vector<Finding> more) {
  all.insert(all.end(), more.begin(), more.end());
}

/// What a reader asks for and its writer does not offer; empty when they match.
std::string missing_policy(const DiscoveredEndpoint& writer, const DiscoveredEndpoint& reader) {
  if (reader.reliability > writer.reliability) {
    return "reliable samples, and the writer offers best effort: set the reader to best effort";
  }
  return reader.durability > writer.durability
             ? "transient local samples, and the writer offers volatile: set the reader to volatile"
             : "";
}

}  // namespace

std::vector<Finding> wrong_types(const std::vector<TopicSurvey>& surveys,
                                 const std::vector<DiscoveredEndpoint>& endpoints) {
  std::vector<Finding> found;
  for (const TopicSurvey& survey : surveys) {
    const std::string name = without_slash(survey.topic.name);
    for (const DiscoveredEndpoint& endpoint : endpoints) {
      if (!endpoint.writes || without_prefix(endpoint.dds_topic) != name) {
        continue;
      }
      const std::string type = ros_type_of(endpoint.dds_type);
      if (!endpoint.dds_topic.starts_with(kRosPrefix)) {
        found.push_back({survey.topic.name,
                         owner_of(endpoint) + " writes it under the DDS name '" +
                             endpoint.dds_topic + "': ROS 2's name is 'rt/" + name + "'"});
      } else if (type != survey.topic.ros_type) {
        found.push_back({survey.topic.name,
                         owner_of(endpoint) + " writes it as " + type + ", " +
                             survey.topic.ros_type +
                             " is expected: they never match; give that topic another name"});
      }
    }
  }
  return found;
}

std::vector<Finding> inputs_under_other_names(const std::vector<TopicSurvey>& surveys,
                                              const std::vector<DiscoveredEndpoint>& endpoints) {
  std::set<std::string> ours;
  for (const TopicSurvey& survey : surveys) {
    ours.insert(without_slash(survey.topic.name));
  }
  std::vector<Finding> found;
  for (const TopicSurvey& survey : surveys) {
    std::set<std::string> others;
    for (const DiscoveredEndpoint& endpoint : endpoints) {
      const std::string name = without_prefix(endpoint.dds_topic);
      if (survey.topic.from_sensor && nobody_writes(survey) && endpoint.writes &&
          ros_type_of(endpoint.dds_type) == survey.topic.ros_type && !ours.contains(name)) {
        others.insert(name);
      }
    }
    if (!others.empty()) {
      found.push_back({survey.topic.name,
                       "nobody writes it, but its type is written on " + joined(others) +
                           ": if that is the sensor, give its name in robot: (points_topic, "
                           "imu_topic, fix_topic)"});
    }
  }
  return found;
}

std::vector<Finding> readers_in_vain(const std::vector<DiscoveredEndpoint>& endpoints) {
  std::vector<Finding> found;
  for (const DiscoveredEndpoint& writer : endpoints) {
    for (const DiscoveredEndpoint& reader : endpoints) {
      if (!writer.writes || reader.writes || writer.dds_topic != reader.dds_topic ||
          writer.dds_type != reader.dds_type) {
        continue;
      }
      const std::string missing = missing_policy(writer, reader);
      if (!missing.empty()) {
        found.push_back({without_prefix(writer.dds_topic),
                         owner_of(reader) + " hears nothing of " + owner_of(writer) +
                             ": it asks for " + missing});
      }
    }
  }
  return found;
}

std::vector<Finding> several_writers(const std::vector<TopicSurvey>& surveys) {
  static const std::set<std::string> kForMany{
      "gps/odometry", "gps/status", "datum", "tf", "tf_static", "diagnostics", "clock_probe"};
  std::vector<Finding> found;
  for (const TopicSurvey& survey : surveys) {
    // One that was killed is held to be there until its lease runs out.
    const std::size_t writers =
        survey.writers.size() + survey.silent_writers.size() - survey.predecessors.size();
    if (writers > 1 && !kForMany.contains(survey.topic.name)) {
      found.push_back({survey.topic.name,
                       std::to_string(writers) +
                           " writers, whose messages are mixed: end all but one, or take another "
                           "ROS_DOMAIN_ID"});
    }
  }
  return found;
}

std::vector<Finding> swapped_positions(const std::vector<TopicSurvey>& surveys) {
  constexpr double kSameSite_m = 200e3;
  const auto datum = std::find_if(surveys.begin(), surveys.end(), [](const TopicSurvey& survey) {
    return survey.topic.name == "datum";
  });
  std::vector<Finding> found;
  if (datum == surveys.end() || !datum->last_fix) {
    return found;
  }
  const GnssFix& at = *datum->last_fix;
  for (const TopicSurvey& survey : surveys) {
    if (!survey.topic.from_sensor || !survey.last_fix) {
      continue;
    }
    const GnssFix& fix = *survey.last_fix;
    const double as_it_is_m =
        distance_m(at.latitude_deg, at.longitude_deg, fix.latitude_deg, fix.longitude_deg);
    const double exchanged_m =
        distance_m(at.latitude_deg, at.longitude_deg, fix.longitude_deg, fix.latitude_deg);
    if (as_it_is_m > kSameSite_m) {
      found.push_back({survey.topic.name,
                       number(as_it_is_m / 1e3) + " km from the datum" +
                           (exchanged_m < kSameSite_m ? ": latitude and longitude are swapped"
                                                      : ": is the datum that of another site?")});
    }
  }
  return found;
}

std::vector<Finding> slow_inputs(const std::vector<TopicSurvey>& surveys,
                                 const RobotConfig& robot) {
  const std::map<std::string, double> least_hz{
      {robot.points_topic, 4.0}, {robot.imu_topic, 50.0}, {robot.fix_topic, 0.5}};
  std::vector<Finding> found;
  for (const TopicSurvey& survey : surveys) {
    const auto least = least_hz.find(survey.topic.name);
    // The least rate brings a first message and one more each period: nothing is called slow soon
    // after its first message.
    if (least != least_hz.end() && survey.messages > 0 &&
        static_cast<double>(survey.messages) < least->second * survey.heard_s) {
      found.push_back(
          {survey.topic.name,
           number(survey.rate_hz) + " Hz; at least " + number(least->second) +
               " are expected: are messages lost, or is the sensor set to a low rate?"});
    }
  }
  return found;
}

std::vector<Finding> findings_of(const std::vector<TopicSurvey>& surveys,
                                 const std::vector<DiscoveredEndpoint>& endpoints,
                                 const RobotConfig& robot) {
  std::vector<Finding> all = wrong_types(surveys, endpoints);
  append(all, inputs_under_other_names(surveys, endpoints));
  append(all, readers_in_vain(endpoints));
  append(all, several_writers(surveys));
  append(all, swapped_positions(surveys));
  const bool simulated = std::any_of(surveys.begin(), surveys.end(), [](const TopicSurvey& survey) {
    return survey.topic.name == "clock" && !nobody_writes(survey);
  });
  if (!simulated) {  // else a rate against the wall clock says nothing
    append(all, slow_inputs(surveys, robot));
  }
  return all;
}

std::string buffer_advice(std::int64_t limit_bytes, std::int64_t wanted_bytes) {
  return limit_bytes >= wanted_bytes
             ? ""
             : "socket buffers are limited to " + std::to_string(limit_bytes) +
                   " bytes: clouds will be paced and repaired; better: sysctl -w "
                   "net.core.rmem_max=" +
                   std::to_string(wanted_bytes);
}

std::vector<std::string> who_is_there(const std::vector<DiscoveredEndpoint>& endpoints) {
  struct Party {
    std::string name;
    std::set<std::string> writes;
    std::set<std::string> reads;
  };

  std::map<std::string, Party> parties;  // by participant
  for (const DiscoveredEndpoint& endpoint : endpoints) {
    Party& party = parties[endpoint.guid.substr(0, 24)];
    party.name = owner_of(endpoint) + ", " + vendor_of(endpoint.guid);
    (endpoint.writes ? party.writes : party.reads).insert(without_prefix(endpoint.dds_topic));
  }
  std::vector<std::string> lines;
  for (const auto& [participant, party] : parties) {
    lines.push_back(party.name + (party.writes.empty() ? "" : "; writes " + joined(party.writes)) +
                    (party.reads.empty() ? "" : "; reads " + joined(party.reads)));
  }
  return lines;
}

}  // namespace trigpoint::cli
