// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "bus_survey.hpp"

#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/cdr.hpp"
#include "trigpoint/bus/loop.hpp"

#include "measurement_checks.hpp"

#include <chrono>
#include <map>
#include <memory>

namespace trigpoint::recording {

namespace {

/// One subscription and what it has heard; changed on the loop's thread only.
class Listener {
 public:
  Listener(bus::Participant& participant, bus::Loop& loop, const KnownTopic& topic)
      : checks_(topic.from_sensor ? MeasurementChecks::Origin::kSensor
                                  : MeasurementChecks::Origin::kOurs),
        subscription_(participant,
                      topic.name,
                      topic.ros_type,
                      topic.qos,
                      [this, &loop](bus::SerializedMessage& cdr, const bus::MessageInfo& info) {
                        loop.post(
                            [this, bytes = std::move(cdr), writer = info.writer_guid] {
                              take(bytes, writer);
                            },
                            bus::WhenFull::kDropOldest);
                      },
                      {[this, &loop](const std::string& writer) {
                         loop.post([this, writer] { matched_.insert(writer); });
                       },
                       {},
                       [this, &loop](const std::string& policy) {
                         loop.post([this, policy] { survey_.refused.insert(policy); });
                       }}) {
    survey_.topic = topic;
  }

  TopicSurvey result(bus::Participant& participant, double duration_s) {
    survey_.rate_hz = static_cast<double>(survey_.messages) / duration_s;
    for (const std::string& writer : matched_) {
      if (!survey_.writers.contains(writer)) {
        survey_.silent_writers.insert(writer);
      }
      if (const auto process = participant.process_of(writer)) {
        survey_.processes[writer] = *process;
      }
    }
    survey_.remarks = checks_.remarks();
    return survey_;
  }

 private:
  void take(const bus::SerializedMessage& bytes, const std::string& writer) {
    ++survey_.messages;
    survey_.bytes += bytes.size();
    survey_.writers.insert(writer);
    check<ImuSample>(bytes) || check<GnssFix>(bytes) || check<PointCloudMessage>(bytes) ||
        check<Odometry>(bytes);
  }

  template <typename Plain>
  bool check(const bus::SerializedMessage& bytes) {
    if (survey_.topic.ros_type != bus::ros_type_name<Plain>()) {
      return false;
    }
    Plain value;
    if (bus::decode_cdr(bytes, value)) {
      checks_.take(value);
      remember(value);
    } else {
      checks_.note("a message could not be decoded as " + survey_.topic.ros_type);
    }
    return true;
  }

  void remember(const GnssFix& fix) { survey_.last_fix = fix; }

  void remember(const Odometry& odometry) {
    const std::string& topic = survey_.topic.name;
    if (topic == "gps/odometry" && odometry.pose_covariance.isZero(0.0)) {
      checks_.note(
          "the pose has a covariance of 0, as if it were perfect: what is not known is 1e6");
    }
    const std::string frame = topic.starts_with("lio/")      ? "odom"
                              : topic.starts_with("fusion/") ? "map"
                                                             : odometry.frame_id;
    if (odometry.frame_id != frame) {
      checks_.note("frame_id is '" + odometry.frame_id + "', expected is '" + frame + "'");
    }
  }

  template <typename Plain>
  void remember(const Plain&) {}

  TopicSurvey survey_;
  std::set<std::string> matched_;
  MeasurementChecks checks_;
  bus::SerializedSubscription subscription_;
};

}  // namespace

std::vector<TopicSurvey> survey_bus(const SurveyOptions& options) {
  bus::Loop loop;
  bus::Participant participant(options.bus, "doctor", options.on_event);
  std::vector<std::unique_ptr<Listener>> listeners;
  for (const KnownTopic& topic : options.topics) {
    listeners.push_back(std::make_unique<Listener>(participant, loop, topic));
  }
  loop.every(std::chrono::nanoseconds(from_seconds(options.duration_s)), [&loop] { loop.stop(); });
  loop.run();
  if (options.on_discovered) {
    options.on_discovered(participant.discovered());
  }
  std::vector<TopicSurvey> surveys;
  for (const auto& listener : listeners) {
    surveys.push_back(listener->result(participant, options.duration_s));
  }
  return surveys;
}

}  // namespace trigpoint::recording
