// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A drive with a LIO that drifts, a receiver that may lie, a GPS filter that believes it, and a
// mapper that keeps T_map_odom as the real one does: four states, drift noise about the robot, rows
// by the Kalman update. The noise that is drawn is smaller than the noise that is assumed, as in
// the measurements of components/lio_mapper/README.md.
#pragma once

#include "trigpoint/base/so3.hpp"
#include "trigpoint/fusion_gate/fusion_gate.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace trigpoint::fusion_gate {

struct LyingDriveSettings {
  Config config;
  std::uint64_t seed{1};
  double duration_s{150.0};
  double speed_mps{3.0};
  double speed_blind_share{0.0};  ///< of the way that LIO loses while it is blind
  std::function<Eigen::Vector3d(double)> lie_enu_m;      ///< of the fix, at a time; may be empty
  std::function<Eigen::Vector3d(double)> raw_lie_enu_m;  ///< besides, that the filter smooths out
  double raw_grid_m{0.0};                       ///< of the receiver's, smoothed out; 0: none
  std::function<bool(double)> has_fix;          ///< may be empty: always
  std::function<bool(double)> is_blind;         ///< LIO along odom's x; may be empty: never
  double claimed_sigma_m{0.01};                 ///< horizontally; twice that in height
  std::function<double(double)> claimed_share;  ///< of it, at a time; may be empty: 1
  /// By the filter, instead of twice what the receiver claims; may be empty.
  std::function<double(double)> filter_sigma_m;
  double lio_walk_m_per_sqrt_m{0.007};
  double lio_scale{0.0005};                             ///< LIO's way is longer by this share
  Eigen::Vector3d lio_jump_m{Eigen::Vector3d::Zero()};  ///< of odom against map during an outage
  double lio_jump_at_s{1e9};
  double mapper_walk_m_per_sqrt_m{0.02};  ///< drift that the mapper admits
  bool mapper_knows_blindness{true};      ///< the real one does not
  YawPose T_map_odom{2.0, {30.0, -10.0, 5.0}};
  double fix_latency_s{0.13};
  std::function<double(std::size_t)> delay_s;  ///< besides, by the number of the fix; may be empty
  std::function<bool(double)> is_refused;      ///< by the filter's gate; may be empty: never
  double fix_interval_s{0.2};
  bool sends_no_fix{false};  ///< a message without a position while it has none
  bool with_records{true};   ///< the filter tells of all recent fixes
};

struct DriveSample {
  double at_s;
  Eigen::Vector3d error_m;      ///< of fusion/odometry
  Eigen::Vector3d raw_error_m;  ///< of fusion/odometry_raw
  Eigen::Vector3d sigma_m;
  double distance_m;
};

class LyingDrive {
 public:
  explicit LyingDrive(const LyingDriveSettings& settings)
      : s_(settings),
        frame_(datum()),
        gate_(settings.config, robot()),
        random_(settings.seed),
        P_(Eigen::Matrix4d::Zero()) {
    keep(gate_.on_datum(datum()));
  }

  void run() {
    for (long tick = 0; tick <= std::llround(s_.duration_s / kTick_s); ++tick) {
      now_s_ = static_cast<double>(tick) * kTick_s;
      move();
      if (tick % 5 == 0) {
        gps_odometry();
      }
      if (tick % std::llround(s_.fix_interval_s / kTick_s) == 0) {
        fix();
      }
      deliver();
      keep(gate_.on_lio_odometry_imu_rate(lio_odometry()));
      if (tick % 10 == 0) {
        scan();
      }
    }
  }

  std::vector<DriveSample> samples;
  std::vector<FusionStatus> statuses;
  std::vector<StateUpdate> updates;
  Events events;
  std::map<long long, std::array<bool, 3>> used;  ///< by the fix's tick: axes that became rows
  std::map<Nanoseconds, FixVerdict> verdicts;     ///< by the fix's stamp

  double rms(int first_axis, int last_axis, double from_s = 0.0) const {
    double sum = 0.0;
    std::size_t n = 0;
    for (const DriveSample& sample : samples) {
      if (sample.at_s >= from_s) {
        sum += sample.error_m.segment(first_axis, last_axis - first_axis + 1).squaredNorm();
        ++n;
      }
    }
    return n == 0 ? kNaN : std::sqrt(sum / static_cast<double>(n));
  }

  double worst(int first_axis, int last_axis, double from_s = 0.0, double to_s = 1e9) const {
    double result = 0.0;
    for (const DriveSample& sample : samples) {
      if (sample.at_s >= from_s && sample.at_s <= to_s) {
        result =
            std::max(result, sample.error_m.segment(first_axis, last_axis - first_axis + 1).norm());
      }
    }
    return result;
  }

  /// Of fusion/odometry against the truth, which odom follows within millimetres in 100 ms.
  double largest_step_m(double from_s = 0.0) const {
    double result = 0.0;
    for (std::size_t k = 10; k < samples.size(); ++k) {
      const double step_m = (samples[k].error_m - samples[k - 10].error_m).norm();
      result = samples[k - 10].at_s < from_s ? result : std::max(result, step_m);
    }
    return result;
  }

  std::size_t count(const std::string& code) const {
    for (const NamedCount& entry : statuses.back().verdicts) {
      if (entry.name == code) {
        return entry.count;
      }
    }
    return 0;
  }

  bool has_event(const std::string& code) const {
    return std::any_of(
        events.begin(), events.end(), [&](const Event& event) { return event.code == code; });
  }

  /// Share of the fixes in a time of whose axis became a row.
  double share_used(std::size_t axis, double from_s, double to_s) const {
    double all = 0.0;
    double taken = 0.0;
    for (const long long tick : fixes_) {
      const double at_s = static_cast<double>(tick) * kTick_s;
      if (at_s >= from_s && at_s < to_s) {
        all += 1.0;
        const auto found = used.find(tick);
        taken += found != used.end() && found->second[axis] ? 1.0 : 0.0;
      }
    }
    return all > 0.0 ? taken / all : kNaN;
  }

  const YawPose& mapper_T_map_odom() const { return T_; }

 private:
  static constexpr double kTick_s = 0.01;
  static constexpr double kStart_s = 1000.0;

  static Datum datum() { return {49.0, 8.0, 100.0, 0}; }

  static RobotConfig robot() {
    RobotConfig config;
    config.antenna_position_base_m = {0.4, 0.1, 0.9};
    return config;
  }

  double normal() { return normal_(random_); }

  Eigen::Vector3d normal3() { return {normal(), normal(), normal()}; }

  Nanoseconds stamp(double at_s) const { return from_seconds(kStart_s + at_s); }

  /// Blocks: 12 s straight on, then a quarter turn in 4 s.
  void move() {
    const bool turns = std::fmod(now_s_, 16.0) >= 12.0;
    const double step_m = s_.speed_mps * kTick_s;
    heading_rad_ += turns ? 0.5 * std::numbers::pi / 4.0 * kTick_s : 0.0;
    const Eigen::Vector3d ahead(std::cos(heading_rad_), std::sin(heading_rad_), 0.0);
    p_map_m_ += step_m * ahead;
    distance_m_ += step_m;
    const bool blind = s_.is_blind && s_.is_blind(now_s_);
    const Eigen::Quaterniond q_odom_map = s_.T_map_odom.pose().q.conjugate();
    Eigen::Vector3d seen_odom_m = step_m * (1.0 + s_.lio_scale) * (q_odom_map * ahead);
    if (blind) {
      seen_odom_m.x() *= 1.0 - s_.speed_blind_share;
    }
    seen_odom_m += s_.lio_walk_m_per_sqrt_m * std::sqrt(step_m) * normal3();
    if (now_s_ >= s_.lio_jump_at_s) {
      seen_odom_m += s_.lio_jump_m;
      s_.lio_jump_at_s = 1e9;
    }
    p_odom_m_ += seen_odom_m;
    const double decay = std::exp(-kTick_s / 60.0);
    slow_m_ = decay * slow_m_ + std::sqrt(1.0 - decay * decay) *
                                    Eigen::Vector3d(0.012, 0.012, 0.02).cwiseProduct(normal3());
    poses_[std::llround(now_s_ / kTick_s)] = {T_odom_base(), T_map_base()};
  }

  Pose T_map_base() const { return {from_yaw(heading_rad_), p_map_m_}; }

  Pose T_odom_base() const { return {from_yaw(heading_rad_ - s_.T_map_odom.yaw_rad), p_odom_m_}; }

  Eigen::Vector3d claimed_m() const {
    const double sigma_m = s_.claimed_sigma_m * (s_.claimed_share ? s_.claimed_share(now_s_) : 1.0);
    return {sigma_m, sigma_m, 2.0 * sigma_m};
  }

  Eigen::Matrix3d filter_m2() const {
    const Eigen::Vector3d twice_m = 2.0 * claimed_m();
    const double share = s_.filter_sigma_m ? s_.filter_sigma_m(now_s_) / twice_m.x() : 1.0;
    return (share * twice_m).cwiseAbs2().asDiagonal();
  }

  bool fixes_now() const { return !s_.has_fix || s_.has_fix(now_s_); }

  void no_fix() {
    if (!s_.sends_no_fix) {
      return;
    }
    GnssFix none;
    none.stamp_ns = stamp(now_s_);
    none.status = FixStatus::kNoFix;
    keep(gate_.on_fix(none));
  }

  void fix() {
    if (!fixes_now()) {
      no_fix();
      return;
    }
    Eigen::Vector3d antenna_m = T_map_base() * robot().antenna_position_base_m + slow_m_ +
                                Eigen::Vector3d(0.006, 0.006, 0.01).cwiseProduct(normal3());
    if (s_.lie_enu_m) {
      antenna_m += s_.lie_enu_m(now_s_);
    }
    GnssFix raw;
    raw.stamp_ns = stamp(now_s_);
    raw.status = FixStatus::kGbas;
    const geodesy::Geographic place = frame_.to_geographic(as_received(antenna_m));
    raw.latitude_deg = place.latitude_deg;
    raw.longitude_deg = place.longitude_deg;
    raw.altitude_m = place.height_m;
    raw.covariance_type = CovarianceType::kDiagonalKnown;
    raw.covariance_enu_m2 = claimed_m().cwiseAbs2().asDiagonal();
    const bool refused = s_.is_refused && s_.is_refused(now_s_);
    const FixRecord record{raw.stamp_ns, !refused, refused ? "gate" : "", antenna_m, filter_m2()};
    const double delay_s = s_.delay_s ? s_.delay_s(fixes_.size()) : 0.0;
    fixes_.push_back(std::llround(now_s_ / kTick_s));
    waiting_.emplace(now_s_ + s_.fix_latency_s + delay_s, Waiting{raw, record});
  }

  Eigen::Vector3d as_received(Eigen::Vector3d antenna_m) {
    if (s_.raw_lie_enu_m) {
      antenna_m += s_.raw_lie_enu_m(now_s_);
    }
    if (s_.raw_grid_m > 0.0) {
      antenna_m.head<2>() = (antenna_m.head<2>() / s_.raw_grid_m).array().round() * s_.raw_grid_m;
    }
    return antenna_m;
  }

  void deliver() {
    while (!waiting_.empty() && waiting_.begin()->first <= now_s_) {
      const Waiting come = waiting_.begin()->second;
      waiting_.erase(waiting_.begin());
      keep(gate_.on_fix(come.fix));
      keep(gate_.on_gps_status(status_with(come.record), "gps"));
    }
  }

  /// A filter that believes every fix and keeps what it holds of those of 1.5 s.
  GpsStatus status_with(const FixRecord& record) {
    recent_[record.stamp_ns] = record;
    std::erase_if(recent_,
                  [&](const auto& held) { return held.first < stamp(now_s_) - from_seconds(1.5); });
    const FixRecord& newest = recent_.rbegin()->second;
    GpsStatus status;
    status.stamp_ns = stamp(now_s_);
    status.source = "believer";
    status.health = GpsHealth::kOk;
    status.datum_id = datum().id();
    status.gnss_class = GnssClass::kFixed;
    status.last_accepted_fix_ns = newest.stamp_ns;
    status.accepted_antenna_map_m = newest.antenna_map_m;
    status.accepted_covariance_map_m2 = newest.covariance_map_m2;
    status.fixes_received = ++fixes_received_;
    status.fixes_accepted = fixes_received_;
    for (const auto& [stamp_ns, held] : recent_) {
      if (s_.with_records) {
        status.recent_fixes.push_back(held);
      }
    }
    return status;
  }

  void gps_odometry() {
    Odometry odometry;
    odometry.stamp_ns = stamp(now_s_);
    odometry.frame_id = "map";
    odometry.child_frame_id = "base_link";
    odometry.T_frame_child = T_map_base();
    odometry.linear_mps = {s_.speed_mps, 0.0, 0.0};
    odometry.pose_covariance.topLeftCorner<3, 3>() = filter_m2();
    keep(gate_.on_gps_odometry(odometry, "gps"));
  }

  Odometry lio_odometry() const {
    Odometry odometry;
    odometry.stamp_ns = stamp(now_s_);
    odometry.frame_id = "odom";
    odometry.child_frame_id = "base_link";
    odometry.T_frame_child = T_odom_base();
    odometry.pose_covariance = PoseCovariance::Identity() * 1e-5;
    odometry.linear_mps = {s_.speed_mps, 0.0, 0.0};
    return odometry;
  }

  /// The mapper's drift noise: about the robot, per metre.
  void drift() {
    const double moved_m = distance_m_ - scan_distance_m_;
    scan_distance_m_ = distance_m_;
    const bool blind = s_.is_blind && s_.is_blind(now_s_);
    Eigen::Vector4d turn = Eigen::Vector4d::UnitX();
    turn.tail<3>() = -Eigen::Vector3d::UnitZ().cross(T_.pose().q * p_odom_m_);
    P_ += 0.00035 * 0.00035 * moved_m * turn * turn.transpose();
    P_.bottomRightCorner<3, 3>().diagonal().array() +=
        s_.mapper_walk_m_per_sqrt_m * s_.mapper_walk_m_per_sqrt_m * moved_m;
    if (blind && s_.mapper_knows_blindness) {
      const Eigen::Vector3d along_m = T_.pose().q * Eigen::Vector3d::UnitX();
      P_.bottomRightCorner<3, 3>() += 0.6 * moved_m * along_m * along_m.transpose();
    }
  }

  void scan() {
    drift();
    keep(gate_.on_lio_odometry(lio_odometry()));
    LioStatus status;
    status.stamp_ns = stamp(now_s_);
    status.odom_epoch = 3;
    status.health = LioHealth::kOk;
    const bool blind = s_.is_blind && s_.is_blind(now_s_);
    status.sigma = {blind ? 0.1 : 0.003, 0.003, 0.003, 3e-4, 3e-4, 3e-4};
    status.aligned = aligned_;
    status.T_map_odom = T_;
    status.T_map_odom_covariance = Matrix6d::Identity() * 1e-6;
    status.T_map_odom_covariance.topLeftCorner<4, 4>() = P_;
    keep(gate_.on_lio_status(status));
  }

  void take(const StateUpdate& update) {
    if (update.first_alignment && (!aligned_ || update.first_alignment->replaces)) {
      aligned_ = true;
      T_ = update.first_alignment->T_map_odom;
      P_ = update.first_alignment->covariance;
    }
    if (!aligned_) {
      return;
    }
    const double at_s = to_seconds(update.fix_stamp_ns) - kStart_s;
    const Pose& then = poses_.at(std::llround(at_s / kTick_s)).T_odom_base;
    const Eigen::Vector3d a_m = then * update.lever_arm_base_m;
    Eigen::Matrix<double, 3, 4> H;
    H << Eigen::Vector3d::UnitZ().cross(T_.pose().q * a_m), Eigen::Matrix3d::Identity();
    Eigen::Vector3d innovation = update.position_map_m - T_.pose() * a_m;
    Eigen::Matrix3d R = update.covariance_map_m2;
    std::array<bool, 3> axes{};
    for (int i = 0; i < 3; ++i) {
      axes[static_cast<std::size_t>(i)] =
          update.decision[static_cast<std::size_t>(i)] == AxisDecision::kFused;
      if (!axes[static_cast<std::size_t>(i)]) {
        H.row(i).setZero();
        innovation[i] = 0.0;
      }
    }
    const Eigen::Matrix3d S = H * P_ * H.transpose() + R;
    const Eigen::Matrix<double, 4, 3> K = P_ * H.transpose() * S.inverse();
    const Eigen::Vector4d step = K * innovation;
    T_.yaw_rad += step[0];
    T_.p += step.tail<3>();
    P_ = (P_ - K * H * P_).eval();
    P_ = (0.5 * (P_ + P_.transpose())).eval();
    used[std::llround(at_s / kTick_s)] = axes;
  }

  void keep(const Output& out) {
    events.insert(events.end(), out.events.begin(), out.events.end());
    if (out.status) {
      statuses.push_back(*out.status);
      for (const FixVerdict& verdict : out.status->judged) {
        verdicts[verdict.fix_stamp_ns] = verdict;
      }
    }
    if (out.fused) {
      samples.push_back({now_s_,
                         out.fused->T_frame_child.p - p_map_m_,
                         out.fused_raw->T_frame_child.p - p_map_m_,
                         out.fused->pose_covariance.diagonal().head<3>().cwiseSqrt(),
                         distance_m_});
    }
    for (const StateUpdate& update : out.state_updates) {
      updates.push_back(update);
      take(update);
    }
  }

  struct Poses {
    Pose T_odom_base;
    Pose T_map_base;
  };

  struct Waiting {
    GnssFix fix;
    FixRecord record;
  };

  LyingDriveSettings s_;
  geodesy::LocalFrame frame_;
  FusionGate gate_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  double now_s_{0.0};
  double heading_rad_{0.4};
  double distance_m_{0.0};
  double scan_distance_m_{0.0};
  Eigen::Vector3d p_map_m_{5.0, 5.0, 1.0};
  Eigen::Vector3d p_odom_m_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d slow_m_{Eigen::Vector3d::Zero()};
  std::map<long long, Poses> poses_;
  std::vector<long long> fixes_;            // ticks
  std::multimap<double, Waiting> waiting_;  // by when they come
  std::map<Nanoseconds, FixRecord> recent_;
  std::uint64_t fixes_received_{0};
  bool aligned_{false};
  YawPose T_;
  Eigen::Matrix4d P_;
};

}  // namespace trigpoint::fusion_gate
