// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/gyro_unit_check.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"

#include "propagation.hpp"

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// Counts by reason, in order of first appearance.
class Tally {
 public:
  void add(const std::string& reason);

  /// Goes on from the counts of an earlier run.
  void set(const std::vector<NamedCount>& counts) { counts_ = counts; }

  const std::vector<NamedCount>& counts() const { return counts_; }

 private:
  std::vector<NamedCount> counts_;
};

/// Finds axes that stand at the end of their range: the largest magnitude ever seen, and the very
/// same number several times in a row, which an axis with noise does not give.
class SaturationCheck {
 public:
  bool add(const Eigen::Vector3d& gyro_radps, const Eigen::Vector3d& accel_mps2);

 private:
  struct Axis {
    double last{0.0};
    double largest{0.0};
    int repeats{0};
    int changes{0};
  };

  static bool add(double value, double least, Axis& axis);

  std::array<Axis, 6> axes_;
};

/// Lets samples in that are finite, possible and newer than the last one, turned into base axes.
/// Once the gyro is found to speak in degrees a second, none comes in any more.
class ImuIntake {
 public:
  explicit ImuIntake(const Eigen::Quaterniond& q_base_imu) : q_base_imu_(q_base_imu) {}

  std::optional<InertialSample> accept(const ImuSample& sample, double max_gap_s, Events& events);

  std::uint64_t received() const { return received_; }

 private:
  std::optional<Event> objection(const ImuSample& sample) const;

  Eigen::Quaterniond q_base_imu_;
  GyroUnitCheck gyro_unit_;
  SaturationCheck saturation_;
  Nanoseconds saturation_told_ns_{0};
  Nanoseconds newest_ns_{0};
  std::uint64_t received_{0};
  std::uint64_t accepted_{0};
};

}  // namespace trigpoint::lio_mapper
