// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "traffic.hpp"

#include "random.hpp"
#include "route.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <stdexcept>

namespace trigpoint::simulator {

namespace {

constexpr double kTrackStep_s = 0.1;
constexpr int kDraws = 50;  ///< before an object is given up
constexpr double kWalkerHalf_m = 0.25;
constexpr double kWalkerHeight_m = 1.7;
constexpr double kCarHeight_m = 1.5;
constexpr double kBonnet_m = 0.95;
constexpr double kCarClearance_m = 0.2;  ///< under the car

/// Out and back along a stretch: where, and whether on the way back.
struct ToAndFro {
  ToAndFro(double way_m, double length_m) {
    const double round_m = std::fmod(way_m, 2.0 * length_m);
    back = round_m > length_m;
    at_m = back ? 2.0 * length_m - round_m : round_m;
  }

  double at_m{0.0};
  bool back{false};
};

MovingShape box(const Footprint& foot,
                const Eigen::Vector2d& half_m,
                double bottom_m,
                double top_m,
                double reflectivity,
                std::uint32_t object) {
  MovingShape moving;
  moving.shape.centre_m << foot.centre_m, 0.5 * (bottom_m + top_m);
  moving.shape.half_m << half_m, 0.5 * (top_m - bottom_m);
  moving.shape.cos_yaw = std::cos(foot.yaw_rad);
  moving.shape.sin_yaw = std::sin(foot.yaw_rad);
  moving.shape.reflectivity = reflectivity;
  moving.radius_m = half_m.norm();
  moving.object = object;
  return moving;
}

}  // namespace

Traffic::Traffic(const Scenario& scenario,
                 const Relief& relief,
                 const Drive& drive,
                 std::uint64_t seed)
    : path_(scenario.route->points()), relief_(relief) {
  const TrafficConfig& config = scenario.traffic;
  const std::vector<Eigen::Vector2d> robot_m = drive.track(kTrackStep_s);
  const double half_width_m = scenario.world.road_half_width_m;
  Random random(derive_seed(seed, kTrafficSeed));
  add(Kind::kWalker, config.walkers, half_width_m, robot_m, random);
  add(Kind::kCrossing, config.crossing, half_width_m, robot_m, random);
  add(Kind::kCar, config.cars, half_width_m, robot_m, random);
}

void Traffic::add(Kind kind,
                  std::int64_t count,
                  double road_half_width_m,
                  const std::vector<Eigen::Vector2d>& robot_m,
                  Random& random) {
  for (std::int64_t i = 0; i < count; ++i) {
    for (int attempt = 0; attempt < kDraws; ++attempt) {
      const Object object = draw(kind, road_half_width_m, random);
      if (keeps_clear(object, robot_m)) {
        objects_.push_back(object);
        break;
      }
    }
  }
}

Traffic::Object Traffic::draw(Kind kind, double road_half_width_m, Random& random) const {
  Object object;
  object.kind = kind;
  const double side = random.chance(0.5) ? 1.0 : -1.0;
  const double kerb_m = road_half_width_m - 0.8;
  object.reflectivity = random.uniform(0.2, 0.7);
  object.half_m.setConstant(kWalkerHalf_m);
  object.height_m = kWalkerHeight_m;
  object.speed_mps = random.uniform(0.7, 1.8);
  switch (kind) {
    case Kind::kWalker:
      object.length_m = std::min(path_.length_m(), random.uniform(20.0, 80.0));
      object.from_m = random.uniform(0.0, path_.length_m() - object.length_m);
      object.beside_m = side * (kerb_m + random.uniform(-0.3, 0.3));
      break;
    case Kind::kCrossing:
      object.length_m = 2.0 * kerb_m;
      object.from_m = -kerb_m;
      object.beside_m = random.uniform(0.0, path_.length_m());
      break;
    case Kind::kCar:
      object.length_m = path_.length_m();
      object.half_m = {random.uniform(2.0, 2.3), random.uniform(0.85, 0.95)};
      object.height_m = kCarHeight_m;
      object.beside_m = side * (Traffic::kClearance_m + 0.3 + object.half_m.y());
      object.speed_mps = random.uniform(3.0, 8.0);
      break;
  }
  object.phase_m = random.uniform(0.0, 2.0 * object.length_m);
  return object;
}

Footprint Traffic::footprint(const Object& object, double t_s) const {
  const ToAndFro way(object.phase_m + object.speed_mps * t_s, object.length_m);
  const double at_m = object.from_m + way.at_m;
  const bool crossing = object.kind == Kind::kCrossing;
  const Path::Place place = path_.at(crossing ? object.beside_m : at_m);
  const double beside_m = crossing ? at_m : object.beside_m;
  Footprint foot;
  foot.centre_m = place.position_m + beside_m * Eigen::Vector2d(-std::sin(place.heading_rad),
                                                                std::cos(place.heading_rad));
  foot.half_m = object.half_m;
  foot.yaw_rad = place.heading_rad + (crossing ? 0.5 * std::numbers::pi : 0.0) +
                 (way.back ? std::numbers::pi : 0.0);
  return foot;
}

Footprint Traffic::footprint(std::size_t object, double t_s) const {
  return footprint(objects_[object], t_s);
}

double Traffic::ground_m(std::size_t object, double t_s) const {
  const Eigen::Vector2d at = footprint(object, t_s).centre_m;
  return relief_.height_m(at.x(), at.y());
}

bool Traffic::keeps_clear(const Object& object, const std::vector<Eigen::Vector2d>& robot_m) const {
  for (std::size_t i = 0; i < robot_m.size(); ++i) {
    const double t_s = kTrackStep_s * static_cast<double>(i);
    if (footprint(object, t_s).distance_m(robot_m[i]) < kClearance_m) {
      return false;
    }
  }
  return true;
}

std::vector<std::uint32_t> Traffic::near(const Eigen::Vector2d& place_m,
                                         double reach_m,
                                         double t_s) const {
  std::vector<std::uint32_t> found;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    if (footprint(i, t_s).distance_m(place_m) < reach_m) {
      found.push_back(static_cast<std::uint32_t>(i));
    }
  }
  return found;
}

void Traffic::place(const std::vector<std::uint32_t>& objects,
                    double t_s,
                    std::vector<MovingShape>& shapes) const {
  for (const std::uint32_t i : objects) {
    const Object& object = objects_[i];
    const Footprint foot = footprint(object, t_s);
    const double ground = relief_.height_m(foot.centre_m.x(), foot.centre_m.y());
    if (object.kind != Kind::kCar) {
      MovingShape person =
          box(foot, object.half_m, ground, ground + object.height_m, object.reflectivity, i);
      person.shape.kind = Shape::Kind::kCylinder;
      shapes.push_back(person);
      continue;
    }
    const Eigen::Vector2d cabin(0.5 * object.half_m.x(), object.half_m.y() - 0.1);
    shapes.push_back(box(
        foot, object.half_m, ground + kCarClearance_m, ground + kBonnet_m, object.reflectivity, i));
    shapes.push_back(box(foot, cabin, ground + kBonnet_m, ground + object.height_m, 0.3, i));
  }
}

std::optional<std::uint32_t> intersect_moving(const std::vector<MovingShape>& shapes,
                                              const Ray& ray,
                                              Hit& hit) {
  std::optional<std::uint32_t> whose;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const MovingShape& moving = shapes[i];
    const double x = moving.shape.centre_m.x() - ray.origin_m.x();
    const double y = moving.shape.centre_m.y() - ray.origin_m.y();
    // Passes the middle in plan view farther off than the shape reaches.
    if (std::abs(x * ray.direction.y() - y * ray.direction.x()) > moving.radius_m) {
      continue;
    }
    const double before_m = hit.range_m;
    intersect(moving.shape, i, ray, hit);
    if (hit.range_m < before_m) {
      whose = moving.object;
    }
  }
  return whose;
}

void write_moving_objects(const Traffic& traffic, const Truth& truth, const std::string& path) {
  std::ofstream file(path);
  file << "# moving objects in map: stamp_ns object kind east_m north_m ground_m yaw_rad length_m "
          "width_m\n";
  for (Nanoseconds stamp_ns = truth.first_ns(); stamp_ns <= truth.last_ns();
       stamp_ns += from_seconds(0.1)) {
    const double t_s = to_seconds(stamp_ns - truth.first_ns());
    for (std::size_t i = 0; i < traffic.size(); ++i) {
      const Footprint foot = traffic.footprint(i, t_s);
      char line[200];
      std::snprintf(line,
                    sizeof line,
                    "%lld %zu %s %.4f %.4f %.4f %.5f %.3f %.3f\n",
                    static_cast<long long>(stamp_ns),
                    i,
                    traffic.is_car(i) ? "car" : "person",
                    foot.centre_m.x(),
                    foot.centre_m.y(),
                    traffic.ground_m(i, t_s),
                    foot.yaw_rad,
                    2.0 * foot.half_m.x(),
                    2.0 * foot.half_m.y());
      file << line;
    }
  }
  file.close();
  if (!file) {
    throw std::runtime_error(path + ": cannot be written (is the disk full?)");
  }
}

}  // namespace trigpoint::simulator
