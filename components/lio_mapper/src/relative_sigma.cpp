// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "relative_sigma.hpp"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

/// Ties the whole to the ground, so that there is a solution without a row: 1 km.
constexpr double kAnywhere = 1e-6;

}  // namespace

struct RelativeSigma::Impl {
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> network;
  Eigen::Index size{0};
  Eigen::Index reference{0};
};

RelativeSigma::RelativeSigma(const Graph& graph,
                             const std::vector<Pose>& nodes,
                             std::size_t reference)
    : impl_(std::make_unique<Impl>()) {
  std::vector<Eigen::Triplet<double>> entries;
  const auto ground = [&](std::size_t node, double information) {
    const auto i = static_cast<int>(node);
    entries.emplace_back(i, i, information);
  };
  const auto join = [&](const RelativeFactor& factor) {
    const double information = 2.0 / (factor.covariance(0, 0) + factor.covariance(1, 1));
    ground(factor.from, information);
    ground(factor.to, information);
    entries.emplace_back(static_cast<int>(factor.from), static_cast<int>(factor.to), -information);
    entries.emplace_back(static_cast<int>(factor.to), static_cast<int>(factor.from), -information);
  };
  for (std::size_t node = 0; node < nodes.size(); ++node) {
    ground(node, kAnywhere);
  }
  std::for_each(graph.edges.begin(), graph.edges.end(), join);
  std::for_each(graph.loops.begin(), graph.loops.end(), join);
  for (const PositionFactor& factor : graph.positions) {
    const Eigen::Matrix3d information =
        factor.sqrt_information.transpose() * factor.sqrt_information;
    if (sigmas_of(factor, nodes) <= graph.position_width) {
      ground(factor.node, std::min(information(0, 0), information(1, 1)));
    }
  }
  impl_->size = static_cast<Eigen::Index>(nodes.size());
  impl_->reference = static_cast<Eigen::Index>(reference);
  Eigen::SparseMatrix<double> matrix(impl_->size, impl_->size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  impl_->network.compute(matrix);
}

RelativeSigma::~RelativeSigma() = default;

double RelativeSigma::of(std::size_t node) const {
  Eigen::VectorXd between = Eigen::VectorXd::Zero(impl_->size);
  between[static_cast<Eigen::Index>(node)] += 1.0;
  between[impl_->reference] -= 1.0;
  return std::sqrt(between.dot(impl_->network.solve(between)));
}

}  // namespace trigpoint::lio_mapper
