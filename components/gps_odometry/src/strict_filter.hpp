// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Strict mode as a filter of the same harness: what a robot gets that puts the published
// Moore-Stouch filter (moore_stouch.hpp) behind our checks of inputs and before our outputs. To
// compare with, not to drive with; no program of its own.
#pragma once

#include "ekf_tracker.hpp"
#include "filter.hpp"
#include "moore_stouch_replay.hpp"
#include "rewind.hpp"

namespace trigpoint::gps_odometry {

/// What the published filter is set to.
struct StrictSettings {
  const char* name;  ///< as gps_odometry.filter names it
  double rate_hz;    ///< ticks of its timer
  Vector15d process_noise_per_s;
  bool zero_altitude;  ///< every fix is taken to put base_link at the datum's height
};

/// Its own defaults.
StrictSettings published_settings();
/// What LIO-SAM ships for its bags (config/params.yaml, sections navsat and ekf_gps).
StrictSettings lio_sam_settings();

/// Until the heading is found this is ekf15, since the published filter cannot find one. From then
/// on: a tick every 1 / rate_hz; fixes are positions in the present state however late, without
/// gate, the lever arm turned by the present attitude and subtracted; of the IMU roll, pitch, all
/// rates and all accelerations; P is published as it is.
class StrictFilter : public Filter {
 public:
  StrictFilter(const Config& config, const RobotConfig& robot, const StrictSettings& settings);

  const char* source() const override { return settings_.name; }

  void insert(const CheckedImu& imu) override;
  FixOutcome insert(const MapFix& fix) override;
  /// The published filter is compared with GPS and IMU alone.
  FixOutcome insert(const CheckedTwist& twist) override;
  FixOutcome insert(const Heading& yaw) override;
  /// Also what is older than the newest fix: the published filter drops it.
  bool is_too_old(Nanoseconds stamp_ns) const override;

  bool has_fix_at(Nanoseconds stamp_ns) const override;
  /// None once it runs: the published filter does not go back.
  std::vector<FixRecord> recent_fixes() const override;

  std::optional<Nanoseconds> newest_imu_ns() const override;

  /// It predicts over any gap, in one step.
  bool bridges_gap_until(Nanoseconds stamp_ns) const override;
  void restart() override;
  void change_frame(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t_new_old) override;
  void announce_reset(const YawPose& delta) override;

  /// Offline there is no other filter to begin from: it begins by itself.
  void warm_start(const WarmState&) override {}

  const Track& newest() const override { return track_; }

  Estimate estimate() const override;
  double speed_mps() const override;
  double yaw_sigma_rad() const override;

  bool is_doubtful() const override { return false; }

 private:
  double tick_s() const { return 1.0 / settings_.rate_hz; }

  bool is_running() const { return track_.phase == Phase::kRunning; }

  Vector15d& x() { return replay_.filter().x; }

  const Vector15d& x() const { return replay_.filter().x; }

  const Matrix15d& P() const { return replay_.filter().P; }

  void follow_start();
  void begin();
  void tick(Nanoseconds now_ns);
  Eigen::Quaterniond level(const CheckedImu& imu);

  Config config_;
  StrictSettings settings_;
  Eigen::Vector3d lever_base_m_;
  EkfTracker start_tracker_;
  std::optional<RewindBuffer<EkfTracker>> start_;
  Track before_start_;  ///< its counts go on
  MooreStouchReplay replay_;
  Track track_;
  std::optional<Nanoseconds> imu_ns_;
  Nanoseconds tick_ns_{0};
  Eigen::Vector3d up_base_{Eigen::Vector3d::UnitZ()};  ///< of the stand-in for an attitude sensor
};

}  // namespace trigpoint::gps_odometry
