// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The process around lio_mapper: points, imu/data and fusion/state_update in; odometry, clouds, the
// map and its keyframes out.
#include "trigpoint/base/serial_worker.hpp"
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"
#include "trigpoint/pipeline/past_beside.hpp"
#include "trigpoint/pipeline/session_parts.hpp"
#include "trigpoint/shell/service_notice.hpp"
#include "trigpoint/shell/shell.hpp"

#include "decode_ahead.hpp"
#include "only_one.hpp"

#include <chrono>
#include <memory>
#include <optional>

namespace {

using namespace trigpoint;
namespace topics = bus::topics;
using Clock = std::chrono::steady_clock;

/// Clouds between arrival and matching, six seconds at 10 Hz: who sends more is held back.
constexpr std::size_t kDecodedClouds = 60;
/// Scans between matching and disk, ten seconds: then odometry waits for the disk.
constexpr std::size_t kUnwrittenScans = 100;

/// The correction of the past takes what the odometry leaves.
constexpr int kPastNiceness = 10;

/// Silence that a supervisor is asked for: finding the place in the map again is one long piece of
/// work.
constexpr std::chrono::seconds kSearching{20};
/// And a disk that lags far behind, for which odometry waits.
constexpr std::chrono::seconds kWaitingForTheDisk{60};

constexpr std::chrono::seconds kMapPeriod{5};  ///< the latched local map, while somebody listens

struct Settings {
  RobotConfig robot;
  bus::Config bus;
  lio_mapper::Config mapper;
};

Settings load(const shell::Options& options) {
  Settings s;
  shell::load_sections(options.config_files,
                       {{"robot", [&s](ConfigFields& f) { describe(s.robot, f); }},
                        {"bus", [&s](ConfigFields& f) { describe(s.bus, f); }},
                        {"lio_mapper", [&s](ConfigFields& f) { describe(s.mapper, f); }}});
  return s;
}

bus::DiagnosticLevel level_of(LioHealth health) {
  switch (health) {
    case LioHealth::kOk:
      return bus::DiagnosticLevel::kOk;
    case LioHealth::kLost:
      return bus::DiagnosticLevel::kError;
    case LioHealth::kStale:
      return bus::DiagnosticLevel::kStale;
    default:
      return bus::DiagnosticLevel::kWarning;
  }
}

/// Publishes what the core says. On the loop's thread, except: conversions (the bus's threads),
/// decoding (a thread of its own; the loop takes each cloud in its turn among the IMU samples as
/// they arrived), the session's files (another one, in order) and the correction of the past (a
/// third one, of low priority).
class Process {
 public:
  Process(const Settings& settings,
          const shell::Options& options,
          const shell::EventLog& log,
          bus::Loop& loop,
          const shell::ServiceNotice& notice)
      : log_(log),
        notice_(notice),
        disk_(log),
        core_(settings.mapper, settings.robot),
        decoding_(settings.mapper, kDecodedClouds),
        participant_(settings.bus, "lio_mapper", log_),
        odometry_(participant_, topics::lio_odometry),
        imu_rate_(participant_, topics::lio_odometry_imu_rate),
        status_(participant_, topics::lio_status),
        cloud_(participant_, topics::cloud_registered),
        map_(participant_, topics::map),
        tf_(participant_, topics::tf),
        tf_static_(participant_, topics::tf_static),
        diagnostics_(participant_, topics::diagnostics),
        only_one_(participant_, loop, "lio_mapper", log) {
    if (!options.session.empty()) {
      exporter::create_session_folder(options.session);
      open_session(options.session);
    } else if (settings.mapper.past.enabled) {
      log_.info("no session, so no keyframes: the past is not corrected");
    }
    publish_extrinsics(settings.robot);
    updates_.emplace(
        participant_,
        topics::state_update,
        [this, &loop](const trigpoint_msgs::msg::StateUpdate& m, const bus::MessageInfo&) {
          loop.post([this, update = bus::from_message(m)] {
            take([&] { return core_.on_state_update(update); });
          });
        });
    imu_.emplace(participant_,
                 topics::imu.renamed(settings.robot.imu_topic),
                 [this, &loop](const sensor_msgs::msg::Imu& m, const bus::MessageInfo&) {
                   loop.post([this, sample = bus::from_message(m)] {
                     take([&] { return core_.on_imu(sample); });
                   });
                 });
    points_.emplace(participant_,
                    topics::points.renamed(settings.robot.points_topic),
                    [this, &loop](sensor_msgs::msg::PointCloud2& m, const bus::MessageInfo&) {
                      const auto mapper = loop.is_waiting() ? lio_mapper::MapperIs::kWaiting
                                                            : lio_mapper::MapperIs::kBusy;
                      if (decoding_.add(bus::from_message(std::move(m)), mapper)) {
                        loop.post([this] { take_cloud(); });
                      }
                      m.data(decoding_.take_spare_bytes());
                    });
    loop.every(std::chrono::seconds(1), [this] { report_health(); });
    loop.every(kMapPeriod, [this] { publish_map(); });
  }

  /// Wakes a thread of the bus that waits to hand a cloud over: it is joined below.
  ~Process() { decoding_.stop(); }

  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// After the loop: what still waits for IMU samples is processed, and everything is written.
  void close() {
    decoding_.stop();
    if (past_) {
      past_->cancel();
    }
    take([this] { return core_.finish(); });
    keep(
        [this, status = core_.status(), checkpoint = core_.checkpoint(), rows = core_.take_rows()] {
          session_->close(status, checkpoint, rows);
        });
    publish_map();
    writing_.finish();
  }

  /// After close(). 2: there is another one, which no restart changes.
  int exit_code() const { return only_one_.is_too_many() ? 2 : disk_.failed() ? 1 : 0; }

 private:
  /// A session that holds a checkpoint is one in which this program died or was stopped: it goes
  /// on.
  void open_session(const std::string& session) {
    const bool goes_on = pipeline::stored_checkpoint(session).has_value();
    if (goes_on) {
      pipeline::StoredSession stored = pipeline::open_stored_session(session);
      last_.stamp_ns = stored.checkpoint.stamp_ns;
      core_.resume(stored.checkpoint, std::move(stored.points));
      log_.info("going on with the session in " + session);
    }
    session_.emplace(session, goes_on ? pipeline::Continuing::kYes : pipeline::Continuing::kNo);
    past_.emplace(
        core_,
        exporter::path_in(session, exporter::session_file::kKeyframes),
        goes_on ? pipeline::stored_past(session) : lio_mapper::GraphInput{},
        [this](SerialWorker::Job job) { keep(std::move(job)); },
        pipeline::PastBesideOptions{std::nullopt, kPastNiceness});
  }

  void take_cloud() {
    if (auto cloud = decoding_.take()) {
      take([&] { return core_.on_decoded_cloud(std::move(*cloud)); });
    }
  }

  void ask_for_patience() {
    const bool searching = core_.status().health != LioHealth::kOk;
    if (searching != searching_) {
      searching_ = searching;
      allow_silence();
    }
  }

  void allow_silence() {
    searching_ ? notice_.allow_silence(kSearching) : notice_.allow_usual_silence();
  }

  template <typename Feed>
  void take(Feed feed) {
    ask_for_patience();
    const Clock::time_point before = Clock::now();
    lio_mapper::Output output = feed();
    const double elapsed_ms =
        std::chrono::duration<double, std::milli>(Clock::now() - before).count();
    log_(output.events);
    for (lio_mapper::ScanResult& scan : output.scans) {
      scan.status.scan_ms += elapsed_ms / static_cast<double>(output.scans.size());
      publish(scan);
      keep([this, kept = std::make_shared<const lio_mapper::ScanResult>(std::move(scan))] {
        session_->on_scan(*kept);
      });
    }
    if (output.scans.empty() && core_.status().scans_received != reported_received_) {
      publish_status(core_.status());
    }
    if (output.odometry_imu_rate) {
      imu_rate_.publish(bus::to_message(*output.odometry_imu_rate));
    }
    if (past_) {
      log_(past_->after_scans(output.scans.size()));
    }
  }

  void publish(const lio_mapper::ScanResult& scan) {
    last_ = scan.status;
    odometry_.publish(bus::to_message(scan.odometry));
    publish_status(scan.status);
    const bus::StampedTransform transform{scan.odometry.stamp_ns,
                                          scan.odometry.frame_id,
                                          scan.odometry.child_frame_id,
                                          scan.odometry.T_frame_child};
    tf_.publish(bus::to_tf_message({&transform, 1}));
    if (cloud_.matched() > 0) {
      cloud_.publish(bus::to_message(
          to_cloud_message(scan.points_odom, scan.odometry.stamp_ns, scan.odometry.frame_id)));
    }
  }

  /// After every sweep, also one that waits or was refused: a player goes by it.
  void publish_status(const LioStatus& status) {
    reported_received_ = status.scans_received;
    status_.publish(bus::to_message(status));
  }

  void publish_extrinsics(const RobotConfig& robot) {
    const std::array<bus::StampedTransform, 2> transforms{
        bus::StampedTransform{0, "base_link", "lidar", robot.T_base_lidar()},
        bus::StampedTransform{0,
                              "base_link",
                              "gnss_antenna",
                              Pose(Eigen::Quaterniond::Identity(), robot.antenna_position_base_m)}};
    tf_static_.publish(bus::to_tf_message(transforms));
  }

  void publish_map() {
    if (map_.matched() > 0) {
      map_.publish(bus::to_message(to_cloud_message(core_.local_map(), last_.stamp_ns, "odom")));
    }
  }

  /// Also between scans, so that who waits for the mapper hears that it lives and what it lacks.
  void report_health() {
    const LioStatus status = core_.status();
    if (status.scans_used == reported_scans_) {
      publish_status(status);
    }
    reported_scans_ = status.scans_used;
    const bus::Diagnostic line{
        level_of(status.health),
        "lio_mapper: scans",
        "used " + std::to_string(status.scans_used) + " of " +
            std::to_string(status.scans_received),
        "",
        {{"imu samples", std::to_string(status.imu_received)},
         {"odom epoch", std::to_string(status.odom_epoch)},
         {"corrections of the past", std::to_string(past_ ? past_->corrections() : 0)}}};
    diagnostics_.publish(bus::to_message(status.stamp_ns, {&line, 1}));
  }

  /// Written beside the next scans. What the disk refuses is told by the DiskGuard.
  void keep(SerialWorker::Job write) {
    if (!session_) {
      return;
    }
    const bool must_wait = writing_.is_full();
    if (must_wait) {
      notice_.allow_silence(kWaitingForTheDisk);
      log_({Severity::kWarning,
            last_.stamp_ns,
            "disk_lags",
            "the disk is " + std::to_string(kUnwrittenScans) +
                " scans behind; odometry waits for it, so that no keyframe is lost"});
    }
    writing_.give([this, write = std::move(write)] { disk_.keep(write); });
    if (must_wait) {
      allow_silence();
    }
  }

  shell::EventLog log_;
  const shell::ServiceNotice& notice_;
  bool searching_{false};
  shell::DiskGuard disk_;  ///< used by the writing thread
  lio_mapper::LioMapper core_;
  lio_mapper::DecodeAhead decoding_;
  std::optional<pipeline::MapperPart> session_;  ///< used by the writing thread
  LioStatus last_;
  std::uint64_t reported_scans_{0};
  std::uint64_t reported_received_{0};
  bus::Participant participant_;
  bus::Publisher<nav_msgs::msg::Odometry> odometry_;
  bus::Publisher<nav_msgs::msg::Odometry> imu_rate_;
  bus::Publisher<trigpoint_msgs::msg::LioStatus> status_;
  bus::Publisher<sensor_msgs::msg::PointCloud2> cloud_;
  bus::Publisher<sensor_msgs::msg::PointCloud2> map_;
  bus::Publisher<tf2_msgs::msg::TFMessage> tf_;
  bus::Publisher<tf2_msgs::msg::TFMessage> tf_static_;
  bus::Publisher<diagnostic_msgs::msg::DiagnosticArray> diagnostics_;
  shell::OnlyOne only_one_;
  std::optional<bus::Subscription<trigpoint_msgs::msg::StateUpdate>> updates_;
  std::optional<bus::Subscription<sensor_msgs::msg::Imu>> imu_;
  std::optional<bus::Subscription<sensor_msgs::msg::PointCloud2>> points_;
  std::optional<pipeline::PastBeside> past_;
  SerialWorker writing_{kUnwrittenScans};  ///< last: its jobs use the others
};

int run(const shell::Options& options, const shell::EventLog& log) {
  const Settings settings = load(options);
  bus::Loop loop;
  const shell::ServiceNotice notice;
  Process process(settings, options, log, loop, notice);
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
      "trigpoint_lio_mapper",
      "LiDAR-inertial mapper: points + IMU -> odometry with covariance, registered clouds, the map",
      run);
}
