// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/point_cloud.hpp"
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/export/map.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include <filesystem>

namespace trigpoint::exporter {

bool visit_placed_keyframes(const std::string& session, const VisitKeyframe& visit) {
  const std::string keyframes = path_in(session, session_file::kKeyframes);
  const std::optional<CorrectedPoses> corrected = read_corrected(session);
  if (!corrected || !std::filesystem::exists(keyframes)) {
    return false;
  }
  lio_mapper::read_keyframes(keyframes, [&](const lio_mapper::Keyframe& keyframe) {
    const auto pose = corrected->T_frame_base.find(keyframe.stamp_ns);
    if (pose != corrected->T_frame_base.end()) {
      visit(pose->second, moved(keyframe.points_base, pose->second));
    }
  });
  return true;
}

}  // namespace trigpoint::exporter
