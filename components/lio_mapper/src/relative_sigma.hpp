// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/pose.hpp"

#include "pose_graph_solver.hpp"

#include <cstddef>
#include <memory>
#include <vector>

namespace trigpoint::lio_mapper {

/// How well a pose graph knows the horizontal position of its nodes relative to one of them, m.
/// Of positions alone, as if headings were known: the variance is then the resistance between two
/// nodes of a network whose conductances are the factors' informations (P. Barooah, J. Hespanha,
/// "Estimation on graphs from relative measurements", IEEE Control Systems 2007).
class RelativeSigma {
 public:
  /// Rows that the solution `nodes` contradicts do not count.
  RelativeSigma(const Graph& graph, const std::vector<Pose>& nodes, std::size_t reference);
  ~RelativeSigma();

  double of(std::size_t node) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::lio_mapper
