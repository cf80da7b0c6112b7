// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// People and cars that move while the robot drives.
#pragma once

#include "trigpoint/simulator/scenario.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "drive.hpp"
#include "footprint.hpp"
#include "path.hpp"
#include "relief.hpp"
#include "shapes.hpp"
#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <vector>

namespace trigpoint::simulator {

/// One shape of a moving object where it is at one moment.
struct MovingShape {
  Shape shape;
  double radius_m{0.0};  ///< of a circle in plan view that holds it
  std::uint32_t object{0};
};

/// Each object goes to and fro at a constant speed: along the route at a constant distance from its
/// middle, or straight across it. So where it is at a moment is known in closed form. None comes
/// nearer to the robot's middle than kClearance_m; those that would are drawn anew.
class Traffic {
 public:
  static constexpr double kClearance_m = 1.1;

  Traffic(const Scenario& scenario, const Relief& relief, const Drive& drive, std::uint64_t seed);

  bool empty() const { return objects_.empty(); }

  std::size_t size() const { return objects_.size(); }

  bool is_car(std::size_t object) const { return objects_[object].kind == Kind::kCar; }

  /// Where the object stands `t_s` after the scenario's start.
  Footprint footprint(std::size_t object, double t_s) const;

  /// Height of the ground under it.
  double ground_m(std::size_t object, double t_s) const;

  /// Those with a part within `reach_m` of a place in plan view.
  std::vector<std::uint32_t> near(const Eigen::Vector2d& place_m, double reach_m, double t_s) const;

  /// The shapes of these objects, appended.
  void place(const std::vector<std::uint32_t>& objects,
             double t_s,
             std::vector<MovingShape>& shapes) const;

 private:
  enum class Kind : std::uint8_t { kWalker, kCrossing, kCar };

  struct Object {
    Kind kind{Kind::kWalker};
    double from_m{0.0};    ///< start of its stretch: along the route, or across it
    double length_m{1.0};  ///< of the stretch
    double phase_m{0.0};   ///< way done at t = 0, out and back counted together
    double speed_mps{1.0};
    double beside_m{0.0};  ///< left of the route's middle; kCrossing: place along the route
    Eigen::Vector2d half_m{Eigen::Vector2d::Zero()};
    double height_m{1.7};
    double reflectivity{0.4};
  };

  Object draw(Kind kind, double road_half_width_m, class Random& random) const;
  Footprint footprint(const Object& object, double t_s) const;
  bool keeps_clear(const Object& object, const std::vector<Eigen::Vector2d>& robot_m) const;
  void add(Kind kind,
           std::int64_t count,
           double road_half_width_m,
           const std::vector<Eigen::Vector2d>& robot_m,
           class Random& random);

  Path path_;
  Relief relief_;
  std::vector<Object> objects_;
};

/// Shortens `hit` where a moving shape is nearer, and says whose it is.
std::optional<std::uint32_t> intersect_moving(const std::vector<MovingShape>& shapes,
                                              const Ray& ray,
                                              Hit& hit);

/// Writes where every object is, ten times a second: stamp, object, kind, middle of its footprint
/// on the ground in map, yaw, length, width and height.
void write_moving_objects(const Traffic& traffic, const Truth& truth, const std::string& path);

}  // namespace trigpoint::simulator
