// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>

namespace trigpoint::fusion_gate {

/// One piece of GPS information: the antenna in map at a fix's stamp, whoever says so.
struct AcceptedFix {
  Nanoseconds stamp_ns{0};
  Eigen::Vector3d antenna_map_m{Eigen::Vector3d::Constant(kNaN)};
  Eigen::Matrix3d covariance_map_m2{Eigen::Matrix3d::Identity() * kUnknownVariance};
  bool is_recorded{false};  ///< told of in a record of its own
};

/// Its variance along east or north, whichever is larger.
inline double level_m2(const AcceptedFix& fix) {
  return fix.covariance_map_m2.diagonal().head<2>().maxCoeff();
}

/// A receiver that says less than this share of the filter's variance is not believed more.
inline constexpr double kLeastShare = 0.1;

/// Why something is refused: `code` is short, stable and counted, `reason` is the sentence.
struct Refusal {
  std::string code;
  std::string reason;
};

/// `datum_id` is ours, empty when none is known.
std::optional<Refusal> check_status(const GpsStatus& status, const std::string& datum_id);

/// Position and covariance finite, variances above zero.
std::optional<Refusal> check_values(const AcceptedFix& fix);

/// A fix further than `max_age_s` behind LIO's newest stamp.
std::optional<Refusal> check_age(const AcceptedFix& fix,
                                 std::optional<Nanoseconds> lio_newest_ns,
                                 double max_age_s);

const char* name_of(GpsHealth health);

/// Of a fix that the GPS filter refused.
std::string refused_code(const std::string& reason);

/// Its reason where it was too far from where the filter expected it.
inline constexpr const char* kFilterGate = "gate";

}  // namespace trigpoint::fusion_gate
