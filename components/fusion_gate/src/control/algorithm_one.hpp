// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Algorithm I of S. Hossain, X. Lin, "Uncertainty-Aware Tightly-Coupled GPS Fused LIO-SLAM", 2022.
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/fusion_gate/config.hpp"

#include <Eigen/Core>

#include <array>
#include <string>

namespace trigpoint::fusion_gate {

enum class Mode { kLio, kFusion, kLiteral, kHard, kSmooth };

/// The configured text; Config is validated, so that any other text is a broken invariant.
Mode mode_of(const std::string& text);

struct AxisChoice {
  AxisDecision decision{AxisDecision::kLio};
  double sigma_m{kNaN};
  double threshold_m{kNaN};
  std::string reason;  ///< "sigma 0.62 m > threshold 0.50 m"
};

using AxisChoices = std::array<AxisChoice, 3>;

/// "If noise.uncertainty[x] > Threshold[x]: LIO.state.update.x, else fusion.state.update.x".
/// Equality is fused, as printed. A variance that is NaN or negative is LIO: the printed comparison
/// would let it pass.
AxisChoice algorithm_one(double variance_m2, double threshold_m);

/// The thresholds as sigmas in metres.
Eigen::Vector3d threshold_sigma_m(const Config& config);

/// One choice an axis of map for the mode; `variance_map_m2` of the GPS odometry, NaN = not known.
AxisChoices choose_axes(Mode mode,
                        const Eigen::Vector3d& variance_map_m2,
                        const Eigen::Vector3d& threshold_m);

bool any_fused(const AxisChoices& choices);

}  // namespace trigpoint::fusion_gate
