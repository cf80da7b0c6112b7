// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "relief.hpp"

#include "random.hpp"

#include <cmath>
#include <numbers>

namespace trigpoint::simulator {

Relief::Relief(const WorldConfig& config, std::uint64_t seed) {
  Random random(derive_seed(seed, kWorldSeed));
  double wavelength_m = config.relief_wavelength_m;
  double amplitude_m = config.relief_amplitude_m;
  double direction_rad = random.uniform(0.0, 2.0 * std::numbers::pi);
  for (Wave& wave : waves_) {
    const double k = 2.0 * std::numbers::pi / wavelength_m;
    wave = {k * Eigen::Vector2d(std::cos(direction_rad), std::sin(direction_rad)),
            random.uniform(0.0, 2.0 * std::numbers::pi),
            amplitude_m};
    steepest_ += k * amplitude_m;
    highest_m_ += amplitude_m;
    // Shorter waves are lower, so that no wave is steeper than the first; the golden angle spreads
    // the directions.
    wavelength_m *= 0.6;
    amplitude_m *= 0.45;
    direction_rad += 2.4;
  }
  offset_m_ = -height_m(0.0, 0.0);
  highest_m_ += std::abs(offset_m_);
}

double Relief::height_m(double east_m, double north_m) const {
  double height = offset_m_;
  for (const Wave& wave : waves_) {
    height += wave.amplitude_m *
              std::sin(wave.k_radpm.x() * east_m + wave.k_radpm.y() * north_m + wave.phase_rad);
  }
  return height;
}

Eigen::Vector2d Relief::slope(double east_m, double north_m) const {
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  for (const Wave& wave : waves_) {
    const double phase = wave.k_radpm.x() * east_m + wave.k_radpm.y() * north_m + wave.phase_rad;
    slope += wave.amplitude_m * std::cos(phase) * wave.k_radpm;
  }
  return slope;
}

}  // namespace trigpoint::simulator
