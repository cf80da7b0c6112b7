// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/scenario.hpp"

#include "cloud_layout.hpp"
#include "fault.hpp"
#include "gnss_model.hpp"
#include "imu_model.hpp"
#include "lidar_model.hpp"
#include "route.hpp"

namespace trigpoint::simulator {

namespace {

void describe_hall(HallConfig& hall, ConfigFields& fields) {
  fields.number("centre_east_m", hall.centre_east_m, "in map");
  fields.number("centre_north_m", hall.centre_north_m, "in map");
  fields.number("yaw_rad", hall.yaw_rad, "of the long axis, along which one drives");
  fields.number("length_m", hall.length_m, "along it", {5.0, 500.0});
  fields.number("width_m", hall.width_m, "across", {5.0, 200.0});
  fields.number("height_m", hall.height_m, "of the roof", {3.0, 50.0});
  fields.number("door_width_m", hall.door_width_m, "at both ends", {3.0, 200.0});
  fields.number("door_height_m", hall.door_height_m, "", {2.5, 50.0});
}

void describe_tunnel(TunnelConfig& tunnel, ConfigFields& fields) {
  fields.number("centre_east_m", tunnel.centre_east_m, "in map");
  fields.number("centre_north_m", tunnel.centre_north_m, "in map");
  fields.number("yaw_rad", tunnel.yaw_rad, "of its axis");
  fields.number("length_m", tunnel.length_m, "along it", {5.0, 2000.0});
  fields.number("width_m", tunnel.width_m, "between the inner faces", {2.0, 50.0});
  fields.number("height_m", tunnel.height_m, "of the walls", {2.0, 50.0});
  fields.flag("roof", tunnel.roof, "false: a cutting, open to the sky");
}

void describe_clearing(ClearingConfig& clearing, ConfigFields& fields) {
  fields.number("centre_east_m", clearing.centre_east_m, "in map");
  fields.number("centre_north_m", clearing.centre_north_m, "in map");
  fields.number("yaw_rad", clearing.yaw_rad, "of its length");
  fields.number("length_m", clearing.length_m, "", kPositive);
  fields.number("width_m", clearing.width_m, "", kPositive);
}

void describe_places(WorldConfig& world, ConfigFields& fields) {
  fields.list(
      "halls",
      world.halls.size(),
      "buildings that the route drives through",
      [&world](std::size_t size) { world.halls.assign(size, HallConfig{}); },
      [&world](ConfigFields& item, std::size_t i) { describe_hall(world.halls[i], item); });
  fields.list(
      "tunnels",
      world.tunnels.size(),
      "smooth, straight and open at both ends",
      [&world](std::size_t size) { world.tunnels.assign(size, TunnelConfig{}); },
      [&world](ConfigFields& item, std::size_t i) { describe_tunnel(world.tunnels[i], item); });
  fields.list(
      "clearings",
      world.clearings.size(),
      "rectangles on which nothing stands",
      [&world](std::size_t size) { world.clearings.assign(size, ClearingConfig{}); },
      [&world](ConfigFields& item, std::size_t i) { describe_clearing(world.clearings[i], item); });
}

void describe_world(WorldConfig& world, ConfigFields& fields) {
  fields.number("relief_amplitude_m",
                world.relief_amplitude_m,
                "of the longest wave of the ground",
                {0.0, 20.0});
  fields.number("relief_wavelength_m",
                world.relief_wavelength_m,
                "of it; two shorter ones follow",
                {50.0, 1e5});
  fields.number("road_half_width_m",
                world.road_half_width_m,
                "nothing stands nearer to the route",
                {1.5, 50.0});
  fields.number(
      "building_spacing_m", world.building_spacing_m, "along each side; 0 = none", kNotNegative);
  fields.number("building_distance_m",
                world.building_distance_m,
                "from the route to the nearest facades",
                {2.0, 200.0});
  fields.number("building_height_m", world.building_height_m, "mean", {3.0, 200.0});
  fields.number("tree_spacing_m", world.tree_spacing_m, "along each side; 0 = none", kNotNegative);
  fields.number("pole_spacing_m", world.pole_spacing_m, "along each side; 0 = none", kNotNegative);
  fields.number(
      "car_spacing_m", world.car_spacing_m, "along each side, parked; 0 = none", kNotNegative);
  fields.number("wood_spacing_m",
                world.wood_spacing_m,
                "between trees scattered off the route; 0 = none",
                kNotNegative);
  fields.number("bush_spacing_m",
                world.bush_spacing_m,
                "between bushes scattered off the route; 0 = none",
                kNotNegative);
  fields.number("scatter_reach_m", world.scatter_reach_m, "of both from the route", {5.0, 200.0});
  fields.number("grass_height_m",
                world.grass_height_m,
                "of blades that stop light above the ground; 0 = bare",
                {0.0, 1.0});
  describe_places(world, fields);
}

void describe_traffic(TrafficConfig& traffic, ConfigFields& fields) {
  constexpr Bounds kCount{0.0, 1000.0};
  fields.integer("walkers", traffic.walkers, "people along the kerbs", kCount);
  fields.integer("crossing", traffic.crossing, "people to and fro across the road", kCount);
  fields.integer("cars", traffic.cars, "in the lanes, both ways", kCount);
}

void describe_motion(MotionConfig& motion, ConfigFields& fields) {
  fields.number("start_m", motion.start_m, "along the route: where the drive begins", kNotNegative);
  fields.flag("reverse", motion.reverse, "from the route's end to its start");
  fields.number(
      "rest_s", motion.rest_s, "standing still before the drive; 0 starts moving", kNotNegative);
  fields.number(
      "acceleration_mps2", motion.acceleration_mps2, "speeding up and braking", {0.05, 10.0});
  fields.number("lateral_acceleration_mps2",
                motion.lateral_acceleration_mps2,
                "limits the speed in curves",
                {0.05, 10.0});
  fields.number(
      "base_height_m", motion.base_height_m, "of base_link (the IMU) above the ground", {0.0, 5.0});
  fields.number("roll_per_lateral_rad_s2pm",
                motion.roll_per_lateral_rad_s2pm,
                "body roll in curves, outwards",
                {0.0, 0.05});
  fields.number("pitch_per_acceleration_rad_s2pm",
                motion.pitch_per_acceleration_rad_s2pm,
                "nose up when speeding up",
                {0.0, 0.05});
  fields.number("vibration_angle_rad",
                motion.vibration_angle_rad,
                "standard deviation of roll and pitch at 3 m/s",
                {0.0, 0.1});
  fields.number(
      "vibration_heave_m", motion.vibration_heave_m, "standard deviation at 3 m/s", {0.0, 0.1});
}

void describe_lidar(LidarConfig& lidar, ConfigFields& fields) {
  fields.choice("model", lidar.model, "beams", lidar_model_names());
  fields.choice("layout", lidar.layout, "fields of a point", cloud_layout_names());
  fields.flag("counter_clockwise", lidar.counter_clockwise, "rotation seen from above");
  fields.integer("azimuth_steps", lidar.azimuth_steps, "firings a revolution", {4.0, 10000.0});
  fields.number("rate_hz", lidar.rate_hz, "revolutions", {1.0, 100.0});
  fields.number("first_sweep_s", lidar.first_sweep_s, "after the start", kNotNegative);
  fields.number("min_range_m", lidar.min_range_m, "nearer returns are lost", kNotNegative);
  fields.number("max_range_m", lidar.max_range_m, "farther returns are lost", {1.0, 300.0});
  fields.number("range_sigma_m",
                lidar.range_sigma_m,
                "white noise; up to twice as much on slanted surfaces",
                kNotNegative);
  fields.number("dropout", lidar.dropout, "share of returns lost for no reason", {0.0, 1.0});
  fields.number(
      "transport_s", lidar.transport_s, "from the last point to its arrival", kNotNegative);
  fields.integer("threads", lidar.threads, "any number gives the same points", {1.0, 64.0});
}

void describe_imu(ImuConfig& imu, ConfigFields& fields) {
  fields.choice("grade", imu.grade, "noise and drift of the biases", imu_grade_names());
  fields.number("rate_hz", imu.rate_hz, "samples", {10.0, 2000.0});
  fields.number("transport_s", imu.transport_s, "from the stamp to the arrival", kNotNegative);
  fields.number("gyro_turn_on_bias_radps",
                imu.gyro_turn_on_bias_radps,
                "standard deviation, constant in a run",
                kNotNegative);
  fields.number("accel_turn_on_bias_mps2",
                imu.accel_turn_on_bias_mps2,
                "standard deviation, constant in a run",
                kNotNegative);
  fields.number("noise_scale",
                imu.noise_scale,
                "on everything random, biases included; 0 = ideal",
                kNotNegative);
  fields.flag("earth_rotation",
              imu.earth_rotation,
              "the gyro feels the Earth turn, the accelerometer Coriolis");
  fields.number("gyro_limit_radps", imu.gyro_limit_radps, "saturation", kPositive);
  fields.number("accel_limit_mps2", imu.accel_limit_mps2, "saturation", kPositive);
  fields.number("gyro_step_radps", imu.gyro_step_radps, "quantisation; 0 = none", kNotNegative);
  fields.number("accel_step_mps2", imu.accel_step_mps2, "quantisation; 0 = none", kNotNegative);
}

void describe_gnss(GnssConfig& gnss, ConfigFields& fields) {
  fields.choice(
      "gnss_class", gnss.gnss_class, "solution when no fault says otherwise", gnss_class_names());
  fields.choice("driver",
                gnss.driver,
                "whose habits NavSatFix's status and covariance follow",
                gnss_driver_names());
  fields.number("rate_hz", gnss.rate_hz, "fixes", {0.05, 50.0});
  fields.number("first_fix_s", gnss.first_fix_s, "after the start", kNotNegative);
  fields.number("latency_s", gnss.latency_s, "from the stamp to the arrival", {0.0, 10.0});
  fields.number("latency_jitter_s", gnss.latency_jitter_s, "half width, uniform", {0.0, 10.0});
  fields.number("late_share", gnss.late_share, "share of fixes that come late", {0.0, 1.0});
  fields.number("late_latency_s", gnss.late_latency_s, "their latency", {0.0, 10.0});
  fields.number(
      "noise_scale", gnss.noise_scale, "on the errors, not on what is reported", kNotNegative);
}

void describe_datum(Datum& datum, ConfigFields& fields) {
  fields.number("latitude_deg", datum.latitude_deg, "", {-90.0, 90.0});
  fields.number("longitude_deg", datum.longitude_deg, "", {-180.0, 180.0});
  fields.number("height_m", datum.height_m, "above the WGS 84 ellipsoid", {-1000.0, 10000.0});
}

void describe_route(Scenario& scenario, ConfigFields& fields) {
  const std::string before = scenario.route_type;
  fields.choice("type",
                scenario.route_type,
                "kind of route; what follows belongs to it",
                names_of(route_registry()));
  const auto make = route_registry().find(scenario.route_type);
  if (make == route_registry().end()) {
    return;
  }
  if (!scenario.route || scenario.route_type != before) {
    scenario.route = make->second();
  }
  scenario.route->describe(fields);
}

void describe_fault(std::shared_ptr<Fault>& fault, ConfigFields& fields) {
  std::string type = fault ? fault->type : "";
  fields.choice("type", type, "what goes wrong", names_of(fault_registry()));
  const auto make = fault_registry().find(type);
  if (make == fault_registry().end()) {
    throw ConfigError("faults: each needs a type");
  }
  if (!fault) {
    fault = make->second();
    fault->type = type;
  }
  fields.number("start_s", fault->start_s, "after the scenario's start", kNotNegative);
  fields.number("duration_s", fault->duration_s, "", kNotNegative);
  fault->describe(fields);
}

}  // namespace

void describe(Scenario& scenario, ConfigFields& fields) {
  fields.text("name", scenario.name, "of the scenario");
  fields.text("based_on", scenario.based_on, "a scenario that this one changes; empty: none");
  fields.number("duration_s",
                scenario.duration_s,
                "unless the caller says otherwise; stands still when the route is over",
                {0.1, 1e5});
  fields.integer("start_time_s",
                 scenario.start_time_s,
                 "stamp of the start on day 0, Unix seconds",
                 kNotNegative);
  fields.integer("day",
                 scenario.day,
                 "another day in the same world: new noise, stamps so many days later",
                 {0.0, 10000.0});
  fields.section(
      "datum", "origin of map", [&](ConfigFields& f) { describe_datum(scenario.datum, f); });
  fields.section(
      "robot", "where the sensors sit", [&](ConfigFields& f) { describe(scenario.robot, f); });
  fields.section("world", "what stands along the route", [&](ConfigFields& f) {
    describe_world(scenario.world, f);
  });
  fields.section(
      "route", "plan view of the drive", [&](ConfigFields& f) { describe_route(scenario, f); });
  fields.section(
      "motion", "how it is driven", [&](ConfigFields& f) { describe_motion(scenario.motion, f); });
  fields.section("traffic", "what moves besides the robot", [&](ConfigFields& f) {
    describe_traffic(scenario.traffic, f);
  });
  fields.section(
      "lidar", "spinning LiDAR", [&](ConfigFields& f) { describe_lidar(scenario.lidar, f); });
  fields.section(
      "imu", "inertial unit at base_link", [&](ConfigFields& f) { describe_imu(scenario.imu, f); });
  fields.section(
      "gnss", "satellite receiver", [&](ConfigFields& f) { describe_gnss(scenario.gnss, f); });
  fields.list(
      "faults",
      scenario.faults.size(),
      "what goes wrong, and when",
      [&](std::size_t size) { scenario.faults.assign(size, nullptr); },
      [&](ConfigFields& item, std::size_t i) { describe_fault(scenario.faults[i], item); });
}

}  // namespace trigpoint::simulator
