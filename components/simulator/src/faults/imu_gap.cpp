// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/imu_gap.hpp"

#include "stretches.hpp"

#include <algorithm>

namespace trigpoint::simulator {

namespace {

constexpr double kShortestGood_s = 0.01;  ///< so that stretches have a length

}  // namespace

void ImuGap::describe(ConfigFields& fields) {
  fields.number("share", share_, "of the samples lost", {0.0, 1.0});
  fields.number("every_s",
                every_s_,
                "mean time between gaps, half to one and a half of it; 0 = one gap all the time",
                {0.0, 1e5});
  fields.number("shortest_s", shortest_s_, "of these gaps", {0.0, 1e3});
  fields.number("longest_s", longest_s_, "of these gaps", {0.0, 1e3});
}

bool ImuGap::is_between_gaps(const FaultMoment& moment) const {
  if (every_s_ <= 0.0) {
    return false;
  }
  double good_s = 0.0;
  const Stretch stretch = stretch_at(moment.since_start_s, moment.seed, [&](Random& random) {
    good_s = std::max(kShortestGood_s, random.uniform(0.5, 1.5) * every_s_);
    return good_s + random.uniform(shortest_s_, longest_s_);
  });
  return stretch.since_s < good_s;
}

void ImuGap::on_imu(ImuEpoch& epoch, const FaultMoment& moment) const {
  epoch.lost = epoch.lost || (!is_between_gaps(moment) && moment.each.chance(share_));
}

}  // namespace trigpoint::simulator
