// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What must be known about a message beyond its own numbers before it comes near the filter: frame,
// clock, distance from the datum; and whether IMU and fixes turn alike.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include "clock_offset.hpp"
#include "filter.hpp"
#include "place_checks.hpp"
#include "turn_check.hpp"

#include <optional>
#include <string>

namespace trigpoint::gps_odometry {

struct Refusal {
  std::string reason;
  std::string text;  ///< empty: has been told before
};

enum class Source : std::uint8_t { kImu, kFix, kTwist };

class Admission {
 public:
  Admission(const Config& config, const RobotConfig& robot);

  std::optional<Refusal> check_frame(Source source, const std::string& frame_id);

  /// Puts the stamp on the IMU's clock.
  std::optional<Refusal> check_clock(CheckedFix& fix,
                                     std::optional<Nanoseconds> imu_ns,
                                     Events& events);

  /// Whether the rewind buffer has a place for it.
  std::optional<Refusal> check_order(const CheckedFix& fix, const Filter& filter);

  /// Fixes in a row that are ahead of the IMU: three mean that it has stopped.
  bool imu_is_silent() const { return fixes_ahead_ >= 3; }

  void hear_imu() { fixes_ahead_ = 0; }

  /// `frame`: nullptr before the first fix.
  std::optional<Refusal> check_place(const CheckedFix& fix,
                                     const geodesy::LocalFrame* frame,
                                     bool has_datum,
                                     Events& events);

  /// Of a twist or a yaw (`kind`).
  std::optional<Refusal> check_time(const std::string& kind,
                                    Nanoseconds stamp_ns,
                                    const Filter& filter) const;

  TurnCheck turns;

 private:
  Nanoseconds future_limit_ns_;
  double rewind_s_;
  int fixes_ahead_{0};
  Nanoseconds newest_ahead_ns_{0};
  ClockOffset clock_;
  DatumDistance distance_;
  HeightReference height_reference_;
  FrameIds imu_frames_;
  FrameIds fix_frames_;
  FrameIds twist_frames_;
};

/// What a stamp that is off by sigma does to a fix: (v sigma)^2 along the way.
Eigen::Matrix3d stamp_covariance_m2(double stamp_sigma_s, const Filter& filter);

/// map by the configured projection; beyond the end of UTM by the tangent plane, the same map.
geodesy::LocalFrame make_frame(const Datum& datum, const Config& config);

/// With the paper's projection: what the grid would do to distances and directions.
std::optional<Event> projection_event(const geodesy::LocalFrame& frame,
                                      const Config& config,
                                      Nanoseconds now_ns);

}  // namespace trigpoint::gps_odometry
