// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "random.hpp"

#include <cstdint>

namespace trigpoint::simulator {

/// One of the stretches of time that follow each other from 0 on.
struct Stretch {
  Random random;   ///< the stretch's own numbers, from their beginning: its length comes first
  double since_s;  ///< from the stretch's start
};

/// The stretch that holds `t_s`; `length_s` draws the length (> 0) of one from its numbers, and
/// what follows in `random` are the next ones.
template <typename Length>
Stretch stretch_at(double t_s, std::uint64_t seed, const Length& length_s) {
  for (std::uint64_t i = 0;; ++i) {
    Random random(derive_seed(seed, i));
    const double length = length_s(random);
    if (t_s < length) {
      return {random, t_s};
    }
    t_s -= length;
  }
}

}  // namespace trigpoint::simulator
