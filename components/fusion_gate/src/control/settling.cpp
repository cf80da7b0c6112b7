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
  count_ = 0;
  sum_map_m_.setZero();
}

std::optional<Eigen::Vector3d> Settling::add(Nanoseconds stamp_ns, const Difference& off_by) {
  if (!is_open_) {
    return std::nullopt;
  }
  first_ns_ = count_ == 0 ? stamp_ns : first_ns_;
  ++count_;
  sum_map_m_ += off_by.d_map_m;
  if (count_ < config_.smooth.readmit_fixes || to_seconds(stamp_ns - first_ns_) < kShortest_s) {
    return std::nullopt;
  }
  end();
  const Difference mean{sum_map_m_ / static_cast<double>(count_), off_by.covariance_m2};
  const bool contradicts = sigmas_of(mean, Part::kLevel) > config_.smooth.enter_sigmas;
  return contradicts ? std::optional(mean.d_map_m) : std::nullopt;
}

}  // namespace trigpoint::fusion_gate
