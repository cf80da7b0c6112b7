// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "relief.hpp"
#include "shapes.hpp"
#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace trigpoint::simulator {

/// The ground sampled every metre and interpolated: a ray needs many heights.
class GroundGrid {
 public:
  GroundGrid(const Relief& relief,
             const Eigen::Vector2d& lowest_m,
             const Eigen::Vector2d& highest_m);

  double height_m(double east_m, double north_m) const;
  /// Shortens `hit` if the ground is nearer.
  void intersect(const Ray& ray, double max_range_m, Hit& hit) const;

 private:
  Relief relief_;
  Eigen::Vector2d lowest_m_;
  int columns_{0};
  int rows_{0};
  std::vector<float> heights_m_;
};

/// Ground and shapes, searched through a uniform grid of cells in plan view.
/// Reference: [1] J. Amanatides, A. Woo, "A fast voxel traversal algorithm", Eurographics 1987.
class World {
 public:
  /// The shapes; the ground reaches `margin_m` beyond the track (east, north).
  World(const Relief& relief,
        std::vector<Shape> shapes,
        const std::vector<Eigen::Vector2d>& track_m,
        double margin_m,
        double grass_height_m = 0.0);

  /// The nearest thing along the ray. Safe to call from several threads.
  Hit cast(const Ray& ray, double max_range_m) const;

  const std::vector<Shape>& shapes() const { return shapes_; }

  double ground_m(double east_m, double north_m) const { return ground_.height_m(east_m, north_m); }

 private:
  struct Cell {
    std::uint32_t first{0};
    std::uint32_t count{0};
    double top_m{0.0};  ///< nothing in the cell is higher
  };

  void build_cells();
  void intersect_shapes(const Ray& ray, double max_range_m, Hit& hit) const;
  void intersect_cell(const Cell& cell, const Ray& ray, double lowest_m, Hit& hit) const;

  /// Shortens a hit on the ground to the blade above it that stops the light.
  void stop_in_grass(const Ray& ray, Hit& hit) const;

  GroundGrid ground_;
  double grass_height_m_{0.0};
  std::vector<Shape> shapes_;
  Eigen::Vector2d lowest_m_{Eigen::Vector2d::Zero()};
  int columns_{0};
  int rows_{0};
  std::vector<Cell> cells_;
  std::vector<std::uint32_t> members_;
};

}  // namespace trigpoint::simulator
