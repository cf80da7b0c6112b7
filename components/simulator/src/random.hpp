// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Random numbers that are the same on every platform and for any order of evaluation: the standard
// library leaves its distributions to the implementation.
// References: [1] G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number generators",
// OOPSLA 2014 (splitmix64). [2] G. Box, M. Muller, Ann. Math. Statist. 29 (1958) 610-611.
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <cstdint>
#include <numbers>

namespace trigpoint::simulator {

/// The finaliser of [1]: neighbouring inputs give unrelated outputs.
constexpr std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

/// A seed for one purpose out of the run's seed, so that purposes do not share numbers.
constexpr std::uint64_t derive_seed(std::uint64_t seed, std::uint64_t purpose) {
  return mix(mix(seed) ^ (purpose * 0xd1342543de82ef95ULL));
}

class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(mix(seed)) {}

  std::uint64_t bits() {
    state_ += 0x9e3779b97f4a7c15ULL;
    return mix(state_);
  }

  /// In [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11U) * 0x1p-53; }

  double uniform(double lowest, double highest) { return lowest + (highest - lowest) * uniform(); }

  /// Standard normal, [2].
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }

  Eigen::Vector3d normal3() {
    const double x = normal();
    const double y = normal();
    return {x, y, normal()};
  }

  /// Unit vector in any direction of the plane east-north.
  Eigen::Vector3d level_direction() {
    const double direction = uniform(0.0, 2.0 * std::numbers::pi);
    return {std::cos(direction), std::sin(direction), 0.0};
  }

  /// A vector in any direction of that plane, `lowest` to `highest` long.
  Eigen::Vector3d level_vector(double lowest, double highest) {
    const double size = uniform(lowest, highest);
    return size * level_direction();
  }

  bool chance(double probability) { return uniform() < probability; }

 private:
  std::uint64_t state_;
};

/// What the seeds are derived for.
enum Purpose : std::uint64_t {
  kWorldSeed = 1,
  kMotionSeed,
  kImuSeed,
  kGnssSeed,
  kLidarSeed,
  kFaultSeed,
  kTrafficSeed,
  kDaySeed
};

}  // namespace trigpoint::simulator
