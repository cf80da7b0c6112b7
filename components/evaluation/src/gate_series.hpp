// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the plots over time say of the gate's choices and sigmas.
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/time.hpp"

#include <array>
#include <cstddef>
#include <vector>

namespace trigpoint::evaluation {

inline constexpr std::array<const char*, 3> kAxisNames{"east", "north", "up"};
/// By AxisSource.
inline constexpr std::array<const char*, 4> kSourceNames{"none", "lio", "fused", "gps"};
/// Logarithmic scales begin there.
inline constexpr double kLowestSigma_m = 1e-3;
inline constexpr double kLowestError_m = 1e-3;

/// Finite, positive, and not that of a kUnknownVariance.
bool is_known_sigma(double sigma_m);

/// What all gates of a session counted: one that was started again, or that goes on with a session,
/// counts from zero.
struct GateTotals {
  std::uint64_t fixes_seen{0};
  std::uint64_t fixes_used{0};
  std::vector<NamedCount> verdicts;
};

GateTotals totals_of(const std::vector<FusionStatus>& rows);

/// A stretch in which the gate took an axis from one source, until it took it from the next one.
struct SourceRun {
  AxisSource source;
  Nanoseconds begin_ns;
  Nanoseconds end_ns;
};

std::vector<SourceRun> source_runs(const std::vector<FusionStatus>& rows, std::size_t axis);

}  // namespace trigpoint::evaluation
