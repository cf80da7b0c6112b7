// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "player.hpp"

#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "pace.hpp"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <thread>
#include <variant>

namespace trigpoint::recording {

namespace {

namespace topics = bus::topics;
using WallClock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr Nanoseconds kClockPeriod_ns = 10'000'000;
/// A reader's history holds a thousand samples: ask well before that whether all have come.
constexpr std::uint64_t kImuBurst = 400;
constexpr std::chrono::milliseconds kVerdictGrace{20};
/// For whoever keeps a process that died running.
constexpr std::chrono::seconds kReturn{15};
/// At a fixed rate the log does not wait for one that is slow or dead, beyond what a reader's
/// history makes up for.
constexpr std::chrono::milliseconds kLiveGrace{50};

class Player {
 public:
  explicit Player(const PlayOptions& options)
      : options_(options),
        participant_(options.bus, "player", options.on_event),
        points_(participant_, topics::points.renamed(options.robot.points_topic)),
        imu_(participant_, topics::imu.renamed(options.robot.imu_topic)),
        fixes_(participant_, topics::fix.renamed(options.robot.fix_topic)),
        clock_(participant_, topics::clock),
        lio_status_(participant_,
                    topics::lio_status,
                    [this](const trigpoint_msgs::msg::LioStatus& m, const bus::MessageInfo& info) {
                      pace_.on_lio_status(bus::from_message(m), info.writer_guid);
                    }),
        gps_status_(participant_,
                    topics::gps_status,
                    [this](const trigpoint_msgs::msg::GpsStatus& m, const bus::MessageInfo& info) {
                      pace_.on_gps_status(bus::from_message(m), info.writer_guid);
                    }),
        fusion_status_(participant_,
                       topics::fusion_status,
                       [this](const trigpoint_msgs::msg::FusionStatus& m, const bus::MessageInfo&) {
                         pace_.on_fusion_status(bus::from_message(m));
                       }) {}

  /// Twists and yaws are published where the robot has topics for them and the log has messages;
  /// a yaw that is the IMU's own orientation is in the IMU's message already.
  void advertise_aiding() {
    const RobotConfig& robot = options_.robot;
    if (!robot.twist_topic.empty() && robot.twist_message == "Odometry") {
      odometry_twists_.emplace(participant_, topics::twist_odometry.renamed(robot.twist_topic));
    } else if (!robot.twist_topic.empty()) {
      twists_.emplace(participant_, topics::twist.renamed(robot.twist_topic));
    }
    if (!robot.yaw_topic.empty() && robot.yaw_topic != robot.imu_topic) {
      yaws_.emplace(participant_, topics::yaw.renamed(robot.yaw_topic));
    }
  }

  /// The mapper, the filter and the gate must listen and be heard before the first message.
  void wait_for_peers() {
    const auto deadline = WallClock::now() + options_.wait_for_peers;
    const auto complete = [this] {
      return points_.matched() > 0 && imu_.matched() > 1 && fixes_.matched() > 1 &&
             lio_status_.matched() > 0 && gps_status_.matched() > 0 && fusion_status_.matched() > 0;
    };
    while (!complete() && WallClock::now() < deadline && !stop_requested()) {
      std::this_thread::sleep_for(20ms);
    }
    refuse_two_of_a_kind();
    if (!options_.allow_no_reader && !stop_requested() &&
        points_.matched() + imu_.matched() + fixes_.matched() == 0) {
      throw std::runtime_error("nobody listens to " + options_.robot.points_topic + ", " +
                               options_.robot.imu_topic + " or " + options_.robot.fix_topic +
                               " on DDS domain " + std::to_string(bus::domain_of(options_.bus)) +
                               " after " + std::to_string(options_.wait_for_peers.count()) +
                               " s; start the three processes first (is ROS_DOMAIN_ID the same?)");
    }
    if (!complete() && !stop_requested()) {
      tell("peers_missing",
           "after " + std::to_string(options_.wait_for_peers.count()) + " s: points has " +
               std::to_string(points_.matched()) + " readers (1 expected), imu " +
               std::to_string(imu_.matched()) + " (2), gps/fix " +
               std::to_string(fixes_.matched()) + " (2); playing all the same");
    }
    const auto settled = WallClock::now() + options_.settle;
    while (WallClock::now() < settled && !stop_requested()) {
      std::this_thread::sleep_for(20ms);
    }
    pace_.begin();
  }

  void publish(const LogEntry& entry) {
    if (first_ns_ == 0) {
      first_ns_ = entry.receive_ns;
      started_ = WallClock::now();
    }
    wait_for_time(entry.receive_ns);
    publish_clock(entry.receive_ns);
    if (!entry.withheld) {
      std::visit([this](const auto& measurement) { send(measurement); }, entry.measurement);
      pace_.published(result.sweeps, result.imu, result.fixes);
    }
  }

  /// Everything that was published has been taken in.
  void drain() {
    points_.wait_for_acknowledgments(options_.patience);
    imu_.wait_for_acknowledgments(options_.patience);
    fixes_.wait_for_acknowledgments(options_.patience);
    await("the last sweep", mapper_, [this] {
      return pace_.wait_for_sweeps(result.sweeps > 0 ? result.sweeps - 1 : 0, options_.patience);
    });
    await("the last IMU sample", mapper_, [this] {
      return pace_.wait_for_imu(result.imu, options_.patience);
    });
  }

  void tell(const Events& events) const {
    for (const Event& event : events) {
      if (options_.on_event) {
        options_.on_event(event);
      }
    }
  }

  bool stop_requested() const { return options_.stop && options_.stop(); }

  PlayResult result;

 private:
  /// Who answers to what is played, by whether we hear and are heard.
  struct Answerer {
    const char* name;
    std::function<int()> matched;
    bool was_there{false};
  };

  void refuse_two_of_a_kind() const {
    const int mappers = lio_status_.matched();
    const int gates = fusion_status_.matched();
    if (mappers > 1 || gates > 1) {
      throw std::runtime_error(std::to_string(mappers) + " mappers and " + std::to_string(gates) +
                               " gates are on DDS domain " +
                               std::to_string(bus::domain_of(options_.bus)) +
                               ", whose results would be mixed; end the others, or take another "
                               "ROS_DOMAIN_ID");
    }
  }

  void send(const PointCloudMessage& cloud) {
    if (options_.rate == 0.0) {
      await("a sweep", mapper_, [this] {
        return pace_.wait_for_sweeps(result.sweeps, options_.patience);
      });
      imu_burst_ = 0;
    }
    points_.publish(bus::to_message(cloud));
    ++result.sweeps;
  }

  void send(const ImuSample& sample) {
    imu_.publish(bus::to_message(sample));
    ++result.imu;
    if (++imu_burst_ == kImuBurst) {
      imu_burst_ = 0;
      imu_.wait_for_acknowledgments(options_.rate > 0.0 ? kLiveGrace : options_.patience);
    }
  }

  void send(const TwistMeasurement& twist) {
    if (odometry_twists_) {
      odometry_twists_->publish(bus::to_odometry_message(twist));
    } else if (twists_) {
      twists_->publish(bus::to_message(twist));
    }
  }

  void send(const YawMeasurement& yaw) {
    if (yaws_) {
      yaws_->publish(bus::to_message(yaw));
    }
  }

  void send(const GnssFix& fix) {
    fixes_.publish(bus::to_message(fix));
    ++result.fixes;
    if (options_.rate == 0.0) {
      await("a fix", filter_, [this] {
        return pace_.wait_for_fixes(result.fixes, options_.patience);
      });
      // The verdict of a fix that is newer than the newest sweep comes only after the next one.
      if (fusion_status_.matched() > 0) {
        pace_.wait_for_verdict(fix.stamp_ns, kVerdictGrace);
      }
      imu_burst_ = 0;
    }
  }

  /// Waits for an answer if anybody is there to give it, or was and may be started again.
  template <typename Wait>
  void await(const char* what, Answerer& answerer, Wait wait) {
    await_return(answerer);
    if (answerer.matched() == 0 || stop_requested() || wait()) {
      return;
    }
    ++result.unanswered;
    tell("unanswered",
         std::string("no answer to ") + what + " within " +
             std::to_string(options_.patience.count()) + " ms; going on");
  }

  /// One that was there and has died may be started again: without it the log would run through.
  void await_return(Answerer& answerer) {
    const bool is_there = answerer.matched() > 0;
    answerer.was_there = answerer.was_there || is_there;
    if (is_there || !answerer.was_there || options_.rate > 0.0) {
      return;
    }
    tell("gone", std::string(answerer.name) + " is gone; waiting for it to come back");
    const auto deadline = WallClock::now() + kReturn;
    while (answerer.matched() == 0 && WallClock::now() < deadline && !stop_requested()) {
      std::this_thread::sleep_for(20ms);
    }
    answerer.was_there = answerer.matched() > 0;
  }

  void wait_for_time(Nanoseconds receive_ns) const {
    if (options_.rate <= 0.0) {
      return;
    }
    const auto due = started_ + std::chrono::nanoseconds(static_cast<Nanoseconds>(
                                    static_cast<double>(receive_ns - first_ns_) / options_.rate));
    while (WallClock::now() < due && !stop_requested()) {
      std::this_thread::sleep_until(std::min(due, WallClock::now() + WallClock::duration(100ms)));
    }
  }

  void publish_clock(Nanoseconds now_ns) {
    if (now_ns - clock_ns_ >= kClockPeriod_ns) {
      clock_ns_ = now_ns;
      clock_.publish(bus::to_clock_message(now_ns));
    }
  }

  void tell(const std::string& code, const std::string& text) const {
    if (options_.on_event) {
      options_.on_event({Severity::kWarning, clock_ns_, code, text});
    }
  }

  const PlayOptions& options_;
  Pace pace_;
  std::uint64_t imu_burst_{0};
  Nanoseconds first_ns_{0};
  Nanoseconds clock_ns_{0};
  WallClock::time_point started_;
  bus::Participant participant_;
  bus::Publisher<sensor_msgs::msg::PointCloud2> points_;
  bus::Publisher<sensor_msgs::msg::Imu> imu_;
  bus::Publisher<sensor_msgs::msg::NavSatFix> fixes_;
  std::optional<bus::Publisher<geometry_msgs::msg::TwistWithCovarianceStamped>> twists_;
  std::optional<bus::Publisher<nav_msgs::msg::Odometry>> odometry_twists_;
  std::optional<bus::Publisher<sensor_msgs::msg::Imu>> yaws_;
  bus::Publisher<rosgraph_msgs::msg::Clock> clock_;
  bus::Subscription<trigpoint_msgs::msg::LioStatus> lio_status_;
  bus::Subscription<trigpoint_msgs::msg::GpsStatus> gps_status_;
  bus::Subscription<trigpoint_msgs::msg::FusionStatus> fusion_status_;
  Answerer mapper_{"the mapper",
                   [this] { return std::min(lio_status_.matched(), points_.matched()); }};
  Answerer filter_{"the GPS filter",
                   [this] { return std::min(gps_status_.matched(), fixes_.matched()); }};
};

}  // namespace

PlayResult play(LogReader& log, const PlayOptions& options) {
  Player player(options);
  player.tell(fault_events(log.summary()));
  player.advertise_aiding();
  player.wait_for_peers();
  try {
    while (!player.stop_requested()) {
      const std::optional<LogEntry> entry = log.next();
      player.tell(log.take_events());
      if (!entry) {
        break;
      }
      if (options.on_entry) {
        options.on_entry(*entry);
      }
      player.publish(*entry);
      if (options.progress) {
        options.progress(log.progress());
      }
    }
  } catch (const LogError& broken) {
    player.result.log_error = broken.what();
  }
  player.tell(undecodable_events(log));
  player.result.stopped = player.stop_requested();
  if (!player.result.stopped) {
    player.drain();
  }
  return player.result;
}

}  // namespace trigpoint::recording
