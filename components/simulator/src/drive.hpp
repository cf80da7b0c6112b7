// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The true motion of base_link. References: [1] C. de Boor, "A practical guide to splines",
// Springer 2001, ch. IX-X (uniform B-splines). [2] J. Diebel, "Representing attitude", Stanford
// 2006, sec. 5.
#pragma once

#include "trigpoint/simulator/simulator.hpp"

#include "relief.hpp"
#include <Eigen/Core>

#include <vector>

namespace trigpoint::simulator {

/// A uniform quintic B-spline in time through east, north, up, roll, pitch, yaw. The drive *is* the
/// spline, so velocity, acceleration and rates are its exact derivatives and continuous (C4).
class Drive final : public Truth {
 public:
  /// `duration_s` from the scenario's start; times outside are held inside.
  Drive(const Scenario& scenario, const Relief& relief, std::uint64_t seed, double duration_s);

  TrueState at(Nanoseconds stamp_ns) const override;

  Nanoseconds first_ns() const override { return start_ns_; }

  Nanoseconds last_ns() const override { return start_ns_ + from_seconds(duration_s_); }

  /// The same at seconds from the scenario's start.
  TrueState at_time(double t_s) const;

  double duration_s() const { return duration_s_; }

  /// Plan view (east, north) every `step_s`.
  std::vector<Eigen::Vector2d> track(double step_s) const;

  using Control = Eigen::Matrix<double, 6, 1>;

 private:
  Nanoseconds start_ns_;
  double duration_s_;
  std::vector<Control> controls_;
};

}  // namespace trigpoint::simulator
