// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "drive.hpp"

#include "trigpoint/base/so3.hpp"

#include "moving_average.hpp"
#include "path.hpp"
#include "random.hpp"
#include "route.hpp"
#include "speed_profile.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::simulator {

namespace {

constexpr double kKnot_s = 0.025;
constexpr std::size_t kBefore = 2;       ///< controls before the knot at t = 0 that reach it
constexpr std::size_t kHalfWindow = 10;  ///< two averages over half a second each limit the jerk
constexpr double kVibration_hz = 1.5;
constexpr double kVibrationSpeed_mps = 3.0;  ///< at which the configured vibration is reached

double time_of_control(std::size_t i) {
  return (static_cast<double>(i) - static_cast<double>(kBefore)) * kKnot_s;
}

/// Noise with unit variance that a suspension lets through: white noise behind two first-order
/// lags.
std::vector<double> suspension_noise(std::size_t n, Random& random) {
  const double keep = std::exp(-2.0 * std::numbers::pi * kVibration_hz * kKnot_s);
  std::vector<double> noise(n);
  double first = 0.0;
  double second = 0.0;
  double power = 0.0;
  for (double& value : noise) {
    first = keep * first + (1.0 - keep) * random.normal();
    second = keep * second + (1.0 - keep) * first;
    value = second;
    power += second * second;
  }
  const double scale = 1.0 / std::sqrt(power / static_cast<double>(n));
  for (double& value : noise) {
    value *= scale;
  }
  return noise;
}

std::vector<double> distances(const SpeedProfile& profile, std::size_t n) {
  // Averaging reaches this far back: the configured rest stays a true rest.
  const double delay_s = profile.distance_m(-1.0) < 0.0 ? 0.0 : 2.0 * kHalfWindow * kKnot_s + 0.1;
  std::vector<double> s_m(n);
  for (std::size_t i = 0; i < n; ++i) {
    s_m[i] = profile.distance_m(time_of_control(i) - delay_s);
  }
  return moving_average(moving_average(s_m, kHalfWindow), kHalfWindow);
}

/// Pose on the ground: heading along the path, roll and pitch along the slope.
Drive::Control on_ground(const Path::Place& place, const Relief& relief, double base_height_m) {
  const Eigen::Vector2d slope = relief.slope(place.position_m.x(), place.position_m.y());
  const Eigen::Vector2d forward(std::cos(place.heading_rad), std::sin(place.heading_rad));
  const Eigen::Vector2d left(-forward.y(), forward.x());
  Drive::Control control;
  control << place.position_m,
      relief.height_m(place.position_m.x(), place.position_m.y()) + base_height_m,
      std::atan(slope.dot(left)), -std::atan(slope.dot(forward)), place.heading_rad;
  return control;
}

using Weights = Eigen::Matrix<double, 6, 1>;

/// The six quintic basis functions and their derivatives at u in [0, 1) after a knot, [1].
struct Basis {
  explicit Basis(double u) {
    const double u2 = u * u;
    const double u3 = u2 * u;
    const double u4 = u3 * u;
    const double u5 = u4 * u;
    const double m = 1.0 - u;
    value << m * m * m * m * m, 26.0 - 50.0 * u + 20.0 * (u2 + u3 - u4) + 5.0 * u5,
        66.0 - 60.0 * u2 + 30.0 * u4 - 10.0 * u5,
        26.0 + 50.0 * u + 20.0 * (u2 - u3 - u4) + 10.0 * u5,
        1.0 + 5.0 * (u + u4 - u5) + 10.0 * (u2 + u3), u5;
    first << -5.0 * m * m * m * m, -50.0 + 40.0 * u + 60.0 * u2 - 80.0 * u3 + 25.0 * u4,
        -120.0 * u + 120.0 * u3 - 50.0 * u4, 50.0 + 40.0 * u - 60.0 * u2 - 80.0 * u3 + 50.0 * u4,
        5.0 + 20.0 * u + 30.0 * u2 + 20.0 * u3 - 25.0 * u4, 5.0 * u4;
    second << 20.0 * m * m * m, 40.0 + 120.0 * u - 240.0 * u2 + 100.0 * u3,
        -120.0 + 360.0 * u2 - 200.0 * u3, 40.0 - 120.0 * u - 240.0 * u2 + 200.0 * u3,
        20.0 + 60.0 * u + 60.0 * u2 - 100.0 * u3, 20.0 * u3;
    value /= 120.0;
    first /= 120.0 * kKnot_s;
    second /= 120.0 * kKnot_s * kKnot_s;
  }

  Weights value;
  Weights first;
  Weights second;
};

/// Body rates from the rates of roll, pitch, yaw, [2] eq. 79 ff.
Eigen::Vector3d body_rates(const Eigen::Vector3d& rpy, const Eigen::Vector3d& rates) {
  const double sr = std::sin(rpy.x());
  const double cr = std::cos(rpy.x());
  const double sp = std::sin(rpy.y());
  const double cp = std::cos(rpy.y());
  return {rates.x() - rates.z() * sp,
          rates.y() * cr + rates.z() * sr * cp,
          -rates.y() * sr + rates.z() * cr * cp};
}

}  // namespace

Drive::Drive(const Scenario& scenario, const Relief& relief, std::uint64_t seed, double duration_s)
    : start_ns_(scenario.start_ns()), duration_s_(duration_s) {
  const MotionConfig& config = scenario.motion;
  const Path path(driven_route(scenario));
  const SpeedProfile profile(path, config);
  const auto n = static_cast<std::size_t>(std::ceil(duration_s / kKnot_s)) + 2 * kHalfWindow + 8;
  const std::vector<double> s_m = distances(profile, n);
  Random random(derive_seed(seed, kMotionSeed));
  const std::vector<double> roll_noise = suspension_noise(n, random);
  const std::vector<double> pitch_noise = suspension_noise(n, random);
  const std::vector<double> heave_noise = suspension_noise(n, random);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t before = i == 0 ? 0 : i - 1;
    const std::size_t after = std::min(i + 1, n - 1);
    const double v = (s_m[after] - s_m[before]) / (static_cast<double>(after - before) * kKnot_s);
    const double a = (s_m[after] - 2.0 * s_m[i] + s_m[before]) / (kKnot_s * kKnot_s);
    const Path::Place place = path.at(s_m[i]);
    const double shake = std::min(1.0, v / kVibrationSpeed_mps);
    Control control = on_ground(place, relief, config.base_height_m);
    control[2] += shake * config.vibration_heave_m * heave_noise[i];
    control[3] += config.roll_per_lateral_rad_s2pm * v * v * place.curvature_radpm +
                  shake * config.vibration_angle_rad * roll_noise[i];
    control[4] += -config.pitch_per_acceleration_rad_s2pm * (i == 0 || i == n - 1 ? 0.0 : a) +
                  shake * config.vibration_angle_rad * pitch_noise[i];
    controls_.push_back(control);
  }
}

TrueState Drive::at_time(double t_s) const {
  const double index = std::clamp(t_s, 0.0, duration_s_ + kKnot_s) / kKnot_s;
  const auto i = static_cast<std::size_t>(index);
  const Basis basis(index - static_cast<double>(i));
  Control value = Control::Zero();
  Control first = Control::Zero();
  Control second = Control::Zero();
  for (std::size_t k = 0; k < 6; ++k) {
    const auto w = static_cast<Eigen::Index>(k);
    value += basis.value[w] * controls_[i + k];
    first += basis.first[w] * controls_[i + k];
    second += basis.second[w] * controls_[i + k];
  }
  return {Pose(from_roll_pitch_yaw(value.tail<3>()), value.head<3>()),
          first.head<3>(),
          second.head<3>(),
          body_rates(value.tail<3>(), first.tail<3>())};
}

TrueState Drive::at(Nanoseconds stamp_ns) const {
  return at_time(to_seconds(stamp_ns - start_ns_));
}

std::vector<Eigen::Vector2d> Drive::track(double step_s) const {
  std::vector<Eigen::Vector2d> places;
  for (double t_s = 0.0; t_s <= duration_s_; t_s += step_s) {
    places.emplace_back(at_time(t_s).T_map_base.p.head<2>());
  }
  return places;
}

}  // namespace trigpoint::simulator
