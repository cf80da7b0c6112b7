// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/simulator/scenario.hpp"

#include "cloud_layout.hpp"
#include "drive.hpp"
#include "fault.hpp"
#include "traffic.hpp"
#include "world.hpp"
#include <Eigen/Core>

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::simulator {

/// A spinning scanner: its beams, ring 0 lowest, and the delay of each within a firing.
struct LidarModel {
  std::string name;
  std::vector<double> elevations_rad;
  double firing_s;  ///< time between the first and the last beam of one firing
};

/// Throws std::invalid_argument for a name that is not in lidar_model_names().
LidarModel lidar_model(const std::string& name);
std::vector<std::string> lidar_model_names();

/// Casts every ray from where the scanner truly is at the moment of its firing.
class SpinningLidar {
 public:
  SpinningLidar(const LidarConfig& config, const Pose& T_base_lidar, std::uint64_t seed);

  /// One revolution from `sweep.stamp_ns` (the first firing) on, in the scanner's frame at each
  /// point's own time; fields as of the configured layout. Same bits for any number of threads.
  /// `traffic` may be null; `moving` too, else it receives which points lie on moving objects.
  PointCloudMessage scan(const SweepEpoch& sweep,
                         const Drive& drive,
                         const World& world,
                         const Traffic* traffic = nullptr,
                         MovingSweep* moving = nullptr) const;

  /// From the first firing to the last point.
  Nanoseconds sweep_ns() const;

 private:
  struct Return {
    Eigen::Vector3f point_m;
    float intensity{0.0F};
    bool seen{false};
    std::optional<std::uint32_t> object;  ///< the moving one that it is from
    Eigen::Vector3f true_map_m;           ///< where the ray met it; only with an object
  };

  /// What the rays of one sweep may meet.
  struct Scene {
    const SweepEpoch& sweep;
    const Drive& drive;
    const World& world;
    const Traffic* traffic{nullptr};
    std::vector<std::uint32_t> near;  ///< moving objects within reach during the sweep
  };

  void scan_firings(std::int64_t first,
                    std::int64_t last,
                    const Scene& scene,
                    std::vector<Return>& returns) const;
  Return measure(const Eigen::Vector3d& direction,
                 const Ray& ray,
                 const Scene& scene,
                 const std::vector<MovingShape>& moving) const;
  Return on_cover(const Eigen::Vector3d& direction, const Ray& ray, double cover_m) const;
  Scene scene_of(const SweepEpoch& sweep,
                 const Drive& drive,
                 const World& world,
                 const Traffic* traffic) const;
  /// What the faults leave of the returns.
  void spoil(const SweepEpoch& sweep, std::vector<Return>& returns) const;
  double firing_time_s(std::int64_t firing) const;
  double beam_delay_s(std::size_t beam) const;
  Eigen::Vector3d direction(std::int64_t firing, std::size_t beam) const;
  PointCloudMessage pack(const std::vector<Return>& returns,
                         const SweepEpoch& sweep,
                         MovingSweep* moving) const;

  LidarConfig config_;
  LidarModel model_;
  Pose T_base_lidar_;
  std::uint64_t seed_;
  std::vector<Eigen::Vector3d> directions_;  ///< firing-major, in the scanner's frame
};

}  // namespace trigpoint::simulator
