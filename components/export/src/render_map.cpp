// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "render_map.hpp"

#include "trigpoint/lio_mapper/keyframe_store.hpp"

namespace trigpoint::exporter {

MapReport render_map(const std::string& keyframes_file,
                     const std::optional<Alignment>& fallback,
                     double voxel_m,
                     const std::string& out_pcd,
                     const std::function<void(double)>& progress,
                     const MapCorrections& corrections) {
  return render_keyframes(
      [&](const auto& visit) { lio_mapper::read_keyframes(keyframes_file, visit); },
      fallback,
      voxel_m,
      out_pcd,
      progress,
      corrections);
}

}  // namespace trigpoint::exporter
