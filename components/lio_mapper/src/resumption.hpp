// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Going on with an odom that another mapper began: where a start of its own lies in the old map.
#pragma once

#include "trigpoint/base/pose.hpp"
#include "trigpoint/lio_mapper/checkpoint.hpp"
#include "trigpoint/lio_mapper/config.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"

#include "imu_buffer.hpp"
#include "relocaliser.hpp"
#include "scan_filter.hpp"
#include "start_up.hpp"
#include "sweep.hpp"

#include <deque>
#include <optional>
#include <string>

namespace trigpoint::lio_mapper {

/// The local map for a place, from stored points; empty when there are none.
std::unique_ptr<LocalMap> load_map(const LocalMapConfig& config,
                                   const StoredPoints& points,
                                   std::uint32_t odom_epoch,
                                   const Eigen::Vector3d& center_odom_m,
                                   bool recent_stretch);

class Resumption {
 public:
  Resumption(const Config& config,
             const Checkpoint& checkpoint,
             StoredPoints points,
             const ResumeOptions& options);

  struct Found {
    InitialState initial;  ///< the start, in the old odom
    Past past;
    std::string text;  ///< how far from the prediction, and how well it fits
  };

  /// True when enough new sweeps wait for another attempt.
  bool is_due(std::size_t waiting_sweeps) const { return waiting_sweeps >= next_at_; }

  /// `start` is an ordinary start over `sweeps`, in a frame of its own.
  std::optional<Found> attempt(const StartResult& start,
                               const Pose& T_base_lidar,
                               const ImuBuffer& imu,
                               const std::deque<Sweep>& sweeps);

  /// Tried once, before an ordinary start is possible, by who was away for a moment only: the robot
  /// goes on as it went, and must be found where that leads.
  std::optional<Found> attempt_at_once(const Pose& T_base_lidar,
                                       const ImuBuffer& imu,
                                       const std::deque<Sweep>& sweeps);

  bool has_given_up() const { return attempts_ >= config_.recovery.attempts; }

  /// Why the last attempt failed.
  const std::string& obstacle() const { return obstacle_; }

 private:
  /// Around where the newest sweep is expected: at the places known, and where speed and turn lead
  /// from the checkpoint until `now_ns`, each moved on as the waiting sweeps themselves tell.
  std::vector<SearchArea> areas(Nanoseconds now_ns,
                                double turn_radps,
                                const Pose& T_first_newest) const;
  /// Of the newest sweep, when the robot went on at its speed and turned evenly.
  Pose predicted_place(double away_s, double turned_rad, const Pose& T_first_newest) const;
  StartResult going_on(Nanoseconds stamp_ns) const;
  std::optional<Found> look_in(const std::vector<SearchArea>& areas,
                               const StartResult& start,
                               const LevelScan& scan,
                               const Pose& T_new_base);
  Found compose(const StartResult& start,
                const Pose& T_old_new,
                const Registration& registration,
                std::unique_ptr<LocalMap> map) const;

  Config config_;
  Checkpoint checkpoint_;
  StoredPoints points_;
  ResumeOptions options_;
  bool tried_at_once_{false};
  std::int64_t attempts_{0};
  std::size_t next_at_{0};
  std::string obstacle_;
};

/// Offset in the plane, height and heading as a sentence part.
std::string offset_text(const Pose& T_from, const Pose& T_to);

}  // namespace trigpoint::lio_mapper
