// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// From a session's snapshot to the factors of its pose graph.
#pragma once

#include "trigpoint/lio_mapper/pose_graph.hpp"

#include "pose_graph_solver.hpp"

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// What of the input belongs to one odom epoch: half-open ranges of indices.
struct EpochRange {
  std::uint32_t odom_epoch{0};
  std::size_t first{0};
  std::size_t last{0};
  std::size_t first_sample{0};
  std::size_t last_sample{0};
};

std::vector<EpochRange> epochs_of(const GraphInput& input);

/// Driven distance (m) at every keyframe; from epoch to epoch it leaps, so that no two of them seem
/// near.
std::vector<double> driven_of(const GraphInput& input);

/// Everything but loops.
Graph factors_of(const GraphInput& input,
                 const OnlinePlaces& places,
                 const PoseGraphOptions& options);

/// The odom pose at a time within the epoch's samples; nothing across gaps.
std::optional<Pose> odom_at(const GraphInput& input, const EpochRange& epoch, Nanoseconds stamp_ns);

}  // namespace trigpoint::lio_mapper
