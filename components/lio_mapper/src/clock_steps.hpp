// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Whether the LiDAR's clock was set while it ran.
// Two witnesses do not know of it: the scanner turns on in its own rhythm, and the IMU's samples
// arrive as they did before. When the stamps of clouds leave the rhythm by s, and clouds arrive
// earlier against the IMU by the same s, the clock was set by s. A cloud that comes late keeps its
// stamp, a lost one leaves a whole number of turns, and an IMU that stalls leaves the rhythm whole.
#pragma once

#include "trigpoint/base/time.hpp"

#include <cstddef>
#include <deque>
#include <optional>

namespace trigpoint::lio_mapper {

class ClockSteps {
 public:
  enum class Verdict {
    kSteady,
    kDoubtful,  ///< off by a step that the next cloud must confirm
    kStepped,   ///< confirmed: offset_ns() is new
  };

  /// Clouds in the order in which they arrive, with the newest IMU stamp at that time. The stamps
  /// are the LiDAR's own: of the message, which is as regular as the scanner, and of the last
  /// point, which is not, but must go the same way. Changes offset_ns() when the step is confirmed.
  Verdict look(Nanoseconds cloud_stamp_ns, Nanoseconds sweep_end_ns, Nanoseconds newest_imu_ns);

  /// To be added to the LiDAR's stamps so that they go on as they began; 0 until a step.
  Nanoseconds offset_ns() const { return offset_ns_; }

  /// By how much the stamp of the cloud last looked at seems, or was found, to be off.
  Nanoseconds step_ns() const { return step_ns_; }

  /// One sigma of a step, by the jitter of the rhythm.
  double sigma_s() const { return sigma_s_; }

 private:
  struct Typical {
    double middle_s{0.0};
    double spread_s{0.0};  ///< one sigma
  };

  static Typical typical(const std::deque<double>& values_s);
  /// The step that rhythm and arrival agree on.
  std::optional<double> step_s(double interval_s, double late_s, double turn_s, double lag_sigma_s);
  void remember(Nanoseconds stamp_ns, Nanoseconds end_ns, double turn_s, double lag_s);

  Nanoseconds offset_ns_{0};
  Nanoseconds step_ns_{0};
  double sigma_s_{0.0};
  std::optional<Nanoseconds> pending_ns_;     ///< a step that one cloud has shown
  std::optional<Nanoseconds> last_stamp_ns_;  ///< corrected, of the last steady cloud
  Nanoseconds last_end_ns_{0};                ///< of its last point, after its stamp
  std::deque<double> turns_s_;                ///< between clouds, by the number of turns
  std::deque<double> lags_s_;                 ///< newest IMU stamp minus the cloud's
};

}  // namespace trigpoint::lio_mapper
