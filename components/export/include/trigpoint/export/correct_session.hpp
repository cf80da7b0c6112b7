// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The pose graph over a session folder: reads what the run left, writes what it corrects.
#pragma once

#include "trigpoint/export/session.hpp"
#include "trigpoint/lio_mapper/pose_graph.hpp"

#include <Eigen/Core>

#include <functional>
#include <map>
#include <optional>
#include <string>

namespace trigpoint::exporter {

/// Where keyframes belong, by stamp.
struct CorrectedPoses {
  std::string frame{"map"};
  std::map<Nanoseconds, Pose> T_frame_base;
};

/// What of a session's config.yaml the past depends on; defaults where it does not say.
struct PastSettings {
  lio_mapper::DriftConfig drift{lio_mapper::GraphInput{}.drift};
  Eigen::Vector3d lidar_position_base_m{Eigen::Vector3d::Zero()};
};

/// Throws std::runtime_error naming file, line, key and rule when a value is not what it must be.
PastSettings past_settings_of(const std::string& session);

/// What an alignment.yaml that cannot be read is (a power failure leaves empty files).
enum class DamagedAlignment {
  kIsError,
  kIsNone  ///< as if it were not there: for who must start all the same
};

/// Keyframes, rows, lio.tum and the alignment of a session. Throws std::runtime_error naming the
/// file and the cause.
lio_mapper::GraphInput graph_input_of(const std::string& session,
                                      DamagedAlignment damaged = DamagedAlignment::kIsError);

/// Solves, and writes keyframes.tum and, when there is a map frame, fused_smoothed.tum; those of an
/// earlier solution are removed first. Throws std::runtime_error naming the file and the cause.
lio_mapper::PoseGraphReport correct_session(const std::string& session,
                                            const std::function<void(double)>& progress = {});

/// What correct_session left in keyframes.tum; nothing without the file.
std::optional<CorrectedPoses> read_corrected(const std::string& session);

struct MergeReport {
  lio_mapper::PoseGraphReport graph;
  std::size_t loops_between{0};  ///< of them, from one session to the other
};

/// Two independent sessions in one graph, each with its own GPS rows, in the map of the first (its
/// datum). Writes map.pcd, datum.yaml, first.tum and second.tum (every sweep) into `out`, all of
/// them or, when it throws or `progress` does, none. Throws std::runtime_error naming the file and
/// the cause, e.g. a session without a datum.
MergeReport merge_sessions(const std::string& first,
                           const std::string& second,
                           const std::string& out,
                           double voxel_m,
                           const std::function<void(double)>& progress = {});

}  // namespace trigpoint::exporter
