// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/export/map.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"

#include <functional>
#include <optional>
#include <string>

namespace trigpoint::exporter {

/// Calls its argument with every keyframe in order of time; is called several times.
using KeyframeSource =
    std::function<void(const std::function<void(const lio_mapper::Keyframe&)>& visit)>;

/// render_map on keyframes from anywhere.
MapReport render_keyframes(const KeyframeSource& keyframes,
                           const std::optional<Alignment>& fallback,
                           double voxel_m,
                           const std::string& out_pcd,
                           const std::function<void(double)>& progress,
                           const MapCorrections& corrections = {});

}  // namespace trigpoint::exporter
