// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "clock_offset.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

constexpr double kPriorOffset_s = 0.1;
/// Crystals differ by 20 to 100 parts in a million.
constexpr double kPriorRate = 1e-4;
constexpr double kRateWalk_sqrts = 5e-6;
constexpr std::size_t kFewestWindows = 5;
/// Noise and excess are means over about so many windows.
constexpr double kMemory_windows = 15.0;
/// An innovation beyond this many sigmas counts as that many.
constexpr double kClip = 3.0;
constexpr double kKnown_s = 2e-3;

/// Least squares of y = a + b t + d w over a window, three axes with their own a and b.
struct WindowFit {
  double information{0.0};  ///< sum of w^2 after a and b took their share
  double offset_s{0.0};
  double residual2_rad2{0.0};  ///< mean of squares, free of the parameters' share
};

/// What a line through the samples leaves of them.
std::vector<double> without_line(const std::vector<double>& t, std::vector<double> y) {
  const auto n = static_cast<double>(t.size());
  double mean_t = 0.0;
  double mean_y = 0.0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    mean_t += t[i] / n;
    mean_y += y[i] / n;
  }
  double tt = 0.0;
  double ty = 0.0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    tt += (t[i] - mean_t) * (t[i] - mean_t);
    ty += (t[i] - mean_t) * (y[i] - mean_y);
  }
  for (std::size_t i = 0; i < t.size(); ++i) {
    y[i] -= mean_y + (tt > 0.0 ? ty / tt : 0.0) * (t[i] - mean_t);
  }
  return y;
}

}  // namespace

void ClockOffsetEstimator::add(const AttitudeWindow& window) {
  if (window.samples.empty()) {
    return;
  }
  std::vector<double> t;
  for (const AttitudeSample& sample : window.samples) {
    t.push_back(sample.time_s);
  }
  WindowFit fit;
  double wy = 0.0;
  double yy = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> y;
    std::vector<double> w;
    for (const AttitudeSample& sample : window.samples) {
      y.push_back(sample.difference_rad()[axis]);
      w.push_back(sample.rate_odom_radps[axis]);
    }
    y = without_line(t, std::move(y));
    w = without_line(t, std::move(w));
    for (std::size_t i = 0; i < t.size(); ++i) {
      fit.information += w[i] * w[i];
      wy += w[i] * y[i];
      yy += y[i] * y[i];
    }
  }
  if (fit.information <= 0.0) {
    return;
  }
  fit.offset_s = wy / fit.information;
  const double freedom = 3.0 * (static_cast<double>(t.size()) - 2.0) - 1.0;
  fit.residual2_rad2 = std::max(0.0, yy - fit.offset_s * wy) / freedom;

  const double share = 1.0 / std::min(static_cast<double>(++windows_), kMemory_windows);
  noise2_rad2_ += share * (fit.residual2_rad2 - noise2_rad2_);
  const Nanoseconds middle_ns = window.begin_ns + (window.end_ns - window.begin_ns) / 2;
  if (windows_ == 1) {
    covariance_ =
        Eigen::Vector2d(kPriorOffset_s * kPriorOffset_s, kPriorRate * kPriorRate).asDiagonal();
  } else {
    const double dt_s = to_seconds(middle_ns - updated_ns_);
    Eigen::Matrix2d transition = Eigen::Matrix2d::Identity();
    transition(0, 1) = dt_s;
    state_ = transition * state_;
    covariance_ = transition * covariance_ * transition.transpose();
    covariance_(1, 1) += kRateWalk_sqrts * kRateWalk_sqrts * dt_s;
  }
  updated_ns_ = middle_ns;
  // A window that fits worse than the others counts by itself.
  const double noise2 = std::max(noise2_rad2_, fit.residual2_rad2) / fit.information * excess_;
  const double innovation = fit.offset_s - state_[0];
  const double variance = covariance_(0, 0) + noise2;
  const double ratio2 = innovation * innovation / variance;
  if (windows_ > kFewestWindows) {
    const double seen = std::min(ratio2, kClip * kClip) * excess_;
    excess_ = std::max(1.0, excess_ + (seen - excess_) / kMemory_windows);
  }
  const double robust = std::max(1.0, std::sqrt(ratio2) / kClip);
  const Eigen::Vector2d gain = covariance_.col(0) / (covariance_(0, 0) + robust * noise2);
  state_ += gain * innovation;
  covariance_ = (covariance_ - gain * covariance_.row(0)).eval();
}

std::optional<ClockOffset> ClockOffsetEstimator::estimate() const {
  const double sigma_s = std::sqrt(std::max(0.0, covariance_(0, 0)));
  if (windows_ < kFewestWindows || sigma_s > kKnown_s) {
    return std::nullopt;
  }
  return ClockOffset{state_[0], sigma_s};
}

}  // namespace trigpoint::lio_mapper
