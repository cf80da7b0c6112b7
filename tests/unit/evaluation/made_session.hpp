// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>

namespace trigpoint::evaluation::test {

/// What the session below was made to contain, for comparison with the report.
inline constexpr double kFusedEastError_m = 0.03;  ///< with GPS
inline constexpr double kOutageEndError_m = 0.40;  ///< grows linearly in the outage
inline constexpr int kScans = 1200;                ///< 10 Hz, 120 s
inline constexpr int kOutageBegin_s = 60;
inline constexpr int kOutageEnd_s = 80;

/// Fills `folder` with the files of a drive round a figure of eight: fused off by 3 cm to the east
/// and drifting in an outage, lio turned and drifting, a wall along the road as map.
void make_session(const std::string& folder, bool with_truth = true);

}  // namespace trigpoint::evaluation::test
