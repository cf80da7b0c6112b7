// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "resumption.hpp"

#include "trigpoint/base/so3.hpp"

#include "downsample.hpp"
#include "drift.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

namespace {

constexpr std::size_t kSweepsBetweenAttempts = 5;
constexpr std::size_t kMostSweeps = 20;  // that are put together for a registration
/// A robot that was restarted while it drove has gone on at most this long at its speed.
constexpr double kLongestDrive_s = 5.0;
/// For so long a robot goes on as it went: attitude to the last scan's, speed by an acceleration.
constexpr double kMoment_s = 2.0;
constexpr std::size_t kSweepsAtOnce = 2;
/// From the predicted place, when it was left this moment.
constexpr double kAtOnce_m = 0.5;
constexpr double kSigmas = 2.0;
constexpr double kAcceleration_mps2 = 1.0;
constexpr double kVelocitySigma_mps = 0.2;
/// The heading's rate while nobody looked is taken from so much of the IMU after it.
constexpr double kTurnWindow_s = 0.2;
constexpr double kTurned_rad = 0.2;
/// It may have begun or ended to turn meanwhile: headings from the last one to the predicted one
/// and so far beyond both are looked at.
constexpr double kTurnedBeyond_rad = 0.2;
/// A map that was loaded around one place serves those so near to it as well.
constexpr double kSameMap_m = 5.0;
/// Of a registered pose, before the first scan is matched.
constexpr double kPositionSigma_m = 0.1;
constexpr double kRotationSigma_rad = 0.01;

Quaterniond without_yaw(const Quaterniond& q) {
  return (from_yaw(-yaw_of(q)) * q).normalized();
}

/// The waiting sweeps in one cloud, axes of base at the newest one.
struct Gathered {
  PointCloud points_base;
  Pose T_new_base;
};

Gathered gather(const Config& config,
                const InitialState& initial,
                const Pose& T_base_lidar,
                const ImuBuffer& imu,
                const std::deque<Sweep>& sweeps) {
  ScanFilter filter(config, T_base_lidar, initial);
  PointCloud all_new;
  for (std::size_t i = 0; i < std::min(sweeps.size(), kMostSweeps); ++i) {
    if (sweeps[i].end_ns > imu.newest_ns()) {
      break;
    }
    const ScanOutcome outcome = filter.process(sweeps[i], imu);
    filter.insert(outcome);
    const PointCloud moved = transformed(outcome.thinned_base, filter.state().T_odom_base);
    all_new.insert(all_new.end(), moved.begin(), moved.end());
  }
  const Pose T_new_base = filter.state().T_odom_base;
  return {downsample(transformed(all_new, T_new_base.inverse()), config.matching.voxel_m),
          T_new_base};
}

/// The checkpoint's covariance where it says something of today, as far as it has our size.
ErrorMatrix covariance_from(const Checkpoint& checkpoint, const ErrorMatrix& otherwise) {
  ErrorMatrix P = otherwise;
  const Eigen::Index size = std::min<Eigen::Index>(error::kSize, checkpoint.covariance.rows());
  P.topRows(size).setZero();
  P.leftCols(size).setZero();
  P.topLeftCorner(size, size) = checkpoint.covariance.topLeftCorner(size, size);
  return P;
}

/// Pose and velocity are new and not tied to anything that was known before.
void set_pose_and_velocity(const ErrorMatrix& start, const Matrix3d& R_old_new, ErrorMatrix& P) {
  constexpr int kNew = error::kVelocity + 3;
  P.topRows<kNew>().setZero();
  P.leftCols<kNew>().setZero();
  P.block<3, 3>(error::kPosition, error::kPosition) =
      kPositionSigma_m * kPositionSigma_m * Matrix3d::Identity();
  P.block<3, 3>(error::kRotation, error::kRotation) =
      kRotationSigma_rad * kRotationSigma_rad * Matrix3d::Identity();
  P.block<3, 3>(error::kVelocity, error::kVelocity) =
      R_old_new * start.block<3, 3>(error::kVelocity, error::kVelocity) * R_old_new.transpose();
}

/// Biases walk on while nobody looks, up to what they may be at any start.
void let_biases_walk(const ImuConfig& imu, double away_s, ErrorMatrix& P) {
  const auto walk = [&](int at, double density, double initial_sigma) {
    for (int i = at; i < at + 3; ++i) {
      const double limit = std::max(P(i, i), initial_sigma * initial_sigma);
      P(i, i) = std::min(limit, P(i, i) + density * density * away_s);
    }
  };
  walk(error::kGyroBias, imu.gyro_bias_walk_radps_sqrts, imu.initial_gyro_bias_sigma_radps);
  walk(error::kAccelBias, imu.accel_bias_walk_mps2_sqrts, imu.initial_accel_bias_sigma_mps2);
}

/// Heading per second in the first moments of the IMU, as far as the gyro's bias is known.
double turn_rate_radps(const ImuBuffer& imu, const StartResult& start, const Vector3d& bias_radps) {
  const Vector3d up_base = start.initial.state.T_odom_base.q.conjugate() * Vector3d::UnitZ();
  double sum = 0.0;
  int count = 0;
  for (const InertialSample& sample : imu.samples()) {
    if (to_seconds(sample.stamp_ns - imu.oldest_ns()) < kTurnWindow_s) {
      sum += up_base.dot(sample.gyro_radps - bias_radps);
      ++count;
    }
  }
  return count > 0 ? sum / count : 0.0;
}

}  // namespace

std::string offset_text(const Pose& T_from, const Pose& T_to) {
  constexpr double kDegrees = 57.29577951308232;
  const Vector3d offset = T_to.p - T_from.p;
  char text[160];
  std::snprintf(text,
                sizeof text,
                "%.2f m aside, %+.2f m in height and %+.1f degrees from the predicted place",
                offset.head<2>().norm(),
                offset.z(),
                kDegrees * wrap_angle(yaw_of(T_to.q) - yaw_of(T_from.q)));
  return text;
}

std::unique_ptr<LocalMap> load_map(const LocalMapConfig& config,
                                   const StoredPoints& points,
                                   std::uint32_t odom_epoch,
                                   const Vector3d& center_odom_m,
                                   bool recent_stretch) {
  auto map = make_local_map(config);
  points({odom_epoch, center_odom_m, config.half_side_m, recent_stretch},
         [&](const PointCloud& cloud) { map->insert(cloud); });
  map->prune(center_odom_m, config.half_side_m);
  return map;
}

Resumption::Resumption(const Config& config,
                       const Checkpoint& checkpoint,
                       StoredPoints points,
                       const ResumeOptions& options)
    : config_(config), checkpoint_(checkpoint), points_(std::move(points)), options_(options) {}

std::vector<SearchArea> Resumption::areas(Nanoseconds now_ns,
                                          double turn_radps,
                                          const Pose& T_first_newest) const {
  const double radius_m = config_.recovery.radius_m;
  const double yaw_rad = config_.recovery.yaw_rad;
  std::vector<SearchArea> result;
  for (const Pose& place : options_.more_places_odom) {
    result.push_back({{place * T_first_newest}, radius_m, yaw_rad});
  }
  const Pose& last = checkpoint_.T_odom_base;
  const double away_s = std::max(0.0, to_seconds(now_ns - checkpoint_.stamp_ns));
  const Vector3d driven_m = away_s * checkpoint_.v_odom_mps;
  const double turned_rad = away_s * turn_radps;
  SearchArea at_checkpoint{{last * T_first_newest}, radius_m, yaw_rad};
  if (away_s < kLongestDrive_s && (driven_m.norm() > 1.0 || std::abs(turned_rad) > kTurned_rad)) {
    at_checkpoint.centres_odom.push_back(predicted_place(away_s, turned_rad, T_first_newest));
  }
  result.push_back(std::move(at_checkpoint));
  return result;
}

Pose Resumption::predicted_place(double away_s,
                                 double turned_rad,
                                 const Pose& T_first_newest) const {
  const Pose& last = checkpoint_.T_odom_base;
  const Vector3d driven_m = away_s * checkpoint_.v_odom_mps;
  // Along an arc, whose chord points half way between the headings.
  const Pose predicted((from_yaw(turned_rad) * last.q).normalized(),
                       last.p + from_yaw(0.5 * turned_rad) * driven_m);
  return predicted * T_first_newest;
}

/// A start that takes attitude, speed and biases from the checkpoint, in level axes of its own.
StartResult Resumption::going_on(Nanoseconds stamp_ns) const {
  const Quaterniond q_own_odom = from_yaw(-yaw_of(checkpoint_.T_odom_base.q));
  const Quaterniond q_own_base = (q_own_odom * checkpoint_.T_odom_base.q).normalized();
  const Vector3d gravity_own_mps2 = q_own_odom * checkpoint_.gravity_odom_mps2;
  StartResult start;
  start.initial = level(checkpoint_.accel_bias_mps2 - q_own_base.conjugate() * gravity_own_mps2,
                        stamp_ns,
                        config_.imu,
                        {});
  State& state = start.initial.state;
  state.T_odom_base = {q_own_base, Vector3d::Zero()};
  state.gravity_odom_mps2 = gravity_own_mps2;
  state.v_odom_mps = q_own_odom * checkpoint_.v_odom_mps;
  state.gyro_bias_radps = checkpoint_.gyro_bias_radps;
  state.accel_bias_mps2 = checkpoint_.accel_bias_mps2;
  const double sigma_mps =
      kVelocitySigma_mps + kAcceleration_mps2 * to_seconds(stamp_ns - checkpoint_.stamp_ns);
  start.initial.covariance.block<3, 3>(error::kVelocity, error::kVelocity) =
      sigma_mps * sigma_mps * Matrix3d::Identity();
  start.speed_mps = state.v_odom_mps.norm();
  return start;
}

Resumption::Found Resumption::compose(const StartResult& start,
                                      const Pose& T_old_new,
                                      const Registration& registration,
                                      std::unique_ptr<LocalMap> map) const {
  Found found;
  found.initial = start.initial;
  State& state = found.initial.state;
  state.T_odom_base = T_old_new * state.T_odom_base;
  state.v_odom_mps = T_old_new.q * state.v_odom_mps;
  state.gravity_odom_mps2 = checkpoint_.gravity_odom_mps2;
  state.accel_bias_mps2 = checkpoint_.accel_bias_mps2;
  state.T_map_odom = checkpoint_.T_map_odom;
  state.T_map_odom.tilt_rad.setZero();
  if (!start.at_rest) {
    state.gyro_bias_radps = checkpoint_.gyro_bias_radps;
  }
  ErrorMatrix& P = found.initial.covariance;
  const ErrorMatrix at_start = P;
  P = covariance_from(checkpoint_, at_start);
  set_pose_and_velocity(at_start, T_old_new.q.toRotationMatrix(), P);
  P.block<2, 2>(error::kPosition, error::kPosition) += registration.spread_m2;
  const double away_s = to_seconds(found.initial.stamp_ns - checkpoint_.stamp_ns);
  let_biases_walk(config_.imu, std::max(0.0, away_s), P);
  const double moved_m = (state.T_odom_base.p - checkpoint_.T_odom_base.p).norm();
  if (!options_.frozen_map) {
    add_drift_noise(drift_rate(config_.drift), moved_m, state, checkpoint_.aligned, P);
  }
  if (config_.extrinsic.estimate) {
    // What the session had found of the LiDAR's turn is to be found again, against its gravity.
    const double sigma_rad = config_.extrinsic.rotation_sigma_rad;
    add_tilt_noise(
        sigma_rad * sigma_rad * Eigen::Matrix2d::Identity(), state, checkpoint_.aligned, P);
  }
  make_symmetric(P);
  found.past.aligned = checkpoint_.aligned;
  found.past.distance_m = checkpoint_.distance_m + (options_.frozen_map ? 0.0 : moved_m);
  found.past.drift_covariance = checkpoint_.drift_covariance;
  found.past.map = std::move(map);
  char fit[120];
  std::snprintf(
      fit, sizeof fit, "; %.0f %% of what stands out lies on the map", 100.0 * registration.share);
  found.text = offset_text(registration.centre, registration.T_odom_base) + fit;
  return found;
}

std::optional<Resumption::Found> Resumption::attempt(const StartResult& start,
                                                     const Pose& T_base_lidar,
                                                     const ImuBuffer& imu,
                                                     const std::deque<Sweep>& sweeps) {
  ++attempts_;
  next_at_ = sweeps.size() + kSweepsBetweenAttempts;
  const Gathered gathered = gather(config_, start.initial, T_base_lidar, imu, sweeps);
  const LevelScan scan{gathered.points_base, without_yaw(gathered.T_new_base.q), T_base_lidar.p};
  obstacle_.clear();
  const double turn_radps = turn_rate_radps(imu, start, checkpoint_.gyro_bias_radps);
  const Pose T_first_newest = start.initial.state.T_odom_base.inverse() * gathered.T_new_base;
  return look_in(
      areas(start.initial.stamp_ns, turn_radps, T_first_newest), start, scan, gathered.T_new_base);
}

std::optional<Resumption::Found> Resumption::attempt_at_once(const Pose& T_base_lidar,
                                                             const ImuBuffer& imu,
                                                             const std::deque<Sweep>& sweeps) {
  const bool ready =
      sweeps.size() >= kSweepsAtOnce && sweeps[kSweepsAtOnce - 1].end_ns <= imu.newest_ns();
  if (tried_at_once_ || !ready || options_.frozen_map || !options_.more_places_odom.empty()) {
    return std::nullopt;
  }
  tried_at_once_ = true;
  const Nanoseconds stamp_ns = std::max(imu.oldest_ns(), sweeps.front().begin_ns);
  const double away_s = to_seconds(stamp_ns - checkpoint_.stamp_ns);
  if (away_s < 0.0 || away_s > kMoment_s) {
    return std::nullopt;
  }
  const StartResult start = going_on(stamp_ns);
  const Gathered gathered = gather(config_, start.initial, T_base_lidar, imu, sweeps);
  const LevelScan scan{gathered.points_base, without_yaw(gathered.T_new_base.q), T_base_lidar.p};
  const double turn_radps = turn_rate_radps(imu, start, checkpoint_.gyro_bias_radps);
  const Pose T_first_newest = start.initial.state.T_odom_base.inverse() * gathered.T_new_base;
  const double turned_rad = away_s * turn_radps;
  SearchArea area{{predicted_place(away_s, 0.5 * turned_rad, T_first_newest)}};
  area.sigma_m = away_s * (kVelocitySigma_mps + 0.5 * kAcceleration_mps2 * away_s);
  area.radius_m = kAtOnce_m + kSigmas * area.sigma_m;
  area.yaw_rad = 0.5 * std::abs(turned_rad) + kTurnedBeyond_rad;
  area.holds_robot = true;
  return look_in({area}, start, scan, gathered.T_new_base);
}

std::optional<Resumption::Found> Resumption::look_in(const std::vector<SearchArea>& areas,
                                                     const StartResult& start,
                                                     const LevelScan& scan,
                                                     const Pose& T_new_base) {
  Workers workers(static_cast<std::size_t>(config_.matching.threads));
  std::unique_ptr<LocalMap> map;
  Vector3d loaded_at_m = Vector3d::Zero();
  for (const SearchArea& area : areas) {
    const Vector3d& centre_m = area.centres_odom.front().p;
    if (!map || (centre_m - loaded_at_m).norm() > kSameMap_m) {
      map = load_map(
          config_.local_map, points_, checkpoint_.odom_epoch, centre_m, !options_.frozen_map);
      loaded_at_m = centre_m;
    }
    const RegistrationResult result =
        register_scan(scan, *map, area, config_.matching, config_.recovery, workers);
    if (result.accepted) {
      const Pose T_old_new = result.best->T_odom_base * T_new_base.inverse();
      return compose(start, T_old_new, *result.best, std::move(map));
    }
    obstacle_ += (obstacle_.empty() ? "" : "; elsewhere: ") + result.obstacle;
  }
  return std::nullopt;
}

}  // namespace trigpoint::lio_mapper
