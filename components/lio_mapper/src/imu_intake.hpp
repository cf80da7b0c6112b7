// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/gyro_unit_check.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"

#include "propagation.hpp"

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
  Nanoseconds newest_ns_{0};
  std::uint64_t received_{0};
  std::uint64_t accepted_{0};
};

}  // namespace trigpoint::lio_mapper
