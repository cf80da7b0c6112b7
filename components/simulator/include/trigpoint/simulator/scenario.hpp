// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A scenario is data: world, route, sensors and a timed list of faults. These structs hold the
// only defaults; a YAML file changes them.
#pragma once

#include "trigpoint/base/config.hpp"
#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/robot.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace trigpoint::simulator {

class Fault;
class Route;

/// A building that the route drives through: walls, roof, columns and shelves, open at both ends.
struct HallConfig {
  double centre_east_m{0.0};
  double centre_north_m{0.0};
  double yaw_rad{0.0};  ///< of its long axis, along which one drives
  double length_m{36.0};
  double width_m{14.0};
  double height_m{7.0};
  double door_width_m{6.0};
  double door_height_m{4.0};
};

/// A straight bore with smooth walls, a flat floor where the relief is flat, and open ends: along
/// its axis a scanner sees nothing that stands still or moves.
struct TunnelConfig {
  double centre_east_m{0.0};
  double centre_north_m{0.0};
  double yaw_rad{0.0};  ///< of its axis
  double length_m{300.0};
  double width_m{7.0};  ///< between the inner faces
  double height_m{5.0};
  bool roof{true};  ///< false: a cutting, open to the sky
};

/// A rectangle on which nothing stands.
struct ClearingConfig {
  double centre_east_m{0.0};
  double centre_north_m{0.0};
  double yaw_rad{0.0};
  double length_m{100.0};
  double width_m{100.0};
};

/// What stands along the route. Every density is per side of the route; 0 leaves the kind out.
struct WorldConfig {
  double relief_amplitude_m{0.8};     ///< of each of three waves of the ground
  double relief_wavelength_m{140.0};  ///< of the longest of them
  double road_half_width_m{3.5};      ///< nothing stands nearer to the route than this
  double building_spacing_m{24.0};
  double building_distance_m{9.0};  ///< from the route to a facade, nearest
  double building_height_m{9.0};    ///< mean
  double tree_spacing_m{14.0};
  double pole_spacing_m{25.0};
  double car_spacing_m{18.0};
  double wood_spacing_m{0.0};    ///< between trees scattered off the route; 0 = none
  double bush_spacing_m{0.0};    ///< between bushes scattered off the route; 0 = none
  double scatter_reach_m{45.0};  ///< from the route, of both
  double grass_height_m{0.0};    ///< of blades that stop light above the ground; 0 = bare
  std::vector<HallConfig> halls;
  std::vector<TunnelConfig> tunnels;
  std::vector<ClearingConfig> clearings;
};

/// What moves besides the robot, along and across the route; see traffic.hpp.
struct TrafficConfig {
  std::int64_t walkers{0};   ///< along the kerbs
  std::int64_t crossing{0};  ///< to and fro across the road
  std::int64_t cars{0};      ///< in the lanes, both ways
};

/// How the route is driven.
struct MotionConfig {
  double start_m{0.0};                      ///< along the route: where the drive begins
  bool reverse{false};                      ///< from the route's end to its start
  double rest_s{2.5};                       ///< standing still before the drive; 0 starts moving
  double acceleration_mps2{0.8};            ///< speeding up and braking
  double lateral_acceleration_mps2{1.2};    ///< limits the speed in curves
  double base_height_m{0.9};                ///< of base_link above the ground
  double roll_per_lateral_rad_s2pm{0.008};  ///< body roll in curves, outwards
  double pitch_per_acceleration_rad_s2pm{0.008};
  double vibration_angle_rad{0.002};  ///< standard deviation of roll and pitch at 3 m/s
  double vibration_heave_m{0.003};    ///< standard deviation at 3 m/s
};

struct LidarConfig {
  std::string model{"vlp16"};
  std::string layout{"velodyne"};  ///< fields of a point, see cloud_layout.hpp
  bool counter_clockwise{false};   ///< direction of rotation, seen from above
  std::int64_t azimuth_steps{1800};
  double rate_hz{10.0};
  double first_sweep_s{0.013};
  double min_range_m{0.9};
  double max_range_m{100.0};
  double range_sigma_m{0.02};
  double dropout{0.01};  ///< share of returns lost for no reason; more are lost far away
  double transport_s{0.004};
  std::int64_t threads{2};  ///< any number gives the same points
};

/// Noise densities and biases of one grade, research/gps C7 (gnss-ins-sim's imu_model).
struct ImuConfig {
  std::string grade{"low"};
  double rate_hz{200.0};
  double transport_s{0.001};
  double gyro_turn_on_bias_radps{0.003};  ///< standard deviation an axis, constant in a run
  double accel_turn_on_bias_mps2{0.03};
  double noise_scale{1.0};  ///< on everything random, biases included; 0 gives the ideal IMU
  bool earth_rotation{true};
  double gyro_limit_radps{8.7};  ///< saturation
  double accel_limit_mps2{78.0};
  double gyro_step_radps{0.0};  ///< quantisation; 0 = none
  double accel_step_mps2{0.0};
};

struct GnssConfig {
  std::string gnss_class{"fixed"};
  std::string driver{"ublox"};
  double rate_hz{5.0};
  double first_fix_s{0.06};
  double latency_s{0.12};
  double latency_jitter_s{0.02};  ///< half width, uniform
  double late_share{0.0};         ///< of fixes that come `late_latency_s` late
  double late_latency_s{0.55};
  double noise_scale{1.0};  ///< on the errors, not on what is reported
};

struct Scenario {
  std::string name{"unnamed"};
  std::string source_yaml;  ///< that loads to the same: the file's text, or all of a composed one
  std::string based_on;     ///< a scenario whose settings this one changes; empty: the defaults
  double duration_s{120.0};
  std::int64_t start_time_s{1'700'000'000};  ///< stamp of t = 0 on day 0
  /// Another day in the same world: all noise is new, and stamps are days later.
  std::int64_t day{0};
  Datum datum{43.9456, -78.8968, 100.0, 0};  ///< origin of map; the ground is near height 0 of map
  RobotConfig robot;
  WorldConfig world;
  std::string route_type{"waypoints"};
  std::shared_ptr<Route> route;
  MotionConfig motion;
  TrafficConfig traffic;
  LidarConfig lidar;
  ImuConfig imu;
  GnssConfig gnss;
  std::vector<std::shared_ptr<Fault>> faults;

  Nanoseconds start_ns() const { return (start_time_s + 86'400 * day) * kNanosecondsPerSecond; }
};

void describe(Scenario& scenario, ConfigFields& fields);

/// Loads a file, or a shipped scenario by its name ("campus"), strictly, with changes appended to
/// it: "campus+beams_32+wrong_fix+motion.start_m=150" takes overlays (shipped ones by name, or
/// files) and single keys, from left to right; faults add up. Shipped ones are looked for in
/// TRIGPOINT_SCENARIOS (environment), the source tree of the build and the installed share folder.
/// Throws ConfigError with file, line and rule, or naming the places searched.
Scenario load_scenario(const std::string& composed);

/// The same from YAML text; `name` stands for the file in errors.
Scenario load_scenario_text(const std::string& yaml, const std::string& name);

/// Whether what stands before the first plus is an existing .yaml file or a shipped scenario's
/// name.
bool is_scenario(const std::string& composed);

/// Names of the shipped scenarios, sorted.
std::vector<std::string> shipped_scenarios();

/// Names of the shipped overlays ("beams_32"), sorted.
std::vector<std::string> shipped_overlays();

}  // namespace trigpoint::simulator
