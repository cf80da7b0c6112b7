// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The process around fusion_gate: the GPS filters' and the mapper's odometry in; state updates, the
// fused odometry and the reasons out.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/participant_of.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/fusion_gate/fusion_gate.hpp"
#include "trigpoint/pipeline/session_parts.hpp"
#include "trigpoint/shell/service_notice.hpp"
#include "trigpoint/shell/shell.hpp"

#include "only_one.hpp"

#include <chrono>
#include <optional>
#include <string>

namespace {

using namespace trigpoint;
namespace topics = bus::topics;

struct Settings {
  RobotConfig robot;
  bus::Config bus;
  fusion_gate::Config gate;
};

Settings load(const shell::Options& options) {
  Settings s;
  shell::load_sections(options.config_files,
                       {{"robot", [&s](ConfigFields& f) { describe(s.robot, f); }},
                        {"bus", [&s](ConfigFields& f) { describe(s.bus, f); }},
                        {"fusion_gate", [&s](ConfigFields& f) { describe(s.gate, f); }}});
  return s;
}

/// Publishes what the core says; everything but the conversions runs on the loop's thread.
class Process {
 public:
  Process(const Settings& settings,
          const shell::Options& options,
          const shell::EventLog& log,
          bus::Loop& loop)
      : log_(log),
        disk_(log),
        core_(settings.gate, settings.robot),
        participant_(settings.bus, "fusion_gate", log_),
        updates_(participant_, topics::state_update),
        fused_(participant_, topics::fusion_odometry),
        fused_raw_(participant_, topics::fusion_odometry_raw),
        status_(participant_, topics::fusion_status),
        selected_(participant_, topics::gps_selected),
        datum_(participant_, topics::datum),
        tf_(participant_, topics::tf),
        diagnostics_(participant_, topics::diagnostics),
        only_one_(participant_, loop, "fusion_gate", log) {
    if (!options.session.empty()) {
      exporter::create_session_folder(options.session);
      session_.emplace(options.session, exporter::Opening::kContinue);
      log_(session_->take_events());
      adopt_stored_datum(options.session);
    }
    subscribe_to_sensors(settings.robot, loop);
    subscribe_to_headings(settings.robot, loop);
    subscribe_to_estimates(loop);
    loop.every(std::chrono::seconds(1), [this] { report_health(); });
  }

  void close() {
    record_alignment();
    keep([&] { session_->close(); });
  }

  /// After close(). 2: there is another one, which no restart changes.
  int exit_code() const { return only_one_.is_too_many() ? 2 : disk_.failed() ? 1 : 0; }

 private:
  void subscribe_to_sensors(const RobotConfig& robot, bus::Loop& loop) {
    datums_.emplace(
        participant_,
        topics::datum,
        [this, &loop](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo& info) {
          if (info.writer_guid != datum_.guid()) {
            loop.post([this, datum = bus::datum_from_message(m)] { adopt(datum); });
          }
        });
    fixes_.emplace(participant_,
                   topics::fix.renamed(robot.fix_topic),
                   [this, &loop](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo&) {
                     loop.post([this, fix = bus::from_message(m)] { take(core_.on_fix(fix)); });
                   });
  }

  /// Two antennas or a magnetometer, where the robot has a topic for them.
  void subscribe_to_headings(const RobotConfig& robot, bus::Loop& loop) {
    if (!robot.yaw_topic.empty()) {
      yaws_.emplace(
          participant_,
          topics::yaw.renamed(robot.yaw_topic),
          [this, &loop](const sensor_msgs::msg::Imu& m, const bus::MessageInfo&) {
            loop.post([this, yaw = bus::yaw_from_message(m)] { take(core_.on_yaw(yaw)); });
          });
    }
  }

  void subscribe_to_estimates(bus::Loop& loop) {
    gps_.emplace(participant_,
                 topics::gps_odometry,
                 [this, &loop](const nav_msgs::msg::Odometry& m, const bus::MessageInfo& info) {
                   loop.post([this, odometry = bus::from_message(m), writer = info.writer_guid] {
                     take(core_.on_gps_odometry(odometry, bus::participant_of(writer)));
                   });
                 });
    gps_status_.emplace(
        participant_,
        topics::gps_status,
        [this, &loop](const trigpoint_msgs::msg::GpsStatus& m, const bus::MessageInfo& info) {
          loop.post([this, status = bus::from_message(m), writer = info.writer_guid] {
            take(core_.on_gps_status(status, bus::participant_of(writer)));
          });
        });
    lio_.emplace(participant_,
                 topics::lio_odometry,
                 [this, &loop](const nav_msgs::msg::Odometry& m, const bus::MessageInfo&) {
                   loop.post([this, odometry = bus::from_message(m)] {
                     take(core_.on_lio_odometry(odometry));
                   });
                 });
    lio_imu_rate_.emplace(participant_,
                          topics::lio_odometry_imu_rate,
                          [this, &loop](const nav_msgs::msg::Odometry& m, const bus::MessageInfo&) {
                            loop.post([this, odometry = bus::from_message(m)] {
                              take(core_.on_lio_odometry_imu_rate(odometry));
                            });
                          });
    lio_status_.emplace(
        participant_,
        topics::lio_status,
        [this, &loop](const trigpoint_msgs::msg::LioStatus& m, const bus::MessageInfo&) {
          loop.post([this, status = bus::from_message(m)] { take(status); });
        });
  }

  void take(const LioStatus& status) {
    mapper_aligned_ = status.aligned;
    mapper_heard_ = true;
    take(core_.on_lio_status(status));
  }

  void adopt_stored_datum(const std::string& session) {
    Events events;
    const auto stored = pipeline::stored_datum(session, events);
    log_(events);
    if (stored) {
      adopt(*stored);
    }
  }

  void adopt(const Datum& datum) {
    take(core_.on_datum(datum));
    if (datum.id() != published_datum_) {
      published_datum_ = datum.id();
      log_.info("datum " + published_datum_);
      datum_.publish(bus::to_message(datum));
    }
  }

  /// State updates go first: who waits for the verdict may rely on them being on their way.
  void take(const fusion_gate::Output& output) {
    log_(output.events);
    for (const StateUpdate& update : output.state_updates) {
      updates_.publish(bus::to_message(update));
    }
    if (output.selected) {
      selected_.publish(bus::to_message(*output.selected));
    }
    if (output.fused_raw) {
      fused_raw_.publish(bus::to_message(*output.fused_raw));
    }
    if (output.fused) {
      fused_.publish(bus::to_message(*output.fused));
      keep([&] { session_->on_fused(*output.fused); });
    }
    if (output.status) {
      publish(*output.status);
    }
  }

  void publish(const FusionStatus& status) {
    last_ = status;
    status_.publish(bus::to_message(status));
    keep([&] { session_->on_status(status); });
    if (status.aligned) {
      const bus::StampedTransform transform{
          status.stamp_ns, "map", "odom", status.T_map_odom.pose()};
      tf_.publish(bus::to_tf_message({&transform, 1}));
    }
  }

  void report_health() {
    record_alignment();
    keep([&] { session_->keep_counts(); });
    const bus::Diagnostic line{
        last_.aligned ? bus::DiagnosticLevel::kOk : bus::DiagnosticLevel::kWarning,
        "fusion_gate: fixes",
        "used " + std::to_string(last_.fixes_used) + " of " + std::to_string(last_.fixes_seen) +
            (last_.aligned ? "" : "; map and odom are not aligned yet"),
        last_.gps_source,
        {{"mode", last_.mode}, {"newest verdict", last_.verdict.reason}}};
    diagnostics_.publish(bus::to_message(last_.stamp_ns, {&line, 1}));
  }

  void record_alignment() {
    const auto best = core_.best_alignment();
    if (best || mapper_heard_) {  // a gate that has just begun knows nothing of what is in force
      keep([&] { session_->on_alignment(best, mapper_aligned_); });
    }
  }

  template <typename Write>
  void keep(Write write) {
    if (session_) {
      disk_.keep(write);
    }
  }

  shell::EventLog log_;
  shell::DiskGuard disk_;
  fusion_gate::FusionGate core_;
  std::optional<pipeline::GatePart> session_;
  FusionStatus last_;
  bool mapper_aligned_{false};
  bool mapper_heard_{false};
  std::string published_datum_;
  bus::Participant participant_;
  bus::Publisher<trigpoint_msgs::msg::StateUpdate> updates_;
  bus::Publisher<nav_msgs::msg::Odometry> fused_;
  bus::Publisher<nav_msgs::msg::Odometry> fused_raw_;
  bus::Publisher<trigpoint_msgs::msg::FusionStatus> status_;
  bus::Publisher<nav_msgs::msg::Odometry> selected_;
  bus::Publisher<sensor_msgs::msg::NavSatFix> datum_;
  bus::Publisher<tf2_msgs::msg::TFMessage> tf_;
  bus::Publisher<diagnostic_msgs::msg::DiagnosticArray> diagnostics_;
  shell::OnlyOne only_one_;
  std::optional<bus::Subscription<sensor_msgs::msg::NavSatFix>> datums_;
  std::optional<bus::Subscription<sensor_msgs::msg::NavSatFix>> fixes_;
  std::optional<bus::Subscription<sensor_msgs::msg::Imu>> yaws_;
  std::optional<bus::Subscription<nav_msgs::msg::Odometry>> gps_;
  std::optional<bus::Subscription<trigpoint_msgs::msg::GpsStatus>> gps_status_;
  std::optional<bus::Subscription<nav_msgs::msg::Odometry>> lio_;
  std::optional<bus::Subscription<nav_msgs::msg::Odometry>> lio_imu_rate_;
  std::optional<bus::Subscription<trigpoint_msgs::msg::LioStatus>> lio_status_;
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
  return process.exit_code();
}

}  // namespace

int main(int argc, char** argv) {
  return trigpoint::shell::run_program(
      argc,
      argv,
      "trigpoint_fusion_gate",
      "Fusion gate: decides axis by axis whether GPS or LiDAR-inertial odometry updates the map, "
      "and publishes the fused odometry",
      run);
}
