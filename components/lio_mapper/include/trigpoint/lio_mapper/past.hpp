// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The past, corrected while driving: what a mapper hands out, and what it takes back.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/pose.hpp"
#include "trigpoint/lio_mapper/config.hpp"
#include "trigpoint/lio_mapper/pose_graph.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

class LocalMap;

/// All that a correction needs of a mapper besides clouds; it shares nothing with the mapper.
struct PastSnapshot {
  Nanoseconds stamp_ns{0};  ///< of the newest scan that it knows
  std::string reason;       ///< "gps_returned" or "place_revisited"
  GraphInput input;
  PoseGraphOptions options;
  LocalMapConfig local_map;
};

struct PastReport {
  std::size_t keyframes{0};  ///< in the graph
  std::size_t rows{0};
  std::size_t loops{0};
  /// False: what the local map holds has hardly moved. It was not built anew then.
  bool changed{true};
  std::size_t placed{0};       ///< keyframes that the local map is made of
  std::size_t left_out{0};     ///< moved by what neither GPS nor a loop backs
  double largest_move_m{0.0};  ///< of a placed one, in odom
};

/// A local map made of corrected keyframes.
class CorrectedMap {
 public:
  CorrectedMap(std::unique_ptr<LocalMap> map,
               PastSnapshot snapshot,
               CorrectedPast past,
               const Pose& T_odom_frame);
  ~CorrectedMap();
  CorrectedMap(CorrectedMap&&) noexcept;
  CorrectedMap& operator=(CorrectedMap&&) noexcept;

  /// What the mapper has inserted meanwhile, in order. Also asks for the planes that the next scan
  /// will ask for, so that it does not pay for fitting them.
  void insert(const std::vector<PointCloud>& clouds_odom);

  const LocalMap& map() const { return *map_; }

  PastReport report;

 private:
  friend class LioMapper;

  std::unique_ptr<LocalMap> map_;
  PastSnapshot snapshot_;
  CorrectedPast past_;
  Pose T_odom_frame_;  ///< the graph's frame as it lies at the newest keyframe
};

/// Solves the pose graph of the snapshot (correct_past) and builds the local map around the newest
/// keyframe from those that the mapper's map holds: the newest stretch where odom has it, older
/// visits where they belong. Reads nothing but its arguments; same bits on every run. Nothing when
/// there is nothing to build on. What `cloud_of` and `progress` throw goes through.
std::optional<CorrectedMap> correct_local_map(PastSnapshot snapshot,
                                              const CloudOfKeyframe& cloud_of,
                                              const std::function<void(double)>& progress = {});

}  // namespace trigpoint::lio_mapper
