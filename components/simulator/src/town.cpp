// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "town.hpp"

#include "footprint.hpp"
#include "random.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace trigpoint::simulator {

namespace {

constexpr double kBelowGround_m =
    3.0;  ///< foundations, so that no light passes under a wall on a slope
constexpr double kWall_m = 0.3;
constexpr double kFloor_m = 3.2;
constexpr double kCrownClearance_m = 0.9;  ///< from the route to leaves off it

class Builder {
 public:
  Builder(const WorldConfig& config, const Path& path, const Relief& relief, std::uint64_t seed)
      : config_(config),
        path_(path),
        relief_(relief),
        random_(derive_seed(seed, kWorldSeed + 100)) {
    for (double s_m = 0.0; s_m <= path.length_m(); s_m += 1.0) {
      track_m_.push_back(path.at(s_m).position_m);
    }
  }

  std::vector<Shape> build() {
    for (const HallConfig& hall : config_.halls) {
      build_hall(hall);
    }
    for (const TunnelConfig& tunnel : config_.tunnels) {
      build_tunnel(tunnel);
    }
    for (const ClearingConfig& c : config_.clearings) {
      taken_.push_back(
          {{c.centre_east_m, c.centre_north_m}, {0.5 * c.length_m, 0.5 * c.width_m}, c.yaw_rad});
    }
    along_route(config_.building_spacing_m,
                [this](const Path::Place& place, double side) { try_building(place, side); });
    along_route(config_.car_spacing_m,
                [this](const Path::Place& place, double side) { try_car(place, side); });
    along_route(config_.pole_spacing_m,
                [this](const Path::Place& place, double side) { try_pole(place, side); });
    along_route(config_.tree_spacing_m,
                [this](const Path::Place& place, double side) { try_tree(place, side); });
    scatter(config_.wood_spacing_m, [this](const Eigen::Vector2d& at) { try_wood_tree(at); });
    scatter(config_.bush_spacing_m, [this](const Eigen::Vector2d& at) { try_bush(at); });
    return std::move(shapes_);
  }

 private:
  template <typename Try>
  void along_route(double spacing_m, const Try& attempt) {
    if (spacing_m <= 0.0) {
      return;
    }
    for (const double side : {-1.0, 1.0}) {
      double s_m = random_.uniform(-20.0, spacing_m - 20.0);
      for (; s_m < path_.length_m() + 20.0; s_m += spacing_m * random_.uniform(0.8, 1.2)) {
        attempt(path_.at(s_m), side);
      }
    }
  }

  /// A place in every square of a grid that has the route within reach.
  template <typename Try>
  void scatter(double spacing_m, const Try& attempt) {
    if (spacing_m <= 0.0) {
      return;
    }
    Eigen::Vector2d lowest = track_m_.front();
    Eigen::Vector2d highest = lowest;
    for (const Eigen::Vector2d& p : track_m_) {
      lowest = lowest.cwiseMin(p);
      highest = highest.cwiseMax(p);
    }
    const double reach_m = config_.scatter_reach_m;
    for (double east = lowest.x() - reach_m; east < highest.x() + reach_m; east += spacing_m) {
      for (double north = lowest.y() - reach_m; north < highest.y() + reach_m; north += spacing_m) {
        const double u = random_.uniform(0.0, spacing_m);
        const Eigen::Vector2d at(east + u, north + random_.uniform(0.0, spacing_m));
        if (distance_to_route_m(at) < reach_m) {
          attempt(at);
        }
      }
    }
  }

  double distance_to_route_m(const Eigen::Vector2d& at) const {
    double square = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& p : track_m_) {
      square = std::min(square, (p - at).squaredNorm());
    }
    return std::sqrt(square);
  }

  double ground_m(const Eigen::Vector2d& at) const { return relief_.height_m(at.x(), at.y()); }

  static Eigen::Vector2d beside(const Path::Place& place, double side, double distance_m) {
    return place.position_m +
           side * distance_m *
               Eigen::Vector2d(-std::sin(place.heading_rad), std::cos(place.heading_rad));
  }

  /// Whether the footprint keeps `clearance_m` from the route and touches nothing that stands
  /// there.
  bool claim(const Footprint& footprint, double clearance_m) {
    for (const Eigen::Vector2d& p : track_m_) {
      if (footprint.distance_m(p) < clearance_m) {
        return false;
      }
    }
    for (const Footprint& other : taken_) {
      if (other.overlaps(footprint)) {
        return false;
      }
    }
    taken_.push_back(footprint);
    return true;
  }

  /// A box with its bottom and top in metres above map's zero.
  void add_box(const Footprint& footprint, double bottom_m, double top_m, double reflectivity) {
    Shape box;
    box.centre_m << footprint.centre_m, 0.5 * (bottom_m + top_m);
    box.half_m << footprint.half_m, 0.5 * (top_m - bottom_m);
    box.cos_yaw = std::cos(footprint.yaw_rad);
    box.sin_yaw = std::sin(footprint.yaw_rad);
    box.reflectivity = reflectivity;
    shapes_.push_back(box);
  }

  /// A box inside `frame`, given along its axes.
  void add_part(const Footprint& frame,
                const Eigen::Vector2d& centre,
                const Eigen::Vector2d& half,
                double bottom_m,
                double top_m,
                double reflectivity) {
    add_box(
        {frame.to_map(centre.x(), centre.y()), half, frame.yaw_rad}, bottom_m, top_m, reflectivity);
  }

  void add_cylinder(const Eigen::Vector2d& at,
                    double radius_m,
                    double height_m,
                    double reflectivity) {
    Shape cylinder;
    cylinder.kind = Shape::Kind::kCylinder;
    const double bottom_m = ground_m(at) - 0.5;
    cylinder.centre_m << at, bottom_m + 0.5 * (height_m + 0.5);
    cylinder.half_m << radius_m, radius_m, 0.5 * (height_m + 0.5);
    cylinder.reflectivity = reflectivity;
    shapes_.push_back(cylinder);
  }

  void try_building(const Path::Place& place, double side) {
    Footprint house;
    house.half_m = {random_.uniform(5.0, 10.0), random_.uniform(4.0, 6.5)};
    house.yaw_rad = place.heading_rad + random_.uniform(-0.06, 0.06);
    house.centre_m = beside(
        place, side, config_.building_distance_m + random_.uniform(0.0, 3.0) + house.half_m.y());
    const double height_m = config_.building_height_m * random_.uniform(0.6, 1.4);
    const double reflectivity = random_.uniform(0.3, 0.7);
    const bool setback = random_.chance(0.4);
    const bool ledges = random_.chance(0.5);
    const double bay_m = random_.uniform(-0.6, 0.6);
    // Ledges and bays stand out by up to 1.2 m.
    if (!claim(house, config_.road_half_width_m + 1.5)) {
      return;
    }
    const double ground = ground_m(house.centre_m);
    const double bottom = ground - kBelowGround_m;
    const double eaves = setback ? 0.55 * height_m : height_m;
    add_box(house, bottom, ground + eaves, reflectivity);
    if (setback) {
      add_part(house,
               {0.0, 0.0},
               house.half_m - Eigen::Vector2d(1.5, 1.5),
               bottom,
               ground + height_m,
               reflectivity);
    }
    const double front = -side * house.half_m.y();
    if (ledges) {
      for (double z = kFloor_m; z < eaves; z += kFloor_m) {
        add_part(house,
                 {0.0, front},
                 {house.half_m.x() - 0.5, 0.5},
                 ground + z - 0.15,
                 ground + z + 0.15,
                 reflectivity);
      }
    }
    add_part(house,
             {bay_m * house.half_m.x(), front},
             {1.6, 1.0},
             bottom,
             ground + 0.5 * eaves,
             reflectivity);
  }

  void try_car(const Path::Place& place, double side) {
    Footprint car;
    car.half_m = {random_.uniform(2.0, 2.4), random_.uniform(0.85, 0.95)};
    car.yaw_rad = place.heading_rad + random_.uniform(-0.05, 0.05);
    car.centre_m =
        beside(place, side, config_.road_half_width_m + car.half_m.y() + random_.uniform(0.1, 0.5));
    const double reflectivity = random_.uniform(0.2, 0.9);
    if (!claim(car, 0.9 * config_.road_half_width_m)) {
      return;
    }
    const double ground = ground_m(car.centre_m);
    add_box(car, ground + 0.22, ground + 0.95, reflectivity);
    add_part(car, {-0.2, 0.0}, {0.5 * car.half_m.x(), 0.8}, ground + 0.95, ground + 1.5, 0.3);
    for (const double x : {-0.6, 0.6}) {
      add_part(car, {x * car.half_m.x(), 0.0}, {0.32, 0.85}, ground - 0.1, ground + 0.6, 0.1);
    }
  }

  void try_pole(const Path::Place& place, double side) {
    const double radius_m = random_.uniform(0.06, 0.16);
    const double height_m = random_.uniform(3.0, 8.0);
    const Eigen::Vector2d at =
        beside(place, side, config_.road_half_width_m + random_.uniform(0.6, 1.4));
    if (claim({at, Eigen::Vector2d::Constant(radius_m), 0.0}, config_.road_half_width_m)) {
      add_cylinder(at, radius_m, height_m, 0.5);
    }
  }

  void try_tree(const Path::Place& place, double side) {
    const double radius_m = random_.uniform(0.12, 0.3);
    const double crown_m = random_.uniform(1.4, 2.6);
    const double trunk_m = random_.uniform(2.2, 3.4);
    const double tall_m = random_.uniform(1.4, 2.6);
    const double free_path_m = random_.uniform(0.6, 1.8);
    const Eigen::Vector2d at =
        beside(place, side, config_.road_half_width_m + random_.uniform(1.0, 5.0));
    if (!claim({at, Eigen::Vector2d::Constant(0.6 * crown_m), 0.0},
               std::max(config_.road_half_width_m - 0.6 * crown_m, 0.4 * crown_m + 0.8))) {
      return;
    }
    add_cylinder(at, radius_m, trunk_m + 0.3 * tall_m, 0.35);
    Shape crown;
    crown.kind = Shape::Kind::kFoliage;
    crown.centre_m << at, ground_m(at) + trunk_m + 0.7 * tall_m;
    crown.half_m << crown_m, crown_m, tall_m;
    crown.reflectivity = 0.45;
    crown.free_path_m = free_path_m;
    shapes_.push_back(crown);
  }

  void add_leaves(const Eigen::Vector3d& centre_m,
                  const Eigen::Vector3d& half_m,
                  double free_path_m) {
    Shape leaves;
    leaves.kind = Shape::Kind::kFoliage;
    leaves.centre_m = centre_m;
    leaves.half_m = half_m;
    leaves.reflectivity = 0.45;
    leaves.free_path_m = free_path_m;
    shapes_.push_back(leaves);
  }

  /// A trunk that leans on nothing and a crown of several clumps of leaves with light between them.
  void try_wood_tree(const Eigen::Vector2d& at) {
    const double crown_m = random_.uniform(1.4, 2.6);
    const double trunk_m = random_.uniform(2.4, 4.0);
    const double radius_m = random_.uniform(0.1, 0.3);
    const double foot_m = 0.3 * crown_m;
    if (!claim({at, Eigen::Vector2d::Constant(foot_m), 0.0},
               std::max(config_.road_half_width_m, crown_m + kCrownClearance_m))) {
      return;
    }
    const double ground = ground_m(at);
    add_cylinder(at, radius_m, trunk_m + 0.8 * crown_m, 0.35);
    const int clumps = 3 + static_cast<int>(random_.uniform(0.0, 3.0));
    for (int i = 0; i < clumps; ++i) {
      const double clump_m = random_.uniform(0.35, 0.6) * crown_m;
      const Eigen::Vector3d off = random_.level_vector(0.0, crown_m - clump_m);
      const double up_m = trunk_m + random_.uniform(0.0, 1.4) * crown_m;
      add_leaves(Eigen::Vector3d(at.x(), at.y(), ground + up_m) + off,
                 {clump_m, clump_m, 0.8 * clump_m},
                 random_.uniform(0.4, 1.2));
    }
  }

  void try_bush(const Eigen::Vector2d& at) {
    const double radius_m = random_.uniform(0.5, 1.3);
    const double height_m = random_.uniform(0.7, 1.8);
    if (claim({at, Eigen::Vector2d::Constant(0.7 * radius_m), 0.0},
              std::max(config_.road_half_width_m, radius_m + kCrownClearance_m))) {
      add_leaves({at.x(), at.y(), ground_m(at) + 0.4 * height_m},
                 {radius_m, radius_m, 0.6 * height_m},
                 random_.uniform(0.2, 0.5));
    }
  }

  /// Nothing in it but walls, and a roof if it has one.
  void build_tunnel(const TunnelConfig& tunnel) {
    const Footprint frame{{tunnel.centre_east_m, tunnel.centre_north_m},
                          {0.5 * tunnel.length_m, 0.5 * tunnel.width_m + 2.0 * kWall_m},
                          tunnel.yaw_rad};
    taken_.push_back(frame);
    const double ground = ground_m(frame.centre_m);
    const double top = ground + tunnel.height_m;
    for (const double side : {-1.0, 1.0}) {
      add_part(frame,
               {0.0, side * (0.5 * tunnel.width_m + kWall_m)},
               {frame.half_m.x(), kWall_m},
               ground - kBelowGround_m,
               top,
               0.4);
    }
    if (tunnel.roof) {
      add_box(frame, top, top + kWall_m, 0.4);
    }
  }

  void build_hall(const HallConfig& hall) {
    const Footprint frame{{hall.centre_east_m, hall.centre_north_m},
                          {0.5 * hall.length_m, 0.5 * hall.width_m},
                          hall.yaw_rad};
    taken_.push_back(frame);
    const double ground = ground_m(frame.centre_m);
    const double bottom = ground - kBelowGround_m;
    const double top = ground + hall.height_m;
    add_box(frame, top, top + kWall_m, 0.4);
    for (const double side : {-1.0, 1.0}) {
      add_part(
          frame, {0.0, side * frame.half_m.y()}, {frame.half_m.x(), kWall_m}, bottom, top, 0.5);
      add_hall_end(hall, frame, side, ground);
    }
    furnish_hall(frame, ground, top);
  }

  /// The end wall with its door.
  void add_hall_end(const HallConfig& hall, const Footprint& frame, double end, double ground) {
    const double x = end * frame.half_m.x();
    const double leaf = 0.25 * (hall.width_m - hall.door_width_m);
    for (const double side : {-1.0, 1.0}) {
      add_part(frame,
               {x, side * (0.5 * hall.door_width_m + leaf)},
               {kWall_m, leaf},
               ground - kBelowGround_m,
               ground + hall.height_m,
               0.5);
    }
    add_part(frame,
             {x, 0.0},
             {kWall_m, 0.5 * hall.door_width_m},
             ground_m(frame.to_map(x, 0.0)) + hall.door_height_m,
             ground + hall.height_m,
             0.5);
  }

  void furnish_hall(const Footprint& frame, double ground, double top) {
    const double aisle = frame.half_m.y() - 1.2;
    for (double x = -frame.half_m.x() + 5.0; x < frame.half_m.x() - 3.0; x += 6.0) {
      for (const double side : {-1.0, 1.0}) {
        add_part(frame, {x, side * aisle}, {0.2, 0.2}, ground - 1.0, top, 0.5);
        if (random_.chance(0.6)) {
          const Eigen::Vector2d half(random_.uniform(0.4, 1.2), random_.uniform(0.3, 0.6));
          add_part(frame,
                   {x + 2.5, side * aisle},
                   half,
                   ground - 1.0,
                   ground + random_.uniform(0.8, 2.5),
                   random_.uniform(0.3, 0.8));
        }
      }
      add_part(
          frame, {x, 0.0}, {0.15, frame.half_m.y()}, top - 0.6, top, 0.5);  // a beam under the roof
    }
  }

  const WorldConfig& config_;
  const Path& path_;
  const Relief& relief_;
  Random random_;
  std::vector<Eigen::Vector2d> track_m_;
  std::vector<Footprint> taken_;
  std::vector<Shape> shapes_;
};

}  // namespace

std::vector<Shape> build_town(const WorldConfig& config,
                              const Path& path,
                              const Relief& relief,
                              std::uint64_t seed) {
  return Builder(config, path, relief, seed).build();
}

}  // namespace trigpoint::simulator
