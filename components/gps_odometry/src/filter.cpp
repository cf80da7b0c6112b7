// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "filter.hpp"

#include "trigpoint/base/config.hpp"

#include "ekf_tracker.hpp"
#include "ins_tracker.hpp"
#include "rewind.hpp"
#include "strict_filter.hpp"

namespace trigpoint::gps_odometry {

namespace {

template <typename TrackerType>
class BufferedFilter : public Filter {
 public:
  BufferedFilter(const Config& config, const RobotConfig& robot)
      : tracker_(config, robot.antenna_position_base_m),
        buffer_(tracker_, from_seconds(config.rewind_s)) {}

  const char* source() const override { return TrackerType::kSource; }

  void insert(const CheckedImu& imu) override { buffer_.insert(imu); }

  FixOutcome insert(const MapFix& fix) override { return buffer_.insert(fix); }

  FixOutcome insert(const CheckedTwist& twist) override { return buffer_.insert(twist); }

  FixOutcome insert(const Heading& yaw) override { return buffer_.insert(yaw); }

  bool is_too_old(Nanoseconds stamp_ns) const override { return buffer_.is_too_old(stamp_ns); }

  bool has_fix_at(Nanoseconds stamp_ns) const override { return buffer_.has_fix_at(stamp_ns); }

  std::vector<FixRecord> recent_fixes() const override { return buffer_.fixes(); }

  std::optional<Nanoseconds> newest_imu_ns() const override { return buffer_.newest_imu_ns(); }

  bool bridges_gap_until(Nanoseconds stamp_ns) const override {
    const auto newest_ns = buffer_.newest_imu_ns();
    return newest_ns && stamp_ns > *newest_ns &&
           tracker_.bridges(to_seconds(stamp_ns - *newest_ns));
  }

  void restart() override { buffer_.restart(); }

  void change_frame(const Eigen::Matrix3d& R_new_old, const Eigen::Vector3d& t_new_old) override {
    buffer_.change_frame(R_new_old, t_new_old);
  }

  void announce_reset(const YawPose& delta) override { buffer_.announce_reset(delta); }

  void warm_start(const WarmState& state) override {
    buffer_.replace_newest([&](auto& track) { tracker_.warm_start(track, state); });
  }

  const Track& newest() const override { return buffer_.newest(); }

  Estimate estimate() const override { return tracker_.estimate(buffer_.newest()); }

  double speed_mps() const override { return tracker_.speed_mps(buffer_.newest()); }

  double yaw_sigma_rad() const override { return tracker_.yaw_sigma_rad(buffer_.newest()); }

  bool is_doubtful() const override { return tracker_.is_doubtful(buffer_.newest()); }

 private:
  TrackerType tracker_;
  RewindBuffer<TrackerType> buffer_;
};

}  // namespace

std::unique_ptr<Filter> make_filter(const Config& config, const RobotConfig& robot) {
  if (config.filter == EkfTracker::kSource) {
    return std::make_unique<BufferedFilter<EkfTracker>>(config, robot);
  }
  if (config.filter == InsTracker::kSource) {
    return std::make_unique<BufferedFilter<InsTracker>>(config, robot);
  }
  for (const StrictSettings& settings : {published_settings(), lio_sam_settings()}) {
    if (config.filter == settings.name) {
      return std::make_unique<StrictFilter>(config, robot, settings);
    }
  }
  throw ConfigError("gps_odometry: there is no filter '" + config.filter +
                    "', expected ekf15, eskf18, ekf15_strict or ekf15_lio_sam.");
}

}  // namespace trigpoint::gps_odometry
