// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/lio_mapper/checkpoint.hpp"
#include "trigpoint/lio_mapper/cloud_decoder.hpp"
#include "trigpoint/lio_mapper/config.hpp"
#include "trigpoint/lio_mapper/stages.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// A scan worth keeping for the saved map: its undistorted, down-sampled points and where it was.
struct Keyframe {
  std::uint64_t id{0};
  Nanoseconds stamp_ns{0};
  std::uint32_t odom_epoch{0};
  Pose T_odom_base;
  Matrix6d pose_covariance{Matrix6d::Zero()};
  bool aligned{false};
  YawPose T_map_odom;  ///< at that time
  PointCloud points_base;
};

class CorrectedMap;
struct GraphInput;
struct PastSnapshot;

/// One sweep that went through the filter.
struct ScanResult {
  Odometry odometry;  ///< base_link in odom at the sweep's last point
  LioStatus status;
  PointCloud points_odom;  ///< registered points (undistorted, down-sampled as configured)
  std::optional<Keyframe> keyframe;
  Checkpoint checkpoint;        ///< after this scan
  std::vector<StoredRow> rows;  ///< decided since the scan before
};

/// How to go on from a checkpoint.
struct ResumeOptions {
  /// The stored map is used as it is: nothing enters it, no keyframe is made, and it is loaded
  /// around the robot as that moves.
  bool frozen_map{false};
  /// Where the robot may be besides the checkpoint's own place, likeliest first.
  std::vector<Pose> more_places_odom;
};

struct Output {
  std::vector<ScanResult> scans;              ///< usually none or one
  std::optional<Odometry> odometry_imu_rate;  ///< propagated to the newest IMU sample
  Events events;
};

/// What the mapper found out about the sensors.
struct Calibration {
  Pose T_base_lidar;  ///< in use: configured, or estimated
  /// Position in base, rotation about LiDAR axes; zero unless estimated.
  Matrix6d extrinsic_covariance = Matrix6d::Zero();
  /// To be added to LiDAR stamps, on top of sweep.time_offset_s; NaN until it is known.
  double clock_offset_s{kNaN};
  double clock_offset_sigma_s{kNaN};
};

/// FAST-LIO2-style estimator [W. Xu et al., FAST-LIO2, T-RO 2022] with T_map_odom in its state.
/// Deterministic and single-threaded to its user; no clock: the same inputs in the same order give
/// the same bits. Never throws on data: refused inputs are counted in LioStatus and told as events.
class LioMapper {
 public:
  /// Throws ConfigError when the configuration contradicts itself.
  LioMapper(const Config& config, const RobotConfig& robot);
  ~LioMapper();

  Output on_imu(const ImuSample& sample);
  /// A sweep is processed as soon as the IMU covers its last point.
  Output on_cloud(const PointCloudMessage& cloud);
  /// The same for a cloud that a CloudDecoder with the same configuration has read. Feed a mapper
  /// in one of the two ways: each decoder learns the meaning of point times for itself.
  Output on_decoded_cloud(DecodedCloud cloud);
  /// Rows from the gate, at most one set per fix, applied at the fix's stamp.
  Output on_state_update(const StateUpdate& update);
  /// Processes what waits for IMU samples that will not come (end of a log).
  Output finish();

  /// Before the first input: odom, T_map_odom and counters of an earlier run go on. The ordinary
  /// start runs in a frame of its own and is registered against the stored points near the
  /// checkpoint (event `lio_resumed`); when that fails odom begins anew with the next epoch
  /// (`lio_not_resumed`). `points` is called from inputs; what it throws goes through.
  void resume(const Checkpoint& checkpoint, StoredPoints points, const ResumeOptions& options = {});

  /// From now on remembers poses, rows and odom for corrections of the past (`past.hpp`; README,
  /// "The past"); `earlier` is what a session that goes on holds of them. Before the first input.
  void keep_past(const GraphInput& earlier);
  /// Why the past should be corrected now; nothing when there is no reason to.
  std::optional<std::string> past_is_due() const;
  /// A copy of what is remembered. From here on what enters the local map is kept as well, until
  /// adopt() or forget_snapshot(). Not before past_is_due().
  PastSnapshot past_snapshot();
  /// The points that have entered the local map since the snapshot or the last call, scan by scan.
  std::vector<PointCloud> take_inserted();
  /// Matches against `corrected` from the next scan on; what take_inserted() would give is inserted
  /// first. Where nothing has changed the map stays. Poses do not change. Afterwards `corrected`
  /// holds the old map, to be disposed of wherever that disturbs nobody. False, and nothing
  /// happens, when it is of another odom epoch or came too late.
  bool adopt(CorrectedMap& corrected);
  /// Nothing came of it.
  void forget_snapshot();

  /// What a restart needs; nothing before the first scan.
  std::optional<Checkpoint> checkpoint() const;
  /// Decided since the newest scan: belong to the checkpoint above.
  std::vector<StoredRow> take_rows();

  /// Tells what it is doing, from the next input on; for benchmarks.
  void observe_stages(StageObserver observer);

  /// Of the local map.
  std::size_t map_memory_bytes() const;

  /// The points of the local map, in odom.
  PointCloud local_map() const;

  Calibration calibration() const;

  /// The newest status, also between scans.
  LioStatus status() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::lio_mapper
