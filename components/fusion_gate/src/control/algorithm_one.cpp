// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "control/algorithm_one.hpp"

#include "trigpoint/base/sentence.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace trigpoint::fusion_gate {

Mode mode_of(const std::string& text) {
  if (text == "lio") {
    return Mode::kLio;
  }
  if (text == "fusion") {
    return Mode::kFusion;
  }
  if (text == "literal") {
    return Mode::kLiteral;
  }
  if (text == "hard") {
    return Mode::kHard;
  }
  assert(text == "smooth");
  return Mode::kSmooth;
}

AxisChoice algorithm_one(double variance_m2, double threshold_m) {
  const double sigma_m = std::sqrt(variance_m2);
  if (!std::isfinite(sigma_m)) {
    return {AxisDecision::kLio, kNaN, threshold_m, "sigma of the GPS odometry is not known"};
  }
  if (sigma_m > threshold_m) {
    return {AxisDecision::kLio,
            sigma_m,
            threshold_m,
            sentence("sigma %.2f m > threshold %.2f m", sigma_m, threshold_m)};
  }
  return {AxisDecision::kFused,
          sigma_m,
          threshold_m,
          sentence("sigma %.2f m <= threshold %.2f m", sigma_m, threshold_m)};
}

Eigen::Vector3d threshold_sigma_m(const Config& config) {
  return config.threshold_on == "variance" ? Eigen::Vector3d(config.threshold.cwiseSqrt())
                                           : config.threshold;
}

AxisChoices choose_axes(Mode mode,
                        const Eigen::Vector3d& variance_map_m2,
                        const Eigen::Vector3d& threshold_m) {
  AxisChoices choices;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto index = static_cast<Eigen::Index>(axis);
    choices[axis] = algorithm_one(variance_map_m2[index], threshold_m[index]);
    if (mode == Mode::kLio) {
      choices[axis].decision = AxisDecision::kLio;
      choices[axis].reason = "mode lio takes no GPS rows";
    } else if (mode == Mode::kFusion) {
      choices[axis].decision = AxisDecision::kFused;
      choices[axis].reason = "mode fusion takes every row";
    }
  }
  return choices;
}

bool any_fused(const AxisChoices& choices) {
  return std::any_of(choices.begin(), choices.end(), [](const AxisChoice& choice) {
    return choice.decision == AxisDecision::kFused;
  });
}

}  // namespace trigpoint::fusion_gate
