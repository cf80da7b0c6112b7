// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "control/trust.hpp"

#include "trigpoint/base/sentence.hpp"

#include "checks/displacement.hpp"

#include <algorithm>

namespace trigpoint::fusion_gate {

namespace {

constexpr double kShortestStretch_s = 1.0;
constexpr std::size_t kStretchKept = 400;  // 80 s at 5 Hz

}  // namespace

Trust::Change Trust::judge(const Sighting& sighting, const Tests& tests, const LioStatus& lio) {
  if (trusted()) {
    if (!tests.contradiction) {
      return Change::kNone;
    }
    doubt_ = sighting.stamp_ns;
    reason_ = *tests.contradiction;
    begin_stretch();
    stretch_ = {sighting};
    began_ = true;
    return Change::kDoubted;
  }
  prolong_stretch(sighting, lio);
  if (tests.contradiction) {
    reason_ = *tests.contradiction;
    return Change::kNone;
  }
  if (tests.enters && may_be_readmitted(sighting)) {
    begin_anew();
    return Change::kReadmitted;
  }
  reason_ = {"in_doubt",
             tests.enters ? sentence("in doubt for %.1f s; fixes agree again for %.1f s",
                                     to_seconds(stretch_.front().stamp_ns - *doubt_),
                                     to_seconds(sighting.stamp_ns - stretch_.front().stamp_ns))
                          : tests.lack};
  return Change::kNone;
}

void Trust::begin_earlier(const Sighting& first) {
  doubt_ = first.stamp_ns;
  add_agreement(first, stretch_.front());
  stretch_.insert(stretch_.begin(), first);
}

void Trust::begin_anew() {
  doubt_.reset();
  reason_ = {};
  begin_stretch();
}

void Trust::begin_stretch() {
  stretch_.clear();
  agreed_s_ = 0.0;
  agreed_m_ = 0.0;
}

void Trust::add_agreement(const Sighting& from, const Sighting& to) {
  const double gap_s = to_seconds(to.stamp_ns - from.stamp_ns);
  if (gap_s > 0.0 && gap_s <= kUnbrokenGap_s) {
    agreed_s_ += gap_s;
    agreed_m_ += to.distance_m - from.distance_m;
  }
}

void Trust::prolong_stretch(const Sighting& sighting, const LioStatus& lio) {
  const auto agrees_with = [&](const Sighting& other) {
    return sigmas_of(compare_displacement(other, sighting, lio, config_), part_) <=
           config_.smooth.enter_sigmas;
  };
  if (stretch_.empty() || !agrees_with(stretch_.front()) || !agrees_with(stretch_.back())) {
    begin_stretch();
  }
  began_ = stretch_.empty();
  if (!began_) {
    add_agreement(stretch_.back(), sighting);
  }
  stretch_.push_back(sighting);
  if (stretch_.size() > kStretchKept) {
    stretch_.erase(stretch_.begin() + 1);
  }
}

bool Trust::may_be_readmitted(const Sighting& sighting) const {
  const double in_doubt_s = to_seconds(stretch_.front().stamp_ns - *doubt_);
  const double agreed_s = to_seconds(sighting.stamp_ns - stretch_.front().stamp_ns);
  return stretch_.size() >= static_cast<std::size_t>(config_.smooth.readmit_fixes) &&
         agreed_s >= std::clamp(in_doubt_s, kShortestStretch_s, config_.smooth.readmit_s);
}

}  // namespace trigpoint::fusion_gate
