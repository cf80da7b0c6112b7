// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include "counters.hpp"
#include "track.hpp"

#include <optional>

namespace trigpoint::gps_odometry {

/// What health depends on besides the Track.
struct Surroundings {
  Nanoseconds now_ns{0};  ///< newest data time
  bool has_datum{false};
  bool imu_faulty{false};
  bool imu_silent{false};
  bool filter_doubts{false};  ///< the filter has a reason of its own
};

GpsHealth health_of(const Track& track,
                    double yaw_sigma_rad,
                    const Surroundings& around,
                    const Config& config);

/// When gps/status went out last, and with what.
struct LastTold {
  std::optional<Nanoseconds> stamp_ns;
  GpsHealth health{GpsHealth::kInit};

  /// After a second, and at once when health differs: it changes by time alone, too, and who
  /// follows this filter may have a better one.
  bool is_outdated(Nanoseconds now_ns, GpsHealth now) const {
    return !stamp_ns || now_ns - *stamp_ns >= kNanosecondsPerSecond || now != health;
  }
};

/// Age of the last accepted fix above which the filter counts as dead reckoning: the configured
/// one, or two and a half intervals of a slow receiver.
double dead_reckoning_age_s(const Track& track, const Config& config);

/// Refusals by reason: those of single messages and those that the Track decided.
std::vector<NamedCount> rejections_of(const Track& track, const Counters& messages);

}  // namespace trigpoint::gps_odometry
