// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "urban.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Vector3d;

struct Kind {
  FixStatus status;
  Vector3d wander_sigma_m;
  double wander_tau_s;
  Vector3d white_sigma_m;
  double reported_sigma_m;  ///< horizontal; vertical 1.8 times that
  double shortest_s;
  double longest_s;
};

const Kind kFixedKind{FixStatus::kGbas,
                      {0.008, 0.008, 0.015},
                      100.0,
                      {0.010, 0.010, 0.018},
                      0.014,
                      20.0,
                      60.0};
const Kind
    kFloatKind{FixStatus::kGbas, {0.35, 0.35, 0.6}, 40.0, {0.07, 0.07, 0.1}, 0.3, 10.0, 25.0};
const Kind kCodeKind{FixStatus::kSbas, {1.5, 1.5, 3.0}, 60.0, {0.3, 0.3, 0.6}, 1.8, 5.0, 15.0};

/// One interval of one kind; nothing when `kind` is null.
struct Interval {
  const Kind* kind;
  double end_s;
  Vector3d bias_m;
};

class Receiver {
 public:
  Receiver(const UrbanReceiver& config, unsigned seed)
      : config_(config), random_(seed), now_{&kFixedKind, config.open_sky_until_s, {0, 0, 0}} {
    begin();
  }

  /// Advances to `time_s`; the error of a fix there, or null.
  const Kind* at(double time_s, double step_s, Vector3d& error_m) {
    if (time_s >= now_.end_s) {
      next(time_s);
    }
    if (now_.kind == nullptr) {
      return nullptr;
    }
    const double keep = std::exp(-step_s / now_.kind->wander_tau_s);
    wander_ = keep * wander_ +
              std::sqrt(1.0 - keep * keep) * now_.kind->wander_sigma_m.cwiseProduct(normal3());
    error_m = wander_ + now_.bias_m + now_.kind->white_sigma_m.cwiseProduct(normal3());
    return now_.kind;
  }

 private:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  Vector3d normal3() {
    std::normal_distribution<double> normal;
    const double x = normal(random_);
    const double y = normal(random_);
    return {x, y, normal(random_)};
  }

  void begin() { wander_ = now_.kind->wander_sigma_m.cwiseProduct(normal3()); }

  Vector3d horizontal(double least_m, double most_m, double vertical_share) {
    const double size = uniform(least_m, most_m);
    const double angle = uniform(0.0, 2.0 * std::numbers::pi);
    return {size * std::cos(angle),
            size * std::sin(angle),
            size * vertical_share * std::normal_distribution<double>()(random_)};
  }

  void next(double time_s) {
    const Kind* last = now_.kind;
    const double draw = uniform(0.0, 1.0);
    const Kind* kind = draw < 0.55   ? &kFixedKind
                       : draw < 0.80 ? &kFloatKind
                       : draw < 0.92 ? &kCodeKind
                                     : nullptr;
    now_ = {kind, time_s, Vector3d::Zero()};
    if (kind == nullptr) {
      now_.end_s += uniform(4.0, config_.longest_outage_s);
      return;
    }
    now_.end_s += uniform(kind->shortest_s, kind->longest_s);
    if (kind == last) {
      return;  // the same solution goes on
    }
    begin();
    if (kind == &kFixedKind && uniform(0.0, 1.0) < config_.wrong_fix_share) {
      now_.bias_m = horizontal(0.4, 1.6, 0.5);
    }
    if (kind == &kCodeKind && uniform(0.0, 1.0) < config_.reflection_share) {
      now_.bias_m = horizontal(3.0, 12.0, 0.8);
    }
  }

  UrbanReceiver config_;
  std::mt19937_64 random_;
  Interval now_;
  Vector3d wander_;
};

}  // namespace

std::vector<Input> sense_urban(const std::vector<Truth>& truth,
                               const Sensors& sensors,
                               const UrbanReceiver& config,
                               unsigned seed) {
  std::vector<Input> inputs = sense(truth, sensors, seed);
  std::erase_if(inputs, [](const Input& input) { return input.is_fix; });
  Receiver receiver(config, seed + 10'000);
  const double step_s = 1.0 / sensors.fix_hz;
  const auto every = static_cast<std::size_t>(std::lround(1000.0 * step_s));  // truth is at 1 kHz
  for (std::size_t i = 0; i < truth.size(); i += every) {
    Vector3d error;
    const Kind* kind = receiver.at(truth[i].time_s, step_s, error);
    if (kind == nullptr) {
      continue;
    }
    Input input;
    input.is_fix = true;
    input.available_s = truth[i].time_s + sensors.latency_s;
    const Vector3d antenna = truth[i].T_map_base() * sensors.robot.antenna_position_base_m;
    input.fix = fix_at(antenna + error, truth[i].time_s, kind->reported_sigma_m);
    input.fix.status = kind->status;
    inputs.push_back(input);
  }
  std::stable_sort(inputs.begin(), inputs.end(), [](const Input& a, const Input& b) {
    return a.available_s < b.available_s;
  });
  return inputs;
}

}  // namespace trigpoint::gps_odometry
