// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What goes wrong with the sensors, and when. A new fault is a class in its own file under faults/
// and one line in fault_registry.cpp.
#pragma once

#include "trigpoint/base/config.hpp"
#include "trigpoint/base/measurements.hpp"

#include "random.hpp"
#include "registry.hpp"
#include <Eigen/Core>

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

namespace trigpoint::simulator {

/// What the driver writes over the message that the model makes; the rest stays.
struct GnssReport {
  std::optional<double> latitude_deg;
  std::optional<double> longitude_deg;
  std::optional<double> altitude_m;
  std::optional<Eigen::Vector3d> variance_enu_m2;
  bool covariance_unknown{false};  ///< zeros, of type unknown
};

/// One fix on its way from the sky to the wire. ENU of the antenna.
struct GnssEpoch {
  Nanoseconds stamp_ns{0};
  double period_s{0.0};                                    ///< until the next epoch
  Eigen::Vector3d antenna_map_m{Eigen::Vector3d::Zero()};  ///< where the antenna truly is
  std::string gnss_class;   ///< decides the errors, and what the driver reports
  double error_scale{1.0};  ///< on the errors of the class
  Eigen::Vector3d extra_error_m{Eigen::Vector3d::Zero()};  ///< on top of them
  double latency_s{0.0};
  bool lost{false};
  Nanoseconds stamp_shift_ns{0};  ///< what the receiver's clock is off by
  GnssReport report;
  bool frozen{false};  ///< the last message again, with this stamp
  int copies{0};       ///< that arrive besides the first
  double copies_apart_s{0.0};
};

struct ImuEpoch {
  ImuSample sample;
  bool lost{false};
  Nanoseconds stamp_shift_ns{0};  ///< what the sensor's clock is off by
  bool frozen{false};             ///< the last sample again, with this stamp
};

/// One sweep before its rays are cast.
struct SweepEpoch {
  Nanoseconds stamp_ns{0};
  bool lost{false};               ///< no message at all
  bool blank{false};              ///< a message without points
  double dropout{0.0};            ///< share of returns lost
  double nan_share{0.0};          ///< of the returns that come as not a number
  std::optional<double> cover_m;  ///< every ray ends on a cover that near
  std::optional<std::uint16_t> only_ring;
  Nanoseconds stamp_shift_ns{0};  ///< what the scanner's clock is off by
};

/// The moment at which a fault acts.
struct FaultMoment {
  double since_start_s{0.0};
  Random& each;   ///< new at every measurement
  Random& whole;  ///< the same numbers at every measurement: draws that hold for the whole fault
  std::uint64_t seed{0};  ///< the fault's own: for what depends on time in some other way
};

class Fault {
 public:
  virtual ~Fault() = default;

  /// The fault's own settings, besides type, start_s and duration_s.
  virtual void describe(ConfigFields& fields) = 0;

  // Called only while the fault is active.
  virtual void on_gnss(GnssEpoch&, const FaultMoment&) const {}

  virtual void on_imu(ImuEpoch&, const FaultMoment&) const {}

  virtual void on_sweep(SweepEpoch&, const FaultMoment&) const {}

  /// How much earlier than by the sensor's own latency a message can come because of it.
  virtual double brings_forward_s() const { return 0.0; }

  std::string type;
  double start_s{0.0};  ///< from the scenario's start
  double duration_s{std::numeric_limits<double>::max()};
};

const Registry<Fault>& fault_registry();

}  // namespace trigpoint::simulator
