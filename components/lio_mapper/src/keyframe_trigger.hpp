// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/pose.hpp"
#include "trigpoint/base/time.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include <optional>

namespace trigpoint::lio_mapper {

/// Says when a scan is worth keeping: far enough, turned enough or late enough after the last one.
class KeyframeTrigger {
 public:
  explicit KeyframeTrigger(const KeyframeConfig& config) : config_(config) {}

  bool fires(Nanoseconds stamp_ns, const Pose& T_odom_base) {
    const bool due = !last_ || to_seconds(stamp_ns - stamp_ns_) >= config_.interval_s ||
                     (T_odom_base.p - last_->p).norm() >= config_.distance_m ||
                     T_odom_base.q.angularDistance(last_->q) >= config_.rotation_rad;
    if (due) {
      last_ = T_odom_base;
      stamp_ns_ = stamp_ns;
    }
    return due;
  }

 private:
  KeyframeConfig config_;
  std::optional<Pose> last_;
  Nanoseconds stamp_ns_{0};
};

}  // namespace trigpoint::lio_mapper
