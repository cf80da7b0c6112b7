// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The least-squares problem behind the pose graph, without a type of the solver's.
#pragma once

#include "trigpoint/base/pose.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <vector>

namespace trigpoint::lio_mapper {

/// T_from_to of two nodes; covariance: x y z in axes of `from`, rotation about axes of `to`.
struct RelativeFactor {
  std::size_t from{0};
  std::size_t to{0};
  Pose T_from_to;
  Eigen::Matrix<double, 6, 6> covariance{Eigen::Matrix<double, 6, 6>::Identity()};
};

/// The direction of up that a node saw.
struct UpFactor {
  std::size_t node{0};
  Eigen::Vector3d up_base{Eigen::Vector3d::UnitZ()};
  double sigma_rad{1.0};
};

/// Position of a point that is fixed to a node, as far as `sqrt_information` tells: rows of zero
/// for axes that were not measured.
struct PositionFactor {
  std::size_t node{0};
  Eigen::Vector3d point_base_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d position_map_m{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d sqrt_information{Eigen::Matrix3d::Zero()};
};

/// A node's pose; covariance as of RelativeFactor from the map's origin.
struct PriorFactor {
  std::size_t node{0};
  Pose T_map_base;
  Eigen::Matrix<double, 6, 6> covariance{Eigen::Matrix<double, 6, 6>::Identity()};
};

struct Graph {
  std::vector<RelativeFactor> edges;
  std::vector<RelativeFactor> loops;  ///< with a robust loss
  std::vector<UpFactor> ups;
  std::vector<PositionFactor> positions;  ///< with a robust loss
  std::vector<PriorFactor> priors;
  double position_width{3.0};  ///< sigmas at which Cauchy's loss bends
  double loop_width{2.0};
};

struct SolverSummary {
  int iterations{0};
  double initial_cost{0.0};
  double final_cost{0.0};
  bool converged{false};
};

/// Moves `nodes` (T_map_base) to the least cost. Nodes that no factor touches stay.
SolverSummary solve(const Graph& graph, std::vector<Pose>& nodes);

/// Length of the whitened residual.
double sigmas_of(const RelativeFactor& factor, const std::vector<Pose>& nodes);
double sigmas_of(const PositionFactor& factor, const std::vector<Pose>& nodes);

/// Whitening of a residual with this covariance: W^T W = covariance^-1.
Eigen::Matrix<double, 6, 6> whitening(const Eigen::Matrix<double, 6, 6>& covariance);

}  // namespace trigpoint::lio_mapper
