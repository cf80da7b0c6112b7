// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/so3.hpp"

#include "state.hpp"

#include <random>

namespace trigpoint::lio_mapper::testing_support {

inline ErrorVector random_error(unsigned seed, double sigma) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal(0.0, sigma);
  return ErrorVector::NullaryExpr([&] { return normal(generator); });
}

inline ErrorMatrix random_covariance(unsigned seed, double sigma) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal(0.0, sigma);
  const ErrorMatrix root = ErrorMatrix::NullaryExpr([&] { return normal(generator); });
  return root * root.transpose() / error::kSize + 1e-3 * sigma * sigma * ErrorMatrix::Identity();
}

/// Somewhere, turned anyhow within half a radian of level, moving.
inline State random_state(unsigned seed) {
  State level;
  level.T_odom_base.p = {3.0, -2.0, 1.0};
  level.T_odom_base.q = from_yaw(0.7);
  level.v_odom_mps = {2.0, 1.0, -0.5};
  level.T_map_odom = {0.9, {100.0, -50.0, 3.0}};
  return boxplus(level, random_error(seed, 0.3));
}

}  // namespace trigpoint::lio_mapper::testing_support
