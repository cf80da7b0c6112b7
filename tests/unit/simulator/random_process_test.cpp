// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "random_process.hpp"

#include "faults.hpp"
#include <gtest/gtest.h>

#include <functional>

namespace trigpoint::simulator {

namespace {

constexpr int kProcessSeeds = 12000;

/// Mean over seeds.
double mean_of(const std::function<double(std::uint64_t)>& value) {
  double sum = 0.0;
  for (std::uint64_t seed = 0; seed < kProcessSeeds; ++seed) {
    sum += value(seed);
  }
  return sum / kProcessSeeds;
}

}  // namespace

TEST(GaussMarkovAt, has_variance_1_and_the_exponential_covariance_at_every_lag) {
  constexpr double kTau_s = 30.0;
  for (const double t_s : {0.0, 3.0, 511.9, 40000.0}) {
    for (const double lag_s : {0.0, 0.203, 10.0, 60.0}) {
      const double covariance = mean_of([&](std::uint64_t seed) {
        return gauss_markov_at(t_s, kTau_s, seed) * gauss_markov_at(t_s + lag_s, kTau_s, seed);
      });
      // A product of two normals of correlation r scatters with variance 1 + r^2, at most 2.
      EXPECT_NEAR(covariance, std::exp(-lag_s / kTau_s), variance_tolerance(kProcessSeeds))
          << t_s << " s, lag " << lag_s << " s";
    }
  }
}

TEST(GaussMarkovAt, changes_by_the_same_at_every_place_of_its_grid) {
  // Increments over 1 s: variance 2 (1 - e^(-1 / tau)), also across the node in the middle.
  constexpr double kTau_s = 30.0;
  const double expected = 2.0 * (1.0 - std::exp(-1.0 / kTau_s));
  for (const double t_s : {65535.5, 32767.25, 100.0, 1023.5}) {
    const double measured = mean_of([&](std::uint64_t seed) {
      return std::pow(gauss_markov_at(t_s + 1.0, kTau_s, seed) - gauss_markov_at(t_s, kTau_s, seed),
                      2);
    });
    EXPECT_NEAR(measured / expected, 1.0, variance_tolerance(kProcessSeeds)) << t_s;
  }
}

TEST(RandomWalkAt, starts_at_zero_and_has_independent_increments_of_variance_t) {
  EXPECT_EQ(random_walk_at(0.0, 3), 0.0);
  for (const double t_s : {1.0, 400.0, 20000.0}) {
    const double variance =
        mean_of([&](std::uint64_t seed) { return std::pow(random_walk_at(t_s, seed), 2); });
    EXPECT_NEAR(variance / t_s, 1.0, variance_tolerance(kProcessSeeds)) << t_s;
    const double product = mean_of([&](std::uint64_t seed) {
      const double at_t = random_walk_at(t_s, seed);
      return at_t * (random_walk_at(2.0 * t_s, seed) - at_t);
    });
    EXPECT_NEAR(product / t_s, 0.0, 5.0 / std::sqrt(kProcessSeeds)) << t_s;
  }
}

TEST(RandomProcesses, give_the_same_value_whenever_asked_and_another_for_another_seed) {
  const double value = gauss_markov_at(77.7, 20.0, 5);
  static_cast<void>(gauss_markov_at(1.0, 20.0, 5));
  EXPECT_EQ(gauss_markov_at(77.7, 20.0, 5), value);
  EXPECT_NE(gauss_markov_at(77.7, 20.0, 6), value);
  EXPECT_NE(random_walk_at(77.7, 6), random_walk_at(77.7, 5));
}

}  // namespace trigpoint::simulator
