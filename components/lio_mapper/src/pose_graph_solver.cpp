// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// References: [1] G. Grisetti, R. Kuemmerle, C. Stachniss, W. Burgard, "A tutorial on graph-based
// SLAM", IEEE ITS Magazine 2(4), 2010. [2] S. Agarwal, K. Mierle et al., Ceres Solver,
// http://ceres-solver.org (the only file that includes it).
#include "pose_graph_solver.hpp"

#include <ceres/ceres.h>

#include <array>
#include <memory>

namespace trigpoint::lio_mapper {

namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Rotation = Eigen::Map<const Eigen::Quaternion<T>>;
template <typename T>
using Position = Eigen::Map<const Vector3<T>>;

/// Twice the vector part: the rotation vector to second order, smooth at zero, which so3_log in
/// dual numbers is not.
template <typename T>
Vector3<T> small_rotation(const Eigen::Quaternion<T>& q) {
  return (q.w() < T(0) ? T(-2) : T(2)) * q.vec();
}

/// r = W [R_a^T (p_b - p_a) - t; log(R_ab^T R_a^T R_b)], [1] eq. 30 on SO(3) x R^3.
struct RelativeResidual {
  Pose T_from_to;
  Matrix6d W;

  template <typename T>
  bool operator()(const T* q_from, const T* p_from, const T* q_to, const T* p_to, T* out) const {
    const Rotation<T> qa(q_from);
    const Rotation<T> qb(q_to);
    Eigen::Matrix<T, 6, 1> r;
    r.template head<3>() =
        qa.conjugate() * (Position<T>(p_to) - Position<T>(p_from)) - T_from_to.p.cast<T>();
    const Eigen::Quaternion<T> turned = qa.conjugate() * qb;
    const Eigen::Quaternion<T> measured = T_from_to.q.cast<T>();
    r.template tail<3>() = small_rotation<T>(measured.conjugate() * turned);
    Eigen::Map<Eigen::Matrix<T, 6, 1>>{out} = W.cast<T>() * r;
    return true;
  }
};

struct PriorResidual {
  Pose T_map_base;
  Matrix6d W;

  template <typename T>
  bool operator()(const T* q, const T* p, T* out) const {
    const std::array<T, 4> no_turn{T(0), T(0), T(0), T(1)};
    const std::array<T, 3> origin{T(0), T(0), T(0)};
    return RelativeResidual{T_map_base, W}(no_turn.data(), origin.data(), q, p, out);
  }
};

/// Horizontal part of up as this attitude has it: to first order the tilt.
struct UpResidual {
  Eigen::Vector3d up_base;
  double sigma_rad;

  template <typename T>
  bool operator()(const T* q, T* out) const {
    const Vector3<T> up = Rotation<T>(q) * up_base.cast<T>();
    out[0] = up.x() / sigma_rad;
    out[1] = up.y() / sigma_rad;
    return true;
  }
};

struct PositionResidual {
  PositionFactor factor;

  template <typename T>
  bool operator()(const T* q, const T* p, T* out) const {
    const Vector3<T> error = Rotation<T>(q) * factor.point_base_m.cast<T>() + Position<T>(p) -
                             factor.position_map_m.cast<T>();
    Eigen::Map<Vector3<T>>{out} = factor.sqrt_information.cast<T>() * error;
    return true;
  }
};

class Problem {
 public:
  explicit Problem(std::vector<Pose>& nodes) : nodes_(nodes) {}

  void add(const RelativeFactor& f, ceres::LossFunction* loss) {
    using Cost = ceres::AutoDiffCostFunction<RelativeResidual, 6, 4, 3, 4, 3>;
    problem_.AddResidualBlock(new Cost(new RelativeResidual{f.T_from_to, whitening(f.covariance)}),
                              loss,
                              std::vector<double*>{q(f.from), p(f.from), q(f.to), p(f.to)});
    free(f.from);
    free(f.to);
  }

  void add(const PriorFactor& f) {
    using Cost = ceres::AutoDiffCostFunction<PriorResidual, 6, 4, 3>;
    problem_.AddResidualBlock(new Cost(new PriorResidual{f.T_map_base, whitening(f.covariance)}),
                              nullptr,
                              std::vector<double*>{q(f.node), p(f.node)});
    free(f.node);
  }

  void add(const UpFactor& f) {
    using Cost = ceres::AutoDiffCostFunction<UpResidual, 2, 4>;
    problem_.AddResidualBlock(
        new Cost(new UpResidual{f.up_base, f.sigma_rad}), nullptr, std::vector<double*>{q(f.node)});
    free(f.node);
  }

  void add(const PositionFactor& f, ceres::LossFunction* loss) {
    using Cost = ceres::AutoDiffCostFunction<PositionResidual, 3, 4, 3>;
    problem_.AddResidualBlock(
        new Cost(new PositionResidual{f}), loss, std::vector<double*>{q(f.node), p(f.node)});
    free(f.node);
  }

  SolverSummary solve() {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.num_threads = 1;  // sums in one order: the same bits on every run
    options.max_num_iterations = 60;
    options.initial_trust_region_radius = 1e8;  // nearly linear: begin with whole steps
    options.function_tolerance = 1e-9;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    for (Pose& node : nodes_) {
      node.q.normalize();
    }
    return {static_cast<int>(summary.iterations.size()),
            summary.initial_cost,
            summary.final_cost,
            summary.termination_type == ceres::CONVERGENCE};
  }

 private:
  double* q(std::size_t node) { return nodes_[node].q.coeffs().data(); }

  double* p(std::size_t node) { return nodes_[node].p.data(); }

  void free(std::size_t node) {
    if (problem_.HasParameterBlock(q(node)) && problem_.GetManifold(q(node)) == nullptr) {
      problem_.SetManifold(q(node), &manifold_);
    }
  }

  static ceres::Problem::Options keep_ownership() {
    ceres::Problem::Options options;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  std::vector<Pose>& nodes_;
  ceres::EigenQuaternionManifold manifold_;
  ceres::Problem problem_{keep_ownership()};
};

}  // namespace

Matrix6d whitening(const Matrix6d& covariance) {
  const Eigen::LLT<Matrix6d> factor(covariance);
  return factor.matrixL().solve(Matrix6d::Identity());
}

SolverSummary solve(const Graph& graph, std::vector<Pose>& nodes) {
  ceres::CauchyLoss position_loss(graph.position_width);
  ceres::CauchyLoss loop_loss(graph.loop_width);
  Problem problem(nodes);
  for (const RelativeFactor& edge : graph.edges) {
    problem.add(edge, nullptr);
  }
  for (const RelativeFactor& loop : graph.loops) {
    problem.add(loop, &loop_loss);
  }
  for (const UpFactor& up : graph.ups) {
    problem.add(up);
  }
  for (const PositionFactor& position : graph.positions) {
    problem.add(position, &position_loss);
  }
  for (const PriorFactor& prior : graph.priors) {
    problem.add(prior);
  }
  return problem.solve();
}

double sigmas_of(const RelativeFactor& factor, const std::vector<Pose>& nodes) {
  const Pose& from = nodes[factor.from];
  const Pose& to = nodes[factor.to];
  Eigen::Matrix<double, 6, 1> r;
  RelativeResidual{factor.T_from_to, whitening(factor.covariance)}(
      from.q.coeffs().data(), from.p.data(), to.q.coeffs().data(), to.p.data(), r.data());
  return r.norm();
}

double sigmas_of(const PositionFactor& factor, const std::vector<Pose>& nodes) {
  const Pose& node = nodes[factor.node];
  Eigen::Vector3d r;
  PositionResidual{factor}(node.q.coeffs().data(), node.p.data(), r.data());
  return r.norm();
}

}  // namespace trigpoint::lio_mapper
