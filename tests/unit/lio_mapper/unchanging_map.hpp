// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "local_map.hpp"

namespace trigpoint::lio_mapper {

/// A map for tests of who matches with it: it is never empty, and nothing that is done to it
/// changes what it answers.
class UnchangingMap : public LocalMap {
 public:
  void insert(const PointCloud& /*points_odom*/) override {}

  void prune(const Eigen::Vector3d& /*center_odom_m*/, double /*half_side_m*/) override {}

  void transform(const Pose& /*T_new_old*/) override {}

  void rebuild(const PointCloud& /*points_odom*/) override {}

  PointCloud points() const override { return {}; }

  std::size_t size() const override { return 1; }

  std::size_t memory_bytes() const override { return 0; }
};

}  // namespace trigpoint::lio_mapper
