// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "pose_graph_factors.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// How level odom is, is learnt while driving: a keyframe is levelled by what was known this much
/// farther on. Over that distance odom's own tilt hardly drifts (0.06 degree).
constexpr double kLevellingLag_m = 100.0;
/// Of gravity in odom when it was learnt, and how far it is the same error.
constexpr double kUpSigma_rad = 1e-3;
constexpr double kUpCorrelation_m = 100.0;
/// Of a relative pose besides the drift: two scans' own noise. Small, because that noise does not
/// walk: each scan is matched against the map, not against the one before.
constexpr double kEdgePosition_m = 2e-3;
constexpr double kEdgeRotation_rad = 5e-5;
/// Keyframes are a metre apart or less; a longer step was driven blind.
constexpr double kBlindStep_m = 3.0;
constexpr double kBlindShare = 0.1;  // of the step, in position; a tenth of it in rad
/// The track was found again after a restart, by registration.
constexpr Nanoseconds kRestart_ns = 30 * kNanosecondsPerSecond;
constexpr double kFoundAgain_m = 0.1;
constexpr double kFoundAgain_rad = 5e-3;
constexpr Nanoseconds kLongestGap_ns = kNanosecondsPerSecond / 2;
/// Fewer rows do not hold an epoch.
constexpr std::size_t kFewestRows = 10;
constexpr double kHeld_m = 0.01;
constexpr double kHeld_rad = 1e-3;
/// A gate admits an alignment with a sigma of 1 degree.
constexpr double kAligned_m = 1.0;
constexpr double kAligned_rad = 0.0175;
constexpr double kLoose_m = 100.0;
constexpr double kLoose_rad = 3.0;
constexpr double kEpochLeap_m = 1e6;

Matrix6d diagonal(double position_m, double rotation_rad) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << Vector3d::Constant(position_m * position_m),
      Vector3d::Constant(rotation_rad * rotation_rad);
  return covariance;
}

std::vector<Eigen::Vector2d> tilts_of(const GraphInput& input,
                                      const std::vector<EpochRange>& epochs,
                                      const std::vector<double>& driven_m) {
  std::vector<Eigen::Vector2d> tilts_rad(input.keyframes.size(), Eigen::Vector2d::Zero());
  for (const EpochRange& epoch : epochs) {
    std::size_t ahead = epoch.first;
    for (std::size_t i = epoch.first; i < epoch.last; ++i) {
      while (ahead + 1 < epoch.last && driven_m[ahead] < driven_m[i] + kLevellingLag_m) {
        ++ahead;
      }
      tilts_rad[i] = input.keyframes[ahead].T_map_odom.tilt_rad;
    }
  }
  return tilts_rad;
}

/// The same transform with another tilt, turned about the point `p_odom_m`, which stays.
YawPose levelled(const YawPose& T_map_odom,
                 const Eigen::Vector2d& tilt_rad,
                 const Vector3d& p_odom_m) {
  YawPose turned = T_map_odom;
  turned.tilt_rad = tilt_rad;
  turned.p += T_map_odom.pose() * p_odom_m - turned.pose() * p_odom_m;
  return turned;
}

struct FirstAlignment {
  YawPose T_map_odom;
  Vector3d at_odom_m{Vector3d::Zero()};
};

std::optional<FirstAlignment> first_alignment_of(const GraphInput& input, const EpochRange& epoch) {
  for (std::size_t i = epoch.first; i < epoch.last; ++i) {
    if (input.keyframes[i].aligned) {
      return FirstAlignment{input.keyframes[i].T_map_odom, input.keyframes[i].T_odom_base.p};
    }
  }
  if (input.fallback && input.fallback->odom_epoch == epoch.odom_epoch) {
    return FirstAlignment{input.fallback->T_map_odom, Vector3d::Zero()};
  }
  return std::nullopt;
}

RelativeFactor edge_between(const GraphInput& input, std::size_t i, const DriftConfig& drift) {
  const GraphKeyframe& from = input.keyframes[i];
  const GraphKeyframe& to = input.keyframes[i + 1];
  const double distance_m = (to.T_odom_base.p - from.T_odom_base.p).norm();
  const bool blind = distance_m > kBlindStep_m;
  const bool found_again = to.stamp_ns - from.stamp_ns > kRestart_ns;
  const auto variance = [&](double noise, double per_root_metre, double blind_share, double again) {
    const double blindly = blind ? blind_share * distance_m : 0.0;
    const double after_restart = found_again ? again : 0.0;
    return noise * noise + per_root_metre * per_root_metre * distance_m + blindly * blindly +
           after_restart * after_restart;
  };
  RelativeFactor edge{i, i + 1, from.T_odom_base.inverse() * to.T_odom_base, Matrix6d::Zero()};
  edge.covariance.topLeftCorner<3, 3>() =
      variance(kEdgePosition_m, drift.position_sigma_m_sqrtm, kBlindShare, kFoundAgain_m) *
      Matrix3d::Identity();
  const double tilt =
      variance(kEdgeRotation_rad, drift.tilt_sigma_rad_sqrtm, 0.01 * kBlindShare, kFoundAgain_rad);
  const double yaw =
      variance(kEdgeRotation_rad, drift.yaw_sigma_rad_sqrtm, 0.1 * kBlindShare, kFoundAgain_rad);
  const Matrix3d R =
      to.T_odom_base.q.toRotationMatrix();  // odom is level to a fraction of a degree
  edge.covariance.bottomRightCorner<3, 3>() =
      R.transpose() * Vector3d(tilt, tilt, yaw).asDiagonal() * R;
  return edge;
}

/// Nothing when the row says nothing, or lies where odom is not known.
std::optional<PositionFactor> position_of(const GraphInput& input,
                                          const EpochRange& epoch,
                                          const StoredRow& row) {
  const Nanoseconds stamp_ns = row.update.fix_stamp_ns;
  const std::optional<Pose> T_odom_base = odom_at(input, epoch, stamp_ns);
  std::vector<Eigen::Index> axes;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (row.update.decision[axis] == AxisDecision::kFused) {
      axes.push_back(static_cast<Eigen::Index>(axis));
    }
  }
  if (!row.applied || !T_odom_base || axes.empty()) {
    return std::nullopt;
  }
  const auto begin = input.keyframes.begin() + static_cast<std::ptrdiff_t>(epoch.first);
  const auto end = input.keyframes.begin() + static_cast<std::ptrdiff_t>(epoch.last);
  auto node = std::lower_bound(
      begin, end, stamp_ns, [](const GraphKeyframe& k, Nanoseconds t) { return k.stamp_ns < t; });
  if (node == end ||
      (node != begin && stamp_ns - std::prev(node)->stamp_ns < node->stamp_ns - stamp_ns)) {
    --node;
  }
  PositionFactor factor;
  factor.node = static_cast<std::size_t>(node - input.keyframes.begin());
  factor.point_base_m = node->T_odom_base.inverse() * (*T_odom_base * row.update.lever_arm_base_m);
  factor.position_map_m = row.update.position_map_m;
  const Eigen::MatrixXd covariance = row.update.covariance_map_m2(axes, axes);
  const Eigen::LLT<Eigen::MatrixXd> cholesky(covariance);
  if (cholesky.info() != Eigen::Success || !factor.position_map_m.allFinite()) {
    return std::nullopt;
  }
  const auto size = static_cast<Eigen::Index>(axes.size());
  const Eigen::MatrixXd W = cholesky.matrixL().solve(Eigen::MatrixXd::Identity(size, size));
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j < size; ++j) {
      factor.sqrt_information(i, axes[static_cast<std::size_t>(j)]) = W(i, j);
    }
  }
  return factor;
}

void add_ups(const EpochRange& epoch,
             const OnlinePlaces& places,
             const std::vector<double>& driven_m,
             Graph& graph) {
  for (std::size_t i = epoch.first; i < epoch.last; ++i) {
    const double step_m = i == epoch.first ? 1.0 : driven_m[i] - driven_m[i - 1];
    if (step_m < 1e-3) {
      continue;
    }
    // Together the nodes within the correlation's length weigh as much as one with the sigma.
    const double sigma_rad = kUpSigma_rad * std::sqrt(kUpCorrelation_m / step_m);
    graph.ups.push_back({i, places.q_level_base[i].conjugate() * Vector3d::UnitZ(), sigma_rad});
  }
}

void add_positions(const GraphInput& input, const EpochRange& epoch, Graph& graph) {
  for (const StoredRow& row : input.rows) {
    if (row.odom_epoch != epoch.odom_epoch) {
      continue;
    }
    if (const auto position = position_of(input, epoch, row)) {
      graph.positions.push_back(*position);
    }
  }
}

/// Epochs with rows are held by them; others by their alignment, and where no epoch has rows the
/// first one holds the map.
void hold(const std::vector<EpochRange>& epochs,
          const std::vector<std::size_t>& rows_of_epochs,
          const OnlinePlaces& places,
          Graph& graph) {
  bool held = std::any_of(rows_of_epochs.begin(), rows_of_epochs.end(), [](std::size_t rows) {
    return rows >= kFewestRows;
  });
  for (std::size_t e = 0; e < epochs.size(); ++e) {
    const std::size_t node = epochs[e].first;
    if (!places.T_map_base[node]) {
      continue;
    }
    const Matrix6d covariance = rows_of_epochs[e] >= kFewestRows ? diagonal(kLoose_m, kLoose_rad)
                                : held ? diagonal(kAligned_m, kAligned_rad)
                                       : diagonal(kHeld_m, kHeld_rad);
    graph.priors.push_back({node, *places.T_map_base[node], covariance});
    held = true;
  }
}

}  // namespace

std::vector<EpochRange> epochs_of(const GraphInput& input) {
  std::vector<EpochRange> epochs;
  for (std::size_t i = 0; i < input.keyframes.size(); ++i) {
    const std::uint32_t number = input.keyframes[i].odom_epoch;
    if (epochs.empty() || epochs.back().odom_epoch != number) {
      epochs.push_back({number, i, i, 0, 0});
    }
    epochs.back().last = i + 1;
  }
  std::size_t sample = 0;
  for (EpochRange& epoch : epochs) {
    while (sample < input.trajectory.size() &&
           input.trajectory[sample].odom_epoch != epoch.odom_epoch) {
      ++sample;
    }
    epoch.first_sample = sample;
    while (sample < input.trajectory.size() &&
           input.trajectory[sample].odom_epoch == epoch.odom_epoch) {
      ++sample;
    }
    epoch.last_sample = sample;
  }
  return epochs;
}

std::vector<double> driven_of(const GraphInput& input) {
  std::vector<double> driven_m(input.keyframes.size(), 0.0);
  for (std::size_t i = 1; i < input.keyframes.size(); ++i) {
    const GraphKeyframe& before = input.keyframes[i - 1];
    const GraphKeyframe& here = input.keyframes[i];
    driven_m[i] = driven_m[i - 1] + (before.odom_epoch == here.odom_epoch
                                         ? (here.T_odom_base.p - before.T_odom_base.p).norm()
                                         : kEpochLeap_m);
  }
  return driven_m;
}

OnlinePlaces place_online(const GraphInput& input) {
  const std::vector<EpochRange> epochs = epochs_of(input);
  const std::vector<Eigen::Vector2d> tilts_rad = tilts_of(input, epochs, driven_of(input));
  OnlinePlaces places;
  places.T_map_base.resize(input.keyframes.size());
  places.q_level_base.resize(input.keyframes.size());
  std::vector<std::optional<FirstAlignment>> first;
  for (const EpochRange& epoch : epochs) {
    first.push_back(first_alignment_of(input, epoch));
  }
  const bool any =
      std::any_of(first.begin(), first.end(), [](const auto& a) { return a.has_value(); });
  if (!any && !epochs.empty()) {
    const auto largest = std::max_element(epochs.begin(), epochs.end(), [](auto& a, auto& b) {
      return a.last - a.first < b.last - b.first;
    });
    first[static_cast<std::size_t>(largest - epochs.begin())] = FirstAlignment{};
    places.frame = "odom";
  }
  for (std::size_t e = 0; e < epochs.size(); ++e) {
    for (std::size_t i = epochs[e].first; i < epochs[e].last; ++i) {
      const GraphKeyframe& keyframe = input.keyframes[i];
      const YawPose level{0.0, Vector3d::Zero(), tilts_rad[i]};
      places.q_level_base[i] = level.pose().q * keyframe.T_odom_base.q;
      if (first[e]) {
        const YawPose T = keyframe.aligned
                              ? levelled(keyframe.T_map_odom, tilts_rad[i], keyframe.T_odom_base.p)
                              : levelled(first[e]->T_map_odom, tilts_rad[i], first[e]->at_odom_m);
        places.T_map_base[i] = T.pose() * keyframe.T_odom_base;
      }
    }
  }
  return places;
}

std::optional<Pose> odom_at(const GraphInput& input,
                            const EpochRange& epoch,
                            Nanoseconds stamp_ns) {
  const auto begin = input.trajectory.begin() + static_cast<std::ptrdiff_t>(epoch.first_sample);
  const auto end = input.trajectory.begin() + static_cast<std::ptrdiff_t>(epoch.last_sample);
  const auto after = std::lower_bound(
      begin, end, stamp_ns, [](const OdomSample& s, Nanoseconds t) { return s.stamp_ns < t; });
  if (after == end) {
    return std::nullopt;
  }
  if (after->stamp_ns == stamp_ns) {
    return after->T_odom_base;
  }
  if (after == begin || after->stamp_ns - std::prev(after)->stamp_ns > kLongestGap_ns) {
    return std::nullopt;
  }
  const auto before = std::prev(after);
  return interpolate(before->T_odom_base,
                     after->T_odom_base,
                     static_cast<double>(stamp_ns - before->stamp_ns) /
                         static_cast<double>(after->stamp_ns - before->stamp_ns));
}

Graph factors_of(const GraphInput& input,
                 const OnlinePlaces& places,
                 const PoseGraphOptions& options) {
  Graph graph;
  graph.position_width = options.row_width;
  graph.loop_width = options.loop_width;
  const std::vector<double> driven_m = driven_of(input);
  std::vector<std::size_t> rows_of_epochs;
  const std::vector<EpochRange> epochs = epochs_of(input);
  for (const EpochRange& epoch : epochs) {
    const std::size_t before = graph.positions.size();
    if (places.T_map_base[epoch.first]) {
      for (std::size_t i = epoch.first; i + 1 < epoch.last; ++i) {
        graph.edges.push_back(edge_between(input, i, input.drift));
      }
      add_ups(epoch, places, driven_m, graph);
      add_positions(input, epoch, graph);
    }
    rows_of_epochs.push_back(graph.positions.size() - before);
  }
  hold(epochs, rows_of_epochs, places, graph);
  return graph;
}

}  // namespace trigpoint::lio_mapper
