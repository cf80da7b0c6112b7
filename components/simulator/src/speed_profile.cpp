// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "speed_profile.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::simulator {

namespace {

constexpr double kCornerCell_m = 0.1;

/// Speeds at the ends of the cells that no limit of acceleration forbids.
std::vector<double> reachable_speeds(const Path& path, const MotionConfig& config) {
  const auto cells = static_cast<std::size_t>(path.length_m() / kCornerCell_m);
  std::vector<double> v(cells + 1);
  for (std::size_t i = 0; i <= cells; ++i) {
    const double s_m = static_cast<double>(i) * kCornerCell_m;
    const double curvature = std::max(std::abs(path.at(s_m).curvature_radpm), 1e-6);
    v[i] = std::min(path.wanted_speed_mps(s_m),
                    std::sqrt(config.lateral_acceleration_mps2 / curvature));
  }
  for (const Path::Stop& stop : path.stops()) {
    v[std::min(cells, static_cast<std::size_t>(std::lround(stop.s_m / kCornerCell_m)))] = 0.0;
  }
  v[cells] = 0.0;
  if (config.rest_s > 0.0) {
    v[0] = 0.0;
  }
  const double gain = 2.0 * config.acceleration_mps2 * kCornerCell_m;
  for (std::size_t i = 1; i <= cells; ++i) {
    v[i] = std::min(v[i], std::sqrt(v[i - 1] * v[i - 1] + gain));
  }
  for (std::size_t i = cells; i > 0; --i) {
    v[i - 1] = std::min(v[i - 1], std::sqrt(v[i] * v[i] + gain));
  }
  return v;
}

double dwell_s(const Path& path, std::size_t cell) {
  for (const Path::Stop& stop : path.stops()) {
    if (static_cast<std::size_t>(std::lround(stop.s_m / kCornerCell_m)) == cell) {
      return stop.duration_s;
    }
  }
  return 0.0;
}

}  // namespace

SpeedProfile::SpeedProfile(const Path& path, const MotionConfig& config) {
  const std::vector<double> v = reachable_speeds(path, config);
  double t_s = config.rest_s;
  for (std::size_t i = 0; i < v.size(); ++i) {
    const double s_m = static_cast<double>(i) * kCornerCell_m;
    if (i > 0) {
      t_s += 2.0 * kCornerCell_m / (v[i - 1] + v[i]);
    }
    nodes_.push_back({t_s, s_m, v[i]});
    if (const double dwell = dwell_s(path, i); dwell > 0.0) {
      t_s += dwell;
      nodes_.push_back({t_s, s_m, v[i]});
    }
  }
}

double SpeedProfile::distance_m(double t_s) const {
  if (t_s <= nodes_.front().t_s) {
    return nodes_.front().v_mps * (t_s - nodes_.front().t_s);
  }
  if (t_s >= nodes_.back().t_s) {
    return nodes_.back().s_m;
  }
  const auto next = std::upper_bound(
      nodes_.begin(), nodes_.end(), t_s, [](double t, const Node& node) { return t < node.t_s; });
  const Node& a = *std::prev(next);
  const double dt = next->t_s - a.t_s;
  const double tau = t_s - a.t_s;
  return a.s_m + a.v_mps * tau + 0.5 * (next->v_mps - a.v_mps) / dt * tau * tau;
}

}  // namespace trigpoint::simulator
