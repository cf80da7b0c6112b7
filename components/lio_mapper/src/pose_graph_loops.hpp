// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Places that were visited twice: found, registered and checked against each other.
#pragma once

#include "trigpoint/lio_mapper/pose_graph.hpp"

#include "local_map.hpp"
#include "pose_graph_factors.hpp"
#include <Eigen/Core>

#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

namespace trigpoint::lio_mapper {

class LoopSearch {
 public:
  /// All are referred to.
  LoopSearch(const GraphInput& input,
             const CloudOfKeyframe& cloud_of,
             const PoseGraphOptions& options,
             const OnlinePlaces& places);

  /// Looks at every pair of visits that has not been registered yet, near each other in `nodes`.
  void search(const std::vector<Pose>& nodes, const std::function<void(double)>& progress);

  /// Those found so far that agree with at least one other of the same two visits, and not with
  /// fewer than contradict them.
  std::vector<Loop> consistent() const;

  /// All that were registered.
  const std::vector<Loop>& found() const { return loops_; }

  /// By reason, of the pairs looked at and found wanting.
  std::vector<NamedCount> refused() const;

 private:
  struct Pair {
    std::size_t to;
    std::size_t from;
  };

  std::vector<Pair> pairs_near(const std::vector<Pose>& nodes) const;
  std::vector<std::size_t> visits_near(std::size_t from, const std::vector<Pose>& nodes) const;
  std::pair<std::size_t, std::size_t> stretch_about(std::size_t keyframe, double half_m) const;
  const LocalMap& map_about(std::size_t keyframe);
  std::vector<Eigen::Vector3d> scan_of(std::size_t keyframe);
  const char* register_pair(const Pair& pair, const std::vector<Pose>& nodes);
  bool agree(const Loop& a, const Loop& b) const;
  bool same_visits(const Loop& a, const Loop& b) const;

  const GraphInput& input_;
  const CloudOfKeyframe& cloud_of_;
  const PoseGraphOptions& options_;
  const OnlinePlaces& places_;
  std::vector<double> driven_m_;
  std::map<std::size_t, std::unique_ptr<LocalMap>> maps_;  ///< by the keyframe in their middle
  std::vector<std::size_t> maps_by_age_;
  std::set<std::pair<std::size_t, std::size_t>> registered_;
  std::map<std::pair<std::size_t, std::size_t>, const char*> failed_;
  std::vector<Loop> loops_;
};

}  // namespace trigpoint::lio_mapper
