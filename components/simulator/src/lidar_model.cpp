// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "lidar_model.hpp"

#include "trigpoint/base/so3.hpp"

#include "random.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <thread>

namespace trigpoint::simulator {

namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kFirstAzimuth_rad =
    std::numbers::pi;  ///< the cut is behind, and it turns clockwise
/// Returned signal (reflectivity * cosine / (range / 100 m)^2) at which half of the returns are
/// lost: asphalt is seen up to about 50 m, walls to the end of the range.
constexpr double kWeakSignal = 0.005;
constexpr double kIntensityScale = 255.0;
constexpr double kCoverReflectivity = 0.5;
constexpr double kMovingMargin_m = 3.0;  ///< what comes into reach during a sweep
constexpr std::uint64_t kSpoilKey = 0x6e616e;

std::vector<double> evenly(double lowest_deg, double highest_deg, int count) {
  std::vector<double> elevations;
  for (int i = 0; i < count; ++i) {
    elevations.push_back((lowest_deg + (highest_deg - lowest_deg) * i / (count - 1)) * kDegree);
  }
  return elevations;
}

/// Data sheet: 32 lower beams half a degree apart to -24.33, 32 upper a third apart to +2.
std::vector<double> hdl64_elevations() {
  std::vector<double> elevations = evenly(-24.33, -8.83, 32);
  const std::vector<double> upper = evenly(-8.33, 2.0, 32);
  elevations.insert(elevations.end(), upper.begin(), upper.end());
  return elevations;
}

}  // namespace

LidarModel lidar_model(const std::string& name) {
  if (name == "vlp16") {
    return {name, evenly(-15.0, 15.0, 16), 15 * 2.304e-6};
  }
  if (name == "hdl32") {
    return {name, evenly(-30.67, 10.67, 32), 31 * 1.152e-6};
  }
  if (name == "hdl64") {
    return {name, hdl64_elevations(), 46e-6};
  }
  throw std::invalid_argument("no LiDAR model is called '" + name + "'");
}

std::vector<std::string> lidar_model_names() {
  return {"vlp16", "hdl32", "hdl64"};
}

SpinningLidar::SpinningLidar(const LidarConfig& config,
                             const Pose& T_base_lidar,
                             std::uint64_t seed)
    : config_(config),
      model_(lidar_model(config.model)),
      T_base_lidar_(T_base_lidar),
      seed_(derive_seed(seed, kLidarSeed)) {
  for (std::int64_t firing = 0; firing < config_.azimuth_steps; ++firing) {
    for (std::size_t beam = 0; beam < model_.elevations_rad.size(); ++beam) {
      directions_.push_back(direction(firing, beam));
    }
  }
}

double SpinningLidar::firing_time_s(std::int64_t firing) const {
  return static_cast<double>(firing) /
         (static_cast<double>(config_.azimuth_steps) * config_.rate_hz);
}

double SpinningLidar::beam_delay_s(std::size_t beam) const {
  return model_.firing_s * static_cast<double>(beam) /
         static_cast<double>(model_.elevations_rad.size() - 1);
}

Eigen::Vector3d SpinningLidar::direction(std::int64_t firing, std::size_t beam) const {
  const double time_s = firing_time_s(firing) + beam_delay_s(beam);
  const double turned = 2.0 * std::numbers::pi * config_.rate_hz * time_s;
  const double azimuth = kFirstAzimuth_rad + (config_.counter_clockwise ? turned : -turned);
  const double elevation = model_.elevations_rad[beam];
  return {std::cos(elevation) * std::cos(azimuth),
          std::cos(elevation) * std::sin(azimuth),
          std::sin(elevation)};
}

Nanoseconds SpinningLidar::sweep_ns() const {
  return from_seconds(firing_time_s(config_.azimuth_steps - 1) + model_.firing_s);
}

SpinningLidar::Return SpinningLidar::measure(const Eigen::Vector3d& direction,
                                             const Ray& ray,
                                             const Scene& scene,
                                             const std::vector<MovingShape>& moving) const {
  Hit hit = scene.world.cast(ray, config_.max_range_m);
  std::optional<std::uint32_t> object;
  if (!moving.empty()) {
    object = intersect_moving(moving, ray, hit);
  }
  if (!hit.is_hit() || hit.range_m < config_.min_range_m || hit.range_m >= config_.max_range_m) {
    return {};
  }
  Random random(ray.key);
  const double signal = hit.reflectivity * hit.cos_incidence / std::pow(hit.range_m / 100.0, 2);
  const double seen =
      (1.0 - config_.dropout) * (1.0 - scene.sweep.dropout) * signal / (signal + kWeakSignal);
  if (!random.chance(seen)) {
    return {};
  }
  // A slanted spot smears the echo.
  const double tangent = std::sqrt(1.0 - hit.cos_incidence * hit.cos_incidence) / hit.cos_incidence;
  const double sigma_m = config_.range_sigma_m * std::min(2.0, 1.0 + 0.1 * tangent);
  const double range_m = hit.range_m + sigma_m * random.normal();
  const double intensity = kIntensityScale * hit.reflectivity * hit.cos_incidence;
  Return seen_return{(range_m * direction).cast<float>(),
                     static_cast<float>(std::round(intensity)),
                     true,
                     object,
                     {}};
  if (object) {
    seen_return.true_map_m = (ray.origin_m + hit.range_m * ray.direction).cast<float>();
  }
  return seen_return;
}

SpinningLidar::Return SpinningLidar::on_cover(const Eigen::Vector3d& direction,
                                              const Ray& ray,
                                              double cover_m) const {
  Random random(ray.key);
  const double range_m = cover_m + config_.range_sigma_m * random.normal();
  return {(range_m * direction).cast<float>(),
          static_cast<float>(kIntensityScale * kCoverReflectivity),
          true,
          std::nullopt,
          {}};
}

void SpinningLidar::scan_firings(std::int64_t first,
                                 std::int64_t last,
                                 const Scene& scene,
                                 std::vector<Return>& returns) const {
  const std::size_t beams = model_.elevations_rad.size();
  const std::uint64_t key = derive_seed(seed_, static_cast<std::uint64_t>(scene.sweep.stamp_ns));
  const double start_s = to_seconds(scene.sweep.stamp_ns - scene.drive.first_ns());
  std::vector<MovingShape> moving;
  for (std::int64_t firing = first; firing < last; ++firing) {
    const double t_s = start_s + firing_time_s(firing);
    const TrueState state = scene.drive.at_time(t_s);
    const Eigen::Matrix3d R = state.T_map_base.q.toRotationMatrix();
    moving.clear();
    if (!scene.near.empty()) {
      scene.traffic->place(scene.near, t_s, moving);
    }
    for (std::size_t beam = 0; beam < beams; ++beam) {
      const std::size_t index = static_cast<std::size_t>(firing) * beams + beam;
      // Within one firing (less than 50 us) the motion is a constant twist to below a micrometre.
      const double dt = beam_delay_s(beam);
      const auto turn = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d {
        return R * (v + dt * state.omega_base_radps.cross(v));
      };
      const Ray ray{state.T_map_base.p + dt * state.v_map_mps + turn(T_base_lidar_.p),
                    turn(T_base_lidar_.q * directions_[index]).normalized(),
                    derive_seed(key, index)};
      returns[index] = scene.sweep.cover_m ? on_cover(directions_[index], ray, *scene.sweep.cover_m)
                                           : measure(directions_[index], ray, scene, moving);
    }
  }
}

SpinningLidar::Scene SpinningLidar::scene_of(const SweepEpoch& sweep,
                                             const Drive& drive,
                                             const World& world,
                                             const Traffic* traffic) const {
  Scene scene{sweep, drive, world, traffic, {}};
  if (traffic != nullptr) {
    const double t_s = to_seconds(sweep.stamp_ns - drive.first_ns()) + 0.5 / config_.rate_hz;
    scene.near = traffic->near(
        drive.at_time(t_s).T_map_base.p.head<2>(), config_.max_range_m + kMovingMargin_m, t_s);
  }
  return scene;
}

PointCloudMessage SpinningLidar::scan(const SweepEpoch& sweep,
                                      const Drive& drive,
                                      const World& world,
                                      const Traffic* traffic,
                                      MovingSweep* moving) const {
  std::vector<Return> returns(directions_.size());
  if (!sweep.blank) {
    const Scene scene = scene_of(sweep, drive, world, traffic);
    const std::int64_t threads = std::max<std::int64_t>(1, config_.threads);
    std::vector<std::jthread> workers;
    for (std::int64_t i = 1; i < threads; ++i) {
      workers.emplace_back([&, i] {
        scan_firings(config_.azimuth_steps * i / threads,
                     config_.azimuth_steps * (i + 1) / threads,
                     scene,
                     returns);
      });
    }
    scan_firings(0, config_.azimuth_steps / threads, scene, returns);
  }
  spoil(sweep, returns);
  return pack(returns, sweep, moving);
}

void SpinningLidar::spoil(const SweepEpoch& sweep, std::vector<Return>& returns) const {
  if (!sweep.only_ring && sweep.nan_share <= 0.0) {
    return;
  }
  const std::size_t beams = model_.elevations_rad.size();
  Random random(
      derive_seed(derive_seed(seed_, kSpoilKey), static_cast<std::uint64_t>(sweep.stamp_ns)));
  for (std::size_t i = 0; i < returns.size(); ++i) {
    returns[i].seen = returns[i].seen && (!sweep.only_ring || i % beams == *sweep.only_ring);
    if (random.chance(sweep.nan_share)) {
      returns[i].point_m.setConstant(std::numeric_limits<float>::quiet_NaN());
    }
  }
}

PointCloudMessage SpinningLidar::pack(const std::vector<Return>& returns,
                                      const SweepEpoch& sweep,
                                      MovingSweep* moving) const {
  const std::size_t beams = model_.elevations_rad.size();
  std::vector<CloudPoint> points;
  points.reserve(returns.size());
  if (moving != nullptr) {
    *moving = {sweep.stamp_ns + sweep.stamp_shift_ns, {}};
  }
  for (std::size_t i = 0; i < returns.size(); ++i) {
    const Return& seen = returns[i];
    if (!seen.seen) {
      continue;
    }
    if (seen.object && moving != nullptr) {
      moving->points.push_back({static_cast<std::uint32_t>(points.size()),
                                *seen.object,
                                seen.true_map_m.cast<double>()});
    }
    points.push_back(
        {seen.point_m,
         seen.intensity,
         static_cast<std::uint16_t>(i % beams),
         firing_time_s(static_cast<std::int64_t>(i / beams)) + beam_delay_s(i % beams)});
  }
  PointCloudMessage message =
      pack_cloud(config_.layout, sweep.stamp_ns + sweep.stamp_shift_ns, points);
  message.is_dense = sweep.nan_share <= 0.0;
  return message;
}

}  // namespace trigpoint::simulator
