// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/time.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"

namespace trigpoint::lio_mapper {

/// Says what was found out about the sensors when it is settled, and what contradicts the
/// configuration.
class CalibrationReport {
 public:
  CalibrationReport(const Config& config, const Pose& T_base_lidar)
      : estimates_extrinsic_(config.extrinsic.estimate),
        rotation_sigma_rad_(config.extrinsic.rotation_sigma_rad),
        configured_time_offset_s_(config.sweep.time_offset_s),
        configured_T_base_lidar_(T_base_lidar) {}

  /// After every scan.
  void look(const Calibration& calibration, Nanoseconds stamp_ns, Events& events);

 private:
  void look_at_clock(const Calibration& calibration, Nanoseconds stamp_ns, Events& events);
  void look_at_extrinsic(const Calibration& calibration, Nanoseconds stamp_ns, Events& events);

  bool estimates_extrinsic_;
  double rotation_sigma_rad_;
  double configured_time_offset_s_;
  Pose configured_T_base_lidar_;
  bool clock_known_{false};
  double clock_told_s_{0.0};  ///< the offset of the last warning
  bool extrinsic_settled_{false};
  bool extrinsic_warned_{false};
};

}  // namespace trigpoint::lio_mapper
