// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/pose.hpp"

#include "propagation.hpp"
#include "sweep.hpp"

namespace trigpoint::lio_mapper {

/// The sweep's points as they would have been seen all at once at its end, in base axes there.
/// Motion is tabulated at the edges of bins of time and interpolated between them, matrix element
/// by element: over a bin of 0.5 ms the error is (omega dt)^2 / 8 of the range, micrometres.
PointCloud undistort(const Sweep& sweep, const Path& path, const Pose& T_base_lidar);

}  // namespace trigpoint::lio_mapper
