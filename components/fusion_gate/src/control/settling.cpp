// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "control/settling.hpp"

namespace trigpoint::fusion_gate {

namespace {

constexpr double kShortest_s = 1.0;  // as after the shortest doubt

}  // namespace

void Settling::begin() {
  is_open_ = true;
  interrupt();
}

void Settling::interrupt() {
  seen_.clear();
}

std::optional<Eigen::Vector3d> Settling::add(const AcceptedFix& fix,
                                             const Sighting& sighting,
                                             const OffsetNow& offset_now) {
  if (!is_open_) {
    return std::nullopt;
  }
  seen_.push_back({fix, sighting});
  const auto count = static_cast<std::int64_t>(seen_.size());
  if (count < config_.smooth.readmit_fixes ||
      to_seconds(sighting.stamp_ns - seen_.front().sighting.stamp_ns) < kShortest_s) {
    return std::nullopt;
  }
  const Difference newest = offset_now(fix, sighting);
  Difference mean{Eigen::Vector3d::Zero(), newest.covariance_m2};
  for (const Seen& seen : seen_) {
    mean.d_map_m += offset_now(seen.fix, seen.sighting).d_map_m / static_cast<double>(count);
  }
  end();
  const double limit = config_.smooth.enter_sigmas;
  const bool contradicts =
      sigmas_of(newest, Part::kLevel) > limit && sigmas_of(mean, Part::kLevel) > limit;
  return contradicts ? std::optional(mean.d_map_m) : std::nullopt;
}

}  // namespace trigpoint::fusion_gate
