// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "mapper_impl.hpp"

#include <utility>

namespace trigpoint::lio_mapper {

GraphKeyframe graph_keyframe_of(const Keyframe& keyframe) {
  return {keyframe.stamp_ns,
          keyframe.odom_epoch,
          keyframe.T_odom_base,
          keyframe.aligned,
          keyframe.T_map_odom};
}

void LioMapper::Impl::remember(const ScanResult& result) {
  if (!past) {
    return;
  }
  const Odometry& odometry = result.odometry;
  past->on_scan({odometry.stamp_ns, status.odom_epoch, odometry.T_frame_child});
  if (result.keyframe) {
    past->on_keyframe(graph_keyframe_of(*result.keyframe));
  }
}

void LioMapper::keep_past(const GraphInput& earlier) {
  // A map that is not ours stays as it is, and so does one that teaches the extrinsic.
  const Config& config = impl_->config;
  if (config.past.enabled && !config.extrinsic.estimate && !impl_->stored_points) {
    impl_->past.emplace(config.past, earlier);
  }
}

std::optional<std::string> LioMapper::past_is_due() const {
  return impl_->past && impl_->filter ? impl_->past->due() : std::nullopt;
}

PastSnapshot LioMapper::past_snapshot() {
  return impl_->past->snapshot(impl_->config);
}

std::vector<PointCloud> LioMapper::take_inserted() {
  return impl_->past ? impl_->past->take_inserted() : std::vector<PointCloud>{};
}

bool LioMapper::adopt(CorrectedMap& corrected) {
  if (!impl_->past || !impl_->filter || !impl_->past->is_current(corrected.snapshot_)) {
    return false;
  }
  if (corrected.report.changed) {
    corrected.insert(impl_->past->take_inserted());
    impl_->filter->swap_map(corrected.map_);
  }
  impl_->past->conclude(corrected.snapshot_, corrected.past_, corrected.T_odom_frame_);
  return true;
}

void LioMapper::forget_snapshot() {
  if (impl_->past) {
    impl_->past->conclude();
  }
}

}  // namespace trigpoint::lio_mapper
