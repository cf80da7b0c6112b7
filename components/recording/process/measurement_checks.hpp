// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace trigpoint::recording {

/// Looks at measurements as they come and remembers what would keep the filters from using them:
/// units, frames, missing fields, stamps that go back.
class MeasurementChecks {
 public:
  /// What Trigpoint itself publishes (datum, registered clouds, the map) has no receiver's
  /// covariance, no time per point, and for what is not of a moment a stamp of 0.
  enum class Origin { kSensor, kOurs };

  explicit MeasurementChecks(Origin origin = Origin::kSensor) : origin_(origin) {}

  void take(const ImuSample& sample);
  void take(const GnssFix& fix);
  void take(const PointCloudMessage& cloud);
  void take(const Odometry& odometry);
  void note(const std::string& sentence);

  /// Sentences with the numbers and what to do, each with how often it was seen.
  std::vector<std::string> remarks() const;

 private:
  void check_stamp(Nanoseconds stamp_ns, const std::string& frame_id, Nanoseconds allowed_ns = 0);

  Origin origin_;
  std::map<std::string, std::uint64_t> notes_;
  Nanoseconds newest_ns_{0};
  std::uint64_t imu_samples_{0};
  double accel_sum_mps2_{0.0};
  double accel_z_sum_mps2_{0.0};
  double gyro_peak_radps_{0.0};
  std::uint64_t clouds_with_ranges_{0};
  double range_sum_m_{0.0};  ///< of the clouds' median ranges
};

}  // namespace trigpoint::recording
