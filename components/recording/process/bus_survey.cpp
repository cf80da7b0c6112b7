// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "bus_survey.hpp"

#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/cdr.hpp"
#include "trigpoint/bus/loop.hpp"

#include "measurement_checks.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>

namespace trigpoint::recording {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_between(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

/// One subscription and what it has heard; changed on the loop's thread only.
class Listener {
 public:
  Listener(bus::Participant& participant, bus::Loop& loop, const KnownTopic& topic)
      : origin_(topic.from_sensor ? MeasurementChecks::Origin::kSensor
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
                      {[this, &loop, &participant](const std::string& writer) {
                         loop.post([this, &participant, writer] { find(writer, participant); });
                       },
                       [this, &loop](const std::string& writer) {
                         loop.post([this, writer] { lose(writer); });
                       },
                       [this, &loop](const std::string& policy) {
                         loop.post([this, policy] { survey_.refused.insert(policy); });
                       }}) {
    survey_.topic = topic;
  }

  TopicSurvey result(bus::Participant& participant) {
    const Clock::time_point now = Clock::now();
    if (first_heard_) {
      survey_.heard_s = seconds_between(*first_heard_, now);
    }
    if (survey_.messages > 1) {
      survey_.rate_hz = static_cast<double>(survey_.messages - 1) / survey_.heard_s;
    }
    for (const auto& [writer, newest] : newest_) {
      if (survey_.writers.contains(writer) &&
          std::any_of(came_.begin(), came_.end(), [at = newest](const auto& other) {
            return other.second > at;
          })) {
        survey_.predecessors.insert(writer);
      }
      survey_.silent_s[writer] = seconds_between(newest, now);
      if (!survey_.writers.contains(writer)) {
        survey_.silent_writers.insert(writer);
      }
      keep_process(writer, participant);
    }
    if (without_track_since_) {
      survey_.without_track_s = seconds_between(*without_track_since_, now);
    }
    for (const auto& [writer, checks] : checks_) {
      for (const std::string& remark : checks.remarks()) {
        if (std::find(survey_.remarks.begin(), survey_.remarks.end(), remark) ==
            survey_.remarks.end()) {
          survey_.remarks.push_back(remark);
        }
      }
    }
    return survey_;
  }

 private:
  void find(const std::string& writer, bus::Participant& participant) {
    const Clock::time_point now = Clock::now();
    newest_.emplace(writer, now);
    came_.emplace(writer, now);
    if (!found_) {
      found_ = now;
    }
    survey_.silent_before_leaving_s.erase(writer);  // back again
    keep_process(writer, participant);              // nobody tells once it has left
  }

  void lose(const std::string& writer) {
    if (const auto newest = newest_.find(writer); newest != newest_.end()) {
      survey_.silent_before_leaving_s[writer] = seconds_between(newest->second, Clock::now());
    }
  }

  void keep_process(const std::string& writer, bus::Participant& participant) {
    if (const auto process = participant.process_of(writer)) {
      survey_.processes[writer] = *process;
    }
  }

  void take(const bus::SerializedMessage& bytes, const std::string& writer) {
    ++survey_.messages;
    survey_.bytes += bytes.size();
    survey_.writers.insert(writer);
    const Clock::time_point now = Clock::now();
    newest_[writer] = now;
    came_.emplace(writer, now);
    first_heard_ = first_heard_.value_or(now);
    LioStatus status;
    if (survey_.topic.ros_type == bus::ros_type_name<LioStatus>() &&
        bus::decode_cdr(bytes, status)) {
      remember(status);
      return;
    }
    MeasurementChecks& checks = checks_.try_emplace(writer, origin_).first->second;
    check<ImuSample>(bytes, checks) || check<GnssFix>(bytes, checks) ||
        check<PointCloudMessage>(bytes, checks) || check<Odometry>(bytes, checks);
  }

  template <typename Plain>
  bool check(const bus::SerializedMessage& bytes, MeasurementChecks& checks) {
    if (survey_.topic.ros_type != bus::ros_type_name<Plain>()) {
      return false;
    }
    Plain value;
    if (bus::decode_cdr(bytes, value)) {
      checks.take(value);
      remember(value, checks);
    } else {
      checks.note("a message could not be decoded as " + survey_.topic.ros_type);
    }
    return true;
  }

  void remember(const GnssFix& fix, MeasurementChecks&) { survey_.last_fix = fix; }

  void remember(const Odometry& odometry, MeasurementChecks& checks) {
    const std::string& topic = survey_.topic.name;
    if (topic == "gps/odometry" && odometry.pose_covariance.isZero(0.0)) {
      checks.note(
          "the pose has a covariance of 0, as if it were perfect: what is not known is 1e6");
    }
    const std::string frame = topic.starts_with("lio/")      ? "odom"
                              : topic.starts_with("fusion/") ? "map"
                                                             : odometry.frame_id;
    if (odometry.frame_id != frame) {
      checks.note("frame_id is '" + odometry.frame_id + "', expected is '" + frame + "'");
    }
  }

  void remember(const LioStatus& status) {
    const bool has_track = status.health == LioHealth::kOk || status.health == LioHealth::kDegraded;
    if (has_track) {
      without_track_since_.reset();
    } else if (!without_track_since_) {  // nor had it one when it was found, as far as it told
      without_track_since_ = survey_.last_lio_status ? Clock::now() : found_.value_or(Clock::now());
    }
    survey_.last_lio_status = status;
  }

  template <typename Plain>
  void remember(const Plain&, MeasurementChecks&) {}

  TopicSurvey survey_;
  std::map<std::string, Clock::time_point> newest_;  ///< message by writer, or when it was found
  std::map<std::string, Clock::time_point> came_;    ///< when a writer was found, or first heard
  std::optional<Clock::time_point> found_;           ///< the first writer
  std::optional<Clock::time_point> first_heard_;     ///< the first message of anybody
  std::optional<Clock::time_point> without_track_since_;
  MeasurementChecks::Origin origin_;
  /// By writer: two GPS filters, of which each goes on in its own time, are no fault.
  std::map<std::string, MeasurementChecks> checks_;
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
    surveys.push_back(listener->result(participant));
  }
  return surveys;
}

}  // namespace trigpoint::recording
