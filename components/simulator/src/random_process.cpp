// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "random_process.hpp"

#include "random.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::simulator {

namespace {

constexpr double kGrid_s = 1.0 / 64.0;  ///< linear in between
constexpr std::uint64_t kNodes = std::uint64_t{1} << 23U;
constexpr double kSpan_s = static_cast<double>(kNodes) * kGrid_s;  ///< a day and a half

double normal_of(std::uint64_t seed, std::uint64_t node) {
  return Random(derive_seed(seed, node)).normal();
}

/// From both ends of the span down to the two nodes about `t_s`. `middle(a, b, h, n)` is the value
/// between a and b, h seconds from both, for a standard normal n.
template <typename Middle>
double bisect(double t_s, double first, double last, std::uint64_t seed, const Middle& middle) {
  const double place = std::clamp(t_s, 0.0, kSpan_s - kGrid_s) / kGrid_s;
  const auto before = static_cast<std::uint64_t>(place);
  std::uint64_t left = 0;
  std::uint64_t right = kNodes;
  while (right - left > 1) {
    const std::uint64_t node = left + (right - left) / 2;
    const double half_s = static_cast<double>(node - left) * kGrid_s;
    const double value = middle(first, last, half_s, normal_of(seed, node));
    if (before < node) {
      right = node;
      last = value;
    } else {
      left = node;
      first = value;
    }
  }
  return first + (place - static_cast<double>(left)) * (last - first);
}

}  // namespace

double gauss_markov_at(double t_s, double tau_s, std::uint64_t seed) {
  const double first = normal_of(seed, 0);
  const double keep = std::exp(-kSpan_s / tau_s);
  const double last = keep * first + std::sqrt(1.0 - keep * keep) * normal_of(seed, kNodes);
  // [2] A.6 with covariances r = e^(-h / tau) to both ends and r^2 between them:
  // mean r / (1 + r^2) (a + b), variance (1 - r^2) / (1 + r^2).
  return bisect(t_s, first, last, seed, [tau_s](double a, double b, double h_s, double n) {
    const double r = std::exp(-h_s / tau_s);
    const double scale = 1.0 / (1.0 + r * r);
    return r * scale * (a + b) + std::sqrt((1.0 - r * r) * scale) * n;
  });
}

double random_walk_at(double t_s, std::uint64_t seed) {
  const double last = std::sqrt(kSpan_s) * normal_of(seed, kNodes);
  return bisect(t_s, 0.0, last, seed, [](double a, double b, double h_s, double n) {
    return 0.5 * (a + b) + std::sqrt(0.5 * h_s) * n;  // [1]
  });
}

}  // namespace trigpoint::simulator
