// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The process around one filter of gps_odometry: imu/data and gps/fix in, gps/odometry and
// gps/status out. Compiled once for each filter (TRIGPOINT_GPS_FILTER): a program is a filter,
// whatever `gps_odometry.filter` says for offline runs.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/gps_odometry/gps_odometry.hpp"
#include "trigpoint/pipeline/session_parts.hpp"
#include "trigpoint/shell/service_notice.hpp"
#include "trigpoint/shell/shell.hpp"

#include "other_filters.hpp"

#include <chrono>
#include <optional>
#include <string>

namespace {

using namespace trigpoint;
namespace topics = bus::topics;

constexpr const char* kFilter = TRIGPOINT_GPS_FILTER;

struct Settings {
  RobotConfig robot;
  bus::Config bus;
  gps_odometry::Config filter;
};

Settings load(const shell::Options& options) {
  Settings s;
  shell::load_sections(options.config_files,
                       {{"robot", [&s](ConfigFields& f) { describe(s.robot, f); }},
                        {"bus", [&s](ConfigFields& f) { describe(s.bus, f); }},
                        {"gps_odometry", [&s](ConfigFields& f) { describe(s.filter, f); }}});
  s.filter.filter = kFilter;
  return s;
}

bus::DiagnosticLevel level_of(GpsHealth health) {
  switch (health) {
    case GpsHealth::kOk:
      return bus::DiagnosticLevel::kOk;
    case GpsHealth::kFault:
      return bus::DiagnosticLevel::kError;
    case GpsHealth::kStale:
      return bus::DiagnosticLevel::kStale;
    default:
      return bus::DiagnosticLevel::kWarning;
  }
}

/// Publishes what the core says; everything here runs on the loop's thread.
class Process {
 public:
  Process(const Settings& settings,
          const shell::Options& options,
          const shell::EventLog& log,
          bus::Loop& loop)
      : log_(log),
        disk_(log),
        core_(settings.filter, settings.robot),
        participant_(settings.bus, "gps_odometry", log_),
        odometry_(participant_, topics::gps_odometry),
        status_(participant_, topics::gps_status),
        datum_(participant_, topics::datum),
        diagnostics_(participant_, topics::diagnostics) {
    if (!options.session.empty()) {
      exporter::create_session_folder(options.session);
      session_.emplace(options.session, exporter::Opening::kContinue);
      log_(session_->take_events());
      adopt_stored_datum(options.session);
    }
    publish_datum();
    datums_.emplace(
        participant_,
        topics::datum,
        [this, &loop](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo& info) {
          if (info.writer_guid != datum_.guid()) {
            loop.post([this, d = bus::datum_from_message(m), writer = info.writer_guid] {
              take(core_.on_datum(d));
              warm_start(others_.on_datum_id(writer, d.id()));
            });
          }
        });
    listen_to_others(loop);
    imu_.emplace(participant_,
                 topics::imu.renamed(settings.robot.imu_topic),
                 [this, &loop](const sensor_msgs::msg::Imu& m, const bus::MessageInfo&) {
                   loop.post([this, sample = bus::from_message(m)] { take(core_.on_imu(sample)); });
                 });
    fixes_.emplace(participant_,
                   topics::fix.renamed(settings.robot.fix_topic),
                   [this, &loop](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo&) {
                     loop.post([this, fix = bus::from_message(m)] { take(core_.on_fix(fix)); });
                   });
    subscribe_to_aiding(settings.robot, loop);
    loop.every(std::chrono::seconds(1), [this] { diagnose(); });
  }

  void close() {
    keep([&] { session_->keep_counts(core_.status()); });
  }

  bool failed() const { return disk_.failed(); }

 private:
  void adopt_stored_datum(const std::string& session) {
    Events events;
    const auto stored = pipeline::stored_datum(session, events);
    log_(events);
    if (stored) {
      take(core_.on_datum(*stored));
    }
  }

  /// Only while the core wants it: other filters, and the gate that keeps the newest odometry of a
  /// filter that has died.
  void listen_to_others(bus::Loop& loop) {
    using Hear = std::optional<gps_odometry::OtherFilters::Heard> (gps_odometry::OtherFilters::*)(
        const std::string&, Odometry);
    const auto hear = [this, &loop](Hear take_up) {
      return
          [this, &loop, take_up](const nav_msgs::msg::Odometry& m, const bus::MessageInfo& info) {
            if (info.writer_guid != odometry_.guid()) {
              loop.post(
                  [this, take_up, odometry = bus::from_message(m), writer = info.writer_guid] {
                    warm_start((others_.*take_up)(writer, odometry));
                  },
                  bus::WhenFull::kDropOldest);
            }
          };
    };
    other_odometry_.emplace(
        participant_, topics::gps_odometry, hear(&gps_odometry::OtherFilters::on_odometry));
    selected_.emplace(
        participant_, topics::gps_selected, hear(&gps_odometry::OtherFilters::on_selected));
    other_status_.emplace(
        participant_,
        topics::gps_status,
        [this, &loop](const trigpoint_msgs::msg::GpsStatus& m, const bus::MessageInfo& info) {
          if (info.writer_guid != status_.guid()) {
            loop.post(
                [this, id = bus::from_message(m).datum_id, writer = info.writer_guid] {
                  warm_start(others_.on_datum_id(writer, id));
                },
                bus::WhenFull::kDropOldest);
          }
        });
  }

  void warm_start(const std::optional<gps_odometry::OtherFilters::Heard>& heard) {
    if (heard && core_.wants_odometry()) {
      take(core_.on_odometry(heard->odometry, heard->datum_id));
    }
  }

  void stop_listening_to_others() {
    other_odometry_.reset();
    selected_.reset();
    other_status_.reset();
  }

  template <typename Write>
  void keep(Write write) {
    if (session_) {
      disk_.keep(write);
    }
  }

  /// Wheels and heading, where the robot has a topic for them.
  void subscribe_to_aiding(const RobotConfig& robot, bus::Loop& loop) {
    const auto on_twist = [this, &loop](const auto& m, const bus::MessageInfo&) {
      loop.post([this, twist = bus::twist_from_message(m)] { take(core_.on_twist(twist)); });
    };
    if (!robot.twist_topic.empty() && robot.twist_message == "Odometry") {
      odometry_twists_.emplace(
          participant_, topics::twist_odometry.renamed(robot.twist_topic), on_twist);
    } else if (!robot.twist_topic.empty()) {
      twists_.emplace(participant_, topics::twist.renamed(robot.twist_topic), on_twist);
    }
    if (!robot.yaw_topic.empty()) {
      yaws_.emplace(
          participant_,
          topics::yaw.renamed(robot.yaw_topic),
          [this, &loop](const sensor_msgs::msg::Imu& m, const bus::MessageInfo&) {
            loop.post([this, yaw = bus::yaw_from_message(m)] { take(core_.on_yaw(yaw)); });
          });
    }
  }

  void take(const gps_odometry::Output& output) {
    log_(output.events);
    publish_datum();
    if (output.odometry) {
      others_.on_own_odometry(output.odometry->stamp_ns);
      odometry_.publish(bus::to_message(*output.odometry));
      keep([&] { session_->on_odometry(*output.odometry); });
    }
    if (output.status) {
      last_ = *output.status;
      status_.publish(bus::to_message(*output.status));
      keep([&] { session_->on_status(*output.status); });
    }
  }

  /// Elected or adopted: who has a datum publishes it, so that one process's death does not lose
  /// it.
  void publish_datum() {
    const std::optional<Datum> datum = core_.datum();
    if (datum && datum->id() != published_datum_) {
      published_datum_ = datum->id();
      log_.info("datum " + published_datum_);
      datum_.publish(bus::to_message(*datum));
      keep([&] { session_->on_datum(*datum); });
    }
  }

  void diagnose() {
    if (!core_.wants_odometry()) {
      stop_listening_to_others();
    }
    const bus::Diagnostic line{level_of(last_.health),
                               "gps_odometry: fixes",
                               "accepted " + std::to_string(last_.fixes_accepted) + " of " +
                                   std::to_string(last_.fixes_received),
                               last_.source,
                               {{"datum", last_.datum_id}}};
    diagnostics_.publish(bus::to_message(last_.stamp_ns, {&line, 1}));
    keep([&] { session_->keep_counts(core_.status()); });
  }

  shell::EventLog log_;
  shell::DiskGuard disk_;
  gps_odometry::GpsOdometry core_;
  std::optional<pipeline::GpsPart> session_;
  GpsStatus last_;
  std::string published_datum_;
  bus::Participant participant_;
  bus::Publisher<nav_msgs::msg::Odometry> odometry_;
  bus::Publisher<trigpoint_msgs::msg::GpsStatus> status_;
  bus::Publisher<sensor_msgs::msg::NavSatFix> datum_;
  bus::Publisher<diagnostic_msgs::msg::DiagnosticArray> diagnostics_;
  std::optional<bus::Subscription<sensor_msgs::msg::NavSatFix>> datums_;
  gps_odometry::OtherFilters others_;
  std::optional<bus::Subscription<nav_msgs::msg::Odometry>> other_odometry_;
  std::optional<bus::Subscription<nav_msgs::msg::Odometry>> selected_;
  std::optional<bus::Subscription<trigpoint_msgs::msg::GpsStatus>> other_status_;
  std::optional<bus::Subscription<sensor_msgs::msg::Imu>> imu_;
  std::optional<bus::Subscription<sensor_msgs::msg::NavSatFix>> fixes_;
  std::optional<bus::Subscription<geometry_msgs::msg::TwistWithCovarianceStamped>> twists_;
  std::optional<bus::Subscription<nav_msgs::msg::Odometry>> odometry_twists_;
  std::optional<bus::Subscription<sensor_msgs::msg::Imu>> yaws_;
};

int run(const shell::Options& options, const shell::EventLog& log) {
  const Settings settings = load(options);
  bus::Loop loop;
  Process process(settings, options, log, loop);
  const shell::ServiceNotice notice;
  loop.every(shell::ServiceNotice::kPeriod, [&notice] { notice.alive(); });
  notice.ready();
  log.info("ready");
  loop.run();
  notice.stopping();
  process.close();
  return process.failed() ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  return trigpoint::shell::run_program(
      argc,
      argv,
      std::string("trigpoint_gps_") + kFilter,
      std::string("GPS odometry: NavSatFix + IMU -> position with covariance in map (filter ") +
          kFilter + ")",
      run);
}
