// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// GpsStatus::rejections is one list of names on the wire; this tells what a name counts.
#pragma once

#include "trigpoint/base/messages.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace trigpoint {

enum class RejectionKind {
  kFixRefused,  ///< also every name that is not known: a foreign filter's own reasons
  kNote,        ///< the fix was used all the same, or it is not about a fix
  kImu,         ///< a refused IMU sample
  kTwist,       ///< a refused message of an optional input
  kYaw          ///< the same
};

inline RejectionKind kind_of_rejection(std::string_view name) {
  constexpr std::array<std::string_view, 5> kNotes{"recovered",
                                                   "state_not_finite",
                                                   "covariance_restored",
                                                   "output_not_finite",
                                                   "datum_not_a_place"};
  if (name.starts_with("imu_")) {
    return RejectionKind::kImu;
  }
  if (name.starts_with("twist_")) {
    return RejectionKind::kTwist;
  }
  if (name.starts_with("yaw_")) {
    return RejectionKind::kYaw;
  }
  const bool note =
      name.starts_with("used_") || std::find(kNotes.begin(), kNotes.end(), name) != kNotes.end();
  return note ? RejectionKind::kNote : RejectionKind::kFixRefused;
}

/// The counts of one kind by name; equal names are added up.
inline std::map<std::string, std::uint64_t> rejections_of_kind(
    const std::vector<NamedCount>& rejections,
    RejectionKind kind) {
  std::map<std::string, std::uint64_t> result;
  for (const NamedCount& entry : rejections) {
    if (kind_of_rejection(entry.name) == kind) {
      result[entry.name] += entry.count;
    }
  }
  return result;
}

}  // namespace trigpoint
