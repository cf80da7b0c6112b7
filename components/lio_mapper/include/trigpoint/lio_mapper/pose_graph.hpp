// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The past, corrected: a pose graph over keyframes. Library trigpoint::pose_graph, apart from the
// mapper so that only who corrects the past links Ceres.
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/pose.hpp"
#include "trigpoint/lio_mapper/checkpoint.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// A keyframe without its cloud.
struct GraphKeyframe {
  Nanoseconds stamp_ns{0};
  std::uint32_t odom_epoch{0};
  Pose T_odom_base;
  bool aligned{false};
  YawPose T_map_odom;  ///< at that time; its tilt counts also when not aligned
};

struct Keyframe;

/// All but its points.
GraphKeyframe graph_keyframe_of(const Keyframe& keyframe);

struct OdomSample {
  Nanoseconds stamp_ns{0};
  std::uint32_t odom_epoch{0};
  Pose T_odom_base;
};

/// A snapshot of one session, or of several one after the other (merge_sessions).
struct GraphInput {
  std::vector<GraphKeyframe> keyframes;  ///< in order of time within an epoch, epochs together
  std::vector<OdomSample> trajectory;    ///< of every sweep, in the same order
  std::vector<StoredRow> rows;           ///< refused ones are not used
  /// Of an epoch without an aligned keyframe.
  std::optional<Alignment> fallback;
  /// Wider than what a filter is told: in places where scans hold little, more drifts, and a loop
  /// that contradicts an edge must be able to win.
  DriftConfig drift{0.02, 3.5e-4, 1e-4, 0.0};
};

/// Where the keyframes are before anything is solved.
struct OnlinePlaces {
  std::string frame{"map"};
  std::vector<std::optional<Pose>> T_map_base;
  std::vector<Eigen::Quaterniond> q_level_base;  ///< roll and pitch by the best known gravity
};

/// Each by its own T_map_odom, those before the alignment by the first of their epoch or by the
/// fallback, all levelled by what was learnt of the tilt farther on. Epochs without any alignment
/// are left out, unless none has one: then the largest stays in odom.
OnlinePlaces place_online(const GraphInput& input);

/// The cloud of keyframe `index` of the input, in base. May throw; that goes through.
using CloudOfKeyframe = std::function<PointCloud(std::size_t index)>;

struct Loop;

struct PoseGraphOptions {
  // Loop closures.
  bool loops{true};
  /// Registered before, among the same keyframes: taken as found. Keyframes before `search_from`
  /// look for no other.
  std::vector<Loop> known_loops;
  std::size_t search_from{0};
  double loop_every_m{4.0};      ///< driven, between keyframes that look for one
  double loop_radius_m{10.0};    ///< in xy, of the present estimate
  double loop_height_m{4.0};     ///< beyond it lies another storey of a car park
  double loop_apart_m{60.0};     ///< driven between its ends
  double loop_half_map_m{12.0};  ///< driven to either side of the place that is matched against
  double min_overlap{0.4};       ///< of the scan's points, those that meet a plane there
  double min_fit{0.75};          ///< of these, those within 10 cm of it
  double max_shift_m{3.0};       ///< from the present estimate
  double max_turn_rad{0.15};
  std::int64_t rounds{2};  ///< of search and solution; what is found is a better estimate's
  // Robust widths, in sigmas (Cauchy).
  double row_width{3.0};
  double loop_width{2.0};
  double loop_max_sigmas{6.0};  ///< a loop that disagrees more with the rest is refused
};

/// Registered places of two keyframes.
struct Loop {
  std::size_t earlier{0};  ///< keyframe
  std::size_t later{0};
  Pose T_earlier_later;
  /// x y z in axes of the earlier one, rotation about axes of the later one.
  Eigen::Matrix<double, 6, 6> covariance{Eigen::Matrix<double, 6, 6>::Identity()};
  double overlap{0.0};
  double fit{0.0};
  double sigmas{kNaN};  ///< disagreement with the solution, of 6 degrees of freedom
};

struct PoseGraphReport {
  std::size_t keyframes{0};
  std::size_t keyframes_left_out{0};  ///< of epochs that nothing ties to the others
  std::size_t rows{0};                ///< that took part
  std::size_t rows_doubted{0};        ///< of them, beyond the robust width
  std::size_t loops{0};
  std::vector<NamedCount> loops_refused;  ///< by reason
  int iterations{0};                      ///< of all solutions
  double initial_cost{kNaN};
  double final_cost{kNaN};
  double largest_correction_m{0.0};  ///< of a keyframe against where it was placed online
  bool converged{false};
};

struct CorrectedPast {
  std::string frame{"map"};                     ///< "odom" when nothing was ever aligned
  std::vector<std::optional<Pose>> T_map_base;  ///< of every keyframe; nothing: left out
  std::vector<Loop> loops;                      ///< that took part
  std::vector<Loop> registered;                 ///< all that were found, also earlier
  PoseGraphReport report;
};

/// Solves for the keyframes' poses from relative poses of the LIO, directions of gravity, GPS rows
/// and loop closures (README, "The past"). Deterministic, single-threaded, reads nothing but its
/// arguments: may run beside the mapper on a snapshot. `progress` gets 0 to 1 and may be empty.
CorrectedPast correct_past(const GraphInput& input,
                           const CloudOfKeyframe& cloud_of,
                           const PoseGraphOptions& options = {},
                           const std::function<void(double)>& progress = {});

struct MapSample {
  Nanoseconds stamp_ns{0};
  Pose T_map_base;
  std::size_t sweep{0};  ///< its place in GraphInput::trajectory
};

/// The trajectory of every sweep, carried over: between two keyframes the pose that each of them
/// gives is weighted by nearness in time. Sweeps of epochs that were left out are missing.
std::vector<MapSample> corrected_trajectory(const GraphInput& input, const CorrectedPast& past);

/// Appends `second`, with its epochs renumbered and what lies in its map (rows, alignments) moved
/// by T_map_second, the place of its map in that of `into`. Loops then tie the two.
void merge_sessions(GraphInput& into, GraphInput second, const Pose& T_map_second);

}  // namespace trigpoint::lio_mapper
