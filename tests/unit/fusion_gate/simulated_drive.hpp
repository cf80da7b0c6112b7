// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A drive without sensors: what the GPS filter and the mapper would say, in the order of time, and
// a mapper that takes the first alignment.
#pragma once

#include "trigpoint/base/so3.hpp"
#include "trigpoint/fusion_gate/fusion_gate.hpp"

#include <cmath>
#include <functional>
#include <string>
#include <vector>

namespace trigpoint::fusion_gate {

struct Reception {
  double until_s{1e9};
  double sigma_m{0.02};  ///< of gps/odometry and of the accepted fixes
  bool accepted{true};   ///< else the filter dead-reckons
  GpsHealth health{GpsHealth::kOk};
};

/// Algorithm I alone: mode smooth has its own drive (lying_drive.hpp).
inline Config hard_mode() {
  Config config;
  config.mode = "hard";
  return config;
}

struct Scenario {
  Config config{hard_mode()};
  YawPose T_map_odom{2.9, {20.0, -30.0, 4.0}};
  Eigen::Vector3d antenna_position_base_m{0.4, 0.1, 0.9};
  double yaw_floor_sigma_rad{RobotConfig{}.yaw_floor_sigma_rad};
  double gps_yaw_sigma_rad{3.14};  ///< of gps/odometry
  double slide_mps{0.0};           ///< LIO falls so much behind along odom's x, and says so
  double duration_s{30.0};
  double speed_mps{1.2};
  double gps_odometry_hz{20.0};
  double fix_interval_s{0.2};
  double fix_latency_s{0.0};  ///< of the status that tells of it
  bool with_imu_rate{true};
  bool with_mapper{true};  ///< else it never confirms an alignment
  std::vector<Reception> reception{Reception{}};
  std::string datum_id{Datum{49.0, 8.0, 100.0, 0}.id()};
};

struct Record {
  std::vector<StateUpdate> updates;
  std::vector<Odometry> fused;
  std::vector<FusionStatus> statuses;
  std::vector<Odometry> selected;
  Events events;

  void add(const Output& out) {
    updates.insert(updates.end(), out.state_updates.begin(), out.state_updates.end());
    events.insert(events.end(), out.events.begin(), out.events.end());
    if (out.fused) {
      fused.push_back(*out.fused);
    }
    if (out.status) {
      statuses.push_back(*out.status);
    }
    if (out.selected) {
      selected.push_back(*out.selected);
    }
  }

  std::vector<StateUpdate> rows() const {
    std::vector<StateUpdate> result;
    for (const StateUpdate& update : updates) {
      if (!update.first_alignment) {
        result.push_back(update);
      }
    }
    return result;
  }
};

class SimulatedDrive {
 public:
  explicit SimulatedDrive(const Scenario& scenario)
      : scenario_(scenario), gate_(scenario.config, robot()) {}

  Record run() {
    run_until(scenario_.duration_s);
    return record_;
  }

  /// 1 kHz ticks; at each the streams that are due, sensors before the mapper.
  void run_until(double end_s) {
    for (; tick_ms_ < std::llround(end_s * 1e3); ++tick_ms_) {
      const double now_s = static_cast<double>(tick_ms_) * 1e-3;
      if (due(1.0 / scenario_.gps_odometry_hz)) {
        gps_odometry(now_s);
      }
      if (due(scenario_.fix_interval_s)) {
        status_queue_.push_back({now_s + scenario_.fix_latency_s, status(now_s)});
      }
      deliver_statuses(now_s);
      if (scenario_.with_imu_rate && due(0.01)) {
        keep(gate_.on_lio_odometry_imu_rate(lio_odometry(now_s)));
      }
      if (lio_alive && due(0.1)) {
        keep(gate_.on_lio_odometry(lio_odometry(now_s)));
        keep(gate_.on_lio_status(lio_status(now_s)));
      }
    }
  }

  Pose T_map_base(double now_s) const {
    if (route) {
      return route(now_s);
    }
    const double heading_rad = 0.3 + 0.05 * now_s;
    const double radius_m = scenario_.speed_mps / 0.05;
    const Eigen::Vector3d p(
        radius_m * std::sin(heading_rad), -radius_m * std::cos(heading_rad), 0.02 * now_s);
    return {from_roll_pitch_yaw({0.02, -0.03, heading_rad}), p};
  }

  Pose T_odom_base(double now_s) const {
    return scenario_.T_map_odom.pose().inverse() * T_map_base(now_s);
  }

  GpsStatus status(double now_s) {
    const Reception& now = reception_at(now_s);
    GpsStatus message;
    message.stamp_ns = from_seconds(start_s_ + now_s);
    message.source = "ekf15";
    message.health = now.health;
    message.datum_id = scenario_.datum_id;
    ++fixes_;
    message.fixes_received = fixes_;
    accepted_ += now.accepted ? 1 : 0;
    if (now.accepted) {
      last_accepted_ns_ = message.stamp_ns;
      last_antenna_m_ = T_map_base(now_s) * scenario_.antenna_position_base_m;
    }
    message.fixes_accepted = accepted_;
    message.last_accepted_fix_ns = last_accepted_ns_;
    message.accepted_antenna_map_m = last_antenna_m_;
    message.accepted_covariance_map_m2 = Eigen::Matrix3d::Identity() * now.sigma_m * now.sigma_m;
    if (fixes_ > accepted_) {
      message.rejections = {{"chi_square", fixes_ - accepted_}};
    }
    return message;
  }

  Odometry lio_odometry(double now_s) const {
    Odometry odometry;
    odometry.stamp_ns = from_seconds(start_s_ + now_s);
    odometry.frame_id = "odom";
    odometry.child_frame_id = "base_link";
    odometry.T_frame_child = T_odom_base(now_s);
    odometry.T_frame_child.p += lio_found_elsewhere_m;
    odometry.T_frame_child.p.x() -= scenario_.slide_mps * now_s;
    odometry.pose_covariance = PoseCovariance::Identity() * 1e-4;
    return odometry;
  }

  LioStatus lio_status(double now_s) const {
    LioStatus message;
    message.stamp_ns = from_seconds(start_s_ + now_s);
    message.odom_epoch = epoch;
    message.health = LioHealth::kOk;
    message.aligned = alignment_.has_value();
    const double slid_m = scenario_.slide_mps * now_s;
    message.sigma[0] = message.sigma[1] = std::max(0.01, slid_m);
    if (alignment_) {
      message.T_map_odom = alignment_->T_map_odom;
      message.T_map_odom_covariance.setZero();
      message.T_map_odom_covariance.topLeftCorner<4, 4>() = alignment_->covariance;
    }
    return message;
  }

  void begin_epoch(const YawPose& T_map_odom) {
    ++epoch;
    scenario_.T_map_odom = T_map_odom;
    alignment_.reset();
  }

  void keep(const Output& out) {
    record_.add(out);
    for (const StateUpdate& update : out.state_updates) {
      const bool wanted = update.first_alignment && update.first_alignment->odom_epoch == epoch;
      if (scenario_.with_mapper && wanted && !alignment_) {
        alignment_ = update.first_alignment;
      }
    }
  }

  FusionGate& gate() { return gate_; }

  const Record& record() const { return record_; }

  Nanoseconds stamp(double now_s) const { return from_seconds(start_s_ + now_s); }

  Eigen::Vector3d lio_found_elsewhere_m{Eigen::Vector3d::Zero()};  ///< from now on
  std::function<Pose(double)> route;                               ///< in place of the circle
  std::function<Eigen::Vector3d(double)> gps_error_m;              ///< of gps/odometry
  bool lio_alive{true};
  bool gps_alive{true};
  std::uint32_t epoch{7};

 private:
  struct QueuedStatus {
    double at_s;
    GpsStatus status;
  };

  RobotConfig robot() const {
    RobotConfig config;
    config.antenna_position_base_m = scenario_.antenna_position_base_m;
    config.yaw_floor_sigma_rad = scenario_.yaw_floor_sigma_rad;
    return config;
  }

  bool due(double period_s) const { return tick_ms_ % std::llround(period_s * 1e3) == 0; }

  const Reception& reception_at(double now_s) const {
    for (const Reception& reception : scenario_.reception) {
      if (now_s < reception.until_s) {
        return reception;
      }
    }
    return scenario_.reception.back();
  }

  void gps_odometry(double now_s) {
    if (!gps_alive) {
      return;
    }
    Odometry odometry;
    odometry.stamp_ns = stamp(now_s);
    odometry.frame_id = "map";
    odometry.child_frame_id = "base_link";
    odometry.T_frame_child = T_map_base(now_s);
    if (gps_error_m) {
      odometry.T_frame_child.p += gps_error_m(now_s);
    }
    const double sigma_m = reception_at(now_s).sigma_m;
    odometry.pose_covariance.topLeftCorner<3, 3>() =
        Eigen::Matrix3d::Identity() * sigma_m * sigma_m;
    odometry.pose_covariance(5, 5) = scenario_.gps_yaw_sigma_rad * scenario_.gps_yaw_sigma_rad;
    keep(gate_.on_gps_odometry(odometry, "gps-a"));
  }

  void deliver_statuses(double now_s) {
    while (!status_queue_.empty() && status_queue_.front().at_s <= now_s) {
      if (gps_alive) {
        keep(gate_.on_gps_status(status_queue_.front().status, "gps-a"));
      }
      status_queue_.erase(status_queue_.begin());
    }
  }

  Scenario scenario_;
  FusionGate gate_;
  Record record_;
  double start_s_{1000.0};
  long tick_ms_{0};
  std::vector<QueuedStatus> status_queue_;
  std::uint64_t fixes_{0};
  std::uint64_t accepted_{0};
  Nanoseconds last_accepted_ns_{0};
  Eigen::Vector3d last_antenna_m_{Eigen::Vector3d::Constant(kNaN)};
  std::optional<Alignment> alignment_;
};

}  // namespace trigpoint::fusion_gate
