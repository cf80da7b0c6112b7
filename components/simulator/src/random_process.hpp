// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Random functions of time that can be asked at any moment, in any order, without a state: the same
// seed is the same function. Both are built by bisection: a node in the middle of two known ones
// has the distribution of a bridge between them, so the values at all nodes have exactly the joint
// distribution of the process.
// References: [1] P. Levy, "Processus stochastiques et mouvement brownien", 1948 (Brownian motion
// by midpoints). [2] C. Rasmussen, C. Williams, "Gaussian processes for machine learning", 2006,
// eq. A.6 (conditioning) and sec. B.2 (the process with covariance e^(-|d| / tau)).
#pragma once

#include <cstdint>

namespace trigpoint::simulator {

/// Stationary first-order Gauss-Markov process of variance 1: covariance e^(-|d| / tau).
double gauss_markov_at(double t_s, double tau_s, std::uint64_t seed);

/// Brownian motion from 0 at t = 0: variance t (s).
double random_walk_at(double t_s, std::uint64_t seed);

}  // namespace trigpoint::simulator
