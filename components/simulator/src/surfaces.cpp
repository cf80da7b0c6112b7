// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/surfaces.hpp"

#include "drive.hpp"
#include "path.hpp"
#include "relief.hpp"
#include "route.hpp"
#include "shape_distance.hpp"
#include "town.hpp"
#include "world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

namespace trigpoint::simulator {

namespace {

constexpr double kSurfaceCell_m = 4.0;
/// A point of a crown or of grass that the estimate or the map's cells moved a little.
constexpr double kLeavesMargin_m = 0.2;
/// For the slope of the ground, which is flat over less.
constexpr double kSlopeStep_m = 0.25;

using Cell = std::array<std::int32_t, 2>;

Cell cell_of(double east_m, double north_m) {
  return {static_cast<std::int32_t>(std::floor(east_m / kSurfaceCell_m)),
          static_cast<std::int32_t>(std::floor(north_m / kSurfaceCell_m))};
}

World world_of(const Scenario& scenario, std::uint64_t seed) {
  const Relief relief(scenario.world, seed);
  const Drive drive(scenario, relief, seed, scenario.duration_s);
  const Path path(scenario.route->points());
  return {relief,
          build_town(scenario.world, path, relief, seed),
          drive.track(1.0),
          scenario.lidar.max_range_m + 10.0,
          scenario.world.grass_height_m};
}

}  // namespace

struct Surfaces::Impl {
  World world;
  double grass_height_m;
  std::map<Cell, std::vector<std::uint32_t>> near;  ///< shapes that reach a cell, or nearly

  Impl(const Scenario& scenario, std::uint64_t seed)
      : world(world_of(scenario, seed)), grass_height_m(scenario.world.grass_height_m) {
    for (std::uint32_t i = 0; i < world.shapes().size(); ++i) {
      const Shape& shape = world.shapes()[i];
      const Eigen::Vector3d reach = shape.half_extent_m().array() + kFarthest_m;
      const Cell low = cell_of(shape.centre_m.x() - reach.x(), shape.centre_m.y() - reach.y());
      const Cell high = cell_of(shape.centre_m.x() + reach.x(), shape.centre_m.y() + reach.y());
      for (std::int32_t east = low[0]; east <= high[0]; ++east) {
        for (std::int32_t north = low[1]; north <= high[1]; ++north) {
          near[{east, north}].push_back(i);
        }
      }
    }
  }

  /// Across the slope; above it positive.
  double above_ground_m(const Eigen::Vector3d& p_m) const {
    const auto height = [&](double east, double north) {
      return world.ground_m(p_m.x() + east, p_m.y() + north);
    };
    const double slope_east =
        (height(kSlopeStep_m, 0.0) - height(-kSlopeStep_m, 0.0)) / (2.0 * kSlopeStep_m);
    const double slope_north =
        (height(0.0, kSlopeStep_m) - height(0.0, -kSlopeStep_m)) / (2.0 * kSlopeStep_m);
    return (p_m.z() - height(0.0, 0.0)) /
           std::sqrt(1.0 + slope_east * slope_east + slope_north * slope_north);
  }
};

Surfaces::Surfaces(const Scenario& scenario, std::uint64_t seed)
    : impl_(std::make_unique<Impl>(scenario, seed)) {}

Surfaces::~Surfaces() = default;

std::optional<double> Surfaces::distance_m(const Eigen::Vector3d& p_map_m) const {
  const double above_m = impl_->above_ground_m(p_map_m);
  double nearest_m = std::min(std::abs(above_m), kFarthest_m);
  bool in_leaves = impl_->grass_height_m > 0.0 && above_m > 0.0 &&
                   above_m < impl_->grass_height_m + kLeavesMargin_m;
  const auto cell = impl_->near.find(cell_of(p_map_m.x(), p_map_m.y()));
  if (cell != impl_->near.end()) {
    for (const std::uint32_t i : cell->second) {
      const Shape& shape = impl_->world.shapes()[i];
      if (shape.kind == Shape::Kind::kFoliage) {
        in_leaves = in_leaves || is_in_leaves(shape, p_map_m, kLeavesMargin_m);
      } else {
        nearest_m = std::min(nearest_m, surface_distance_m(shape, p_map_m));
      }
    }
  }
  return in_leaves ? std::nullopt : std::optional(nearest_m);
}

}  // namespace trigpoint::simulator
