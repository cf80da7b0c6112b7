// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A drive that never happened, as a log: LiDAR, IMU and fixes in order of arrival, bit-identical
// for the same scenario and seed. The truth is never among the entries.
#pragma once

#include "trigpoint/base/pose.hpp"
#include "trigpoint/base/time.hpp"
#include "trigpoint/recording/log.hpp"
#include "trigpoint/recording/rosbag2_writer.hpp"
#include "trigpoint/simulator/scenario.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::simulator {

/// base_link at one moment, in map (ENU at the scenario's datum).
struct TrueState {
  Pose T_map_base;
  Eigen::Vector3d v_map_mps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d a_map_mps2{Eigen::Vector3d::Zero()};
  Eigen::Vector3d omega_base_radps{Eigen::Vector3d::Zero()};
};

/// What the robot really did: analytic in time, defined for every moment of the run.
class Truth {
 public:
  virtual ~Truth() = default;
  virtual TrueState at(Nanoseconds stamp_ns) const = 0;
  virtual Nanoseconds first_ns() const = 0;
  virtual Nanoseconds last_ns() const = 0;
};

/// The true drive of a scenario, without any sensor. It depends on the seed through the relief and
/// the vibration only.
std::shared_ptr<const Truth> make_truth(const Scenario& scenario,
                                        std::uint64_t seed,
                                        std::optional<double> duration_s = std::nullopt);

/// Writes base_link in map as TUM (stamp x y z qx qy qz qw, 9 decimals of stamp), with frame and
/// datum in a comment. Throws std::runtime_error naming the file when it cannot be written.
void write_truth(const Truth& truth,
                 const Datum& datum,
                 const std::string& path,
                 double rate_hz = 100.0);

/// Truth about one point of a sweep that lies on a moving object.
struct MovingPoint {
  std::uint32_t point{0};                            ///< index in the cloud
  std::uint32_t object{0};                           ///< which of the moving ones
  Eigen::Vector3d p_map_m{Eigen::Vector3d::Zero()};  ///< where the ray met it
};

/// For evaluation only: which points of a sweep are of moving objects.
struct MovingSweep {
  Nanoseconds stamp_ns{0};  ///< of the cloud
  std::vector<MovingPoint> points;
};

struct StreamOptions {
  bool lidar{true};
  /// Called for every sweep when it is made, in a scenario with traffic.
  std::function<void(const MovingSweep&)> on_moving{};
};

/// Truth about one fix, for evaluation only: what the faults did to it. The noise of its class
/// comes on top; frozen messages and garbage are not told apart from right ones.
struct FixTruth {
  Nanoseconds stamp_ns{0};  ///< true time of the measurement
  Eigen::Vector3d antenna_map_m{Eigen::Vector3d::Zero()};
  bool lost{false};        ///< no message, or one without a position
  std::string gnss_class;  ///< fixed, float, code, sbas, none
  Eigen::Vector3d fault_error_enu_m{Eigen::Vector3d::Zero()};
};

/// A LogReader that makes its entries while it is read.
class ScenarioReader : public recording::LogReader {
 public:
  virtual std::shared_ptr<const Truth> truth() const = 0;
  virtual const Scenario& scenario() const = 0;
  /// Of every epoch of the receiver, lost ones too, in order of time; at any moment of the reading.
  virtual std::vector<FixTruth> true_fixes() const = 0;
  /// Writes the truth and gives its path to truth_file() from now on. In a scenario with traffic
  /// also moving_objects.txt and, while it is read, moving_points.txt beside it.
  virtual void write_truth(const std::string& path) = 0;
};

/// `duration_s` replaces the scenario's own.
std::unique_ptr<ScenarioReader> open_scenario(const Scenario& scenario,
                                              std::uint64_t seed,
                                              std::optional<double> duration_s = std::nullopt,
                                              const StreamOptions& options = {});

/// Called with a share of 0 to 1.
using Progress = std::function<void(double)>;

/// Writes out_dir/log (rosbag2 in `storage`), truth.tum (with traffic: moving_*.txt), scenario.yaml
/// and robot.yaml (an overlay with the section `robot`). Throws recording::LogError or
/// std::runtime_error naming the file and the cause; out_dir may exist, out_dir/log must not.
void simulate(const Scenario& scenario,
              std::uint64_t seed,
              std::optional<double> duration_s,
              const std::string& out_dir,
              const Progress& progress = {},
              const StreamOptions& options = {},
              recording::Storage storage = recording::Storage::kSqlite3);

}  // namespace trigpoint::simulator
