// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "alignment/alignment_window.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::fusion_gate {

namespace {

constexpr double kContradiction_sigmas = 3.0;
/// Share of the variance of LIO's place that new map inherits, as in the mapper's drift.
constexpr double kInherited_per_m = 0.02;

}  // namespace

bool AlignmentWindow::add(const AlignmentPair& pair) {
  if (is_redundant(pair)) {
    return false;
  }
  pairs_.push_back(pair);
  pairs_.back().slide = {lio_m2_};
  bound();
  solve();
  return true;
}

void AlignmentWindow::on_lio(const Eigen::Vector3d& variance_odom_m2, double moved_m) {
  lio_m2_ = variance_odom_m2;
  for (AlignmentPair& pair : pairs_) {
    Slide& slide = pair.slide;
    slide.changed_m2 = slide.changed_m2.cwiseMax((variance_odom_m2 - slide.then_m2).cwiseAbs());
    slide.inherited_m2 += kInherited_per_m * moved_m * variance_odom_m2;
  }
}

void AlignmentWindow::clear() {
  *this = AlignmentWindow(config_, scale_sigma_);
}

bool AlignmentWindow::is_redundant(const AlignmentPair& pair) const {
  if (pairs_.empty()) {
    return false;
  }
  const AlignmentPair& last = pairs_.back();
  const double age_s = to_seconds(pair.stamp_ns - last.stamp_ns);
  const double step_m = (pair.p_odom_m - last.p_odom_m).norm();
  return age_s <= 0.0 || (step_m < spacing_factor_ * config_.pair_spacing_m &&
                          age_s < spacing_factor_ * config_.pair_spacing_s);
}

void AlignmentWindow::bound() {
  const double oldest_m = pairs_.back().distance_m - config_.window_m;
  std::erase_if(pairs_, [&](const AlignmentPair& pair) { return pair.distance_m < oldest_m; });
  if (pairs_.size() <= static_cast<std::size_t>(config_.max_pairs)) {
    return;
  }
  std::vector<AlignmentPair> kept;
  for (std::size_t k = (pairs_.size() - 1) % 2; k < pairs_.size(); k += 2) {  // keeps the newest
    kept.push_back(pairs_[k]);
  }
  pairs_ = std::move(kept);
  spacing_factor_ *= 2.0;
}

/// A wrong heading must not hold the alignment up: 3 sigma of both apart it is left out.
std::optional<AlignmentSolution> AlignmentWindow::solve(
    const std::vector<AlignmentPair>& pairs) const {
  auto alone = solve_alignment(pairs, config_, scale_sigma_);
  if (!heading_ || !alone) {
    return alone;
  }
  const double apart_rad = wrap_angle(heading_->yaw_rad - alone->T_map_odom.yaw_rad);
  const double sigma_rad = std::hypot(alone->yaw_sigma_rad(), heading_->sigma_rad);
  alone->contradicts_heading = std::abs(apart_rad) > kContradiction_sigmas * sigma_rad;
  return alone->contradicts_heading ? alone
                                    : solve_alignment(pairs, config_, scale_sigma_, heading_);
}

void AlignmentWindow::solve() {
  solution_ = solve(pairs_);
  obstacle_ = solution_ ? find_obstacle(*solution_, config_)
                        : std::optional<std::string>("no finite solution");
  // A wrong stretch at the start must not block the alignment for as long as it is in the window.
  std::size_t skipped = pairs_.size() / 2;
  while (obstacle_ && pairs_.size() - skipped >= static_cast<std::size_t>(config_.min_pairs)) {
    const std::vector<AlignmentPair> newest(pairs_.begin() + static_cast<std::ptrdiff_t>(skipped),
                                            pairs_.end());
    const auto candidate = solve(newest);
    if (candidate && !find_obstacle(*candidate, config_)) {
      solution_ = candidate;
      obstacle_.reset();
    }
    skipped += (pairs_.size() - skipped + 1) / 2;
  }
}

}  // namespace trigpoint::fusion_gate
