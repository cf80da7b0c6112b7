// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "scan_filter.hpp"

#include "trigpoint/base/so3.hpp"

#include "bent_map.hpp"
#include "downsample.hpp"
#include "drift.hpp"
#include "scan_matcher.hpp"
#include "undistortion.hpp"
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <utility>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;

namespace {

/// Between two samples farther apart the trapezoid is divided.
constexpr double kLongestStep_s = 0.02;
/// Less motion between two scans is jitter of the estimate.
constexpr double kLeastMotion_m = 0.005;
/// Of a pose that a search found, before the scan is matched there.
/// In the plane a cell of the field that is searched, where no surface tells more.
constexpr double kFoundPlace_m = 0.25;
constexpr double kFoundHeight_m = 0.1;
constexpr double kFoundRotation_rad = 0.01;
/// A sweep of a guessed motion that was wrong by more at its end is undistorted anew: a smear of
/// range noise, at 10 m.
constexpr double kSmear_m = 0.02;
constexpr double kSmear_rad = 2e-3;
constexpr int kMostReshapes = 2;
/// A smaller turn of the extrinsic is none.
constexpr double kLeastCorrection_rad = 1e-6;
/// A scan is put into the map unmatched only while its pose relative to the map is this certain.
constexpr double kMapSigma_m = 0.3;
/// After a search scans are kept out of the map until the position is this certain, so far on the
/// way at most: where a direction is open the search finds places that are as good, and a scan that
/// is put in at one of them vouches for it. Farther on the old map shows too little.
constexpr double kPlacedSigma_m = 0.1;
constexpr double kMostKeptOut_m = 20.0;

InitialState with_extrinsic(InitialState initial,
                            const Pose& T_base_lidar,
                            const ExtrinsicConfig& config) {
  initial.state.T_base_lidar = T_base_lidar;
  auto& P = initial.covariance;
  P.middleRows<6>(error::kExtrinsicRotation).setZero();
  P.middleCols<6>(error::kExtrinsicRotation).setZero();
  if (config.estimate) {
    P.diagonal()
        .segment<3>(error::kExtrinsicRotation)
        .setConstant(config.rotation_sigma_rad * config.rotation_sigma_rad);
    P.diagonal()
        .segment<3>(error::kExtrinsicPosition)
        .setConstant(config.position_sigma_m * config.position_sigma_m);
  }
  return initial;
}

IterationLimits limits_of(const MatchingConfig& config) {
  return {config.max_iterations,
          config.converged_position_m,
          config.converged_rotation_rad,
          static_cast<std::size_t>(config.min_matches)};
}

/// Attitudes of scans less certain than this say nothing about clocks.
constexpr double kAttitudeSigma_rad = 2e-3;

/// The attitude that the residuals alone ask for, whatever the prior; nullopt where they leave a
/// direction open.
std::optional<Eigen::Quaterniond> attitude_of_scan(const UpdateResult& result) {
  const Matrix6d& A = result.measured.information;
  const Vector6d& g = result.measured.gradient;
  // Along directions in which position is open too, it is left where it is.
  const Matrix3d A_pp =
      A.topLeftCorner<3, 3>() + 1e-9 * A.topLeftCorner<3, 3>().trace() * Matrix3d::Identity();
  const Matrix3d by_position = A_pp.ldlt().solve(A.topRightCorner<3, 3>()).transpose();
  const Matrix3d S = A.bottomRightCorner<3, 3>() - by_position * A.topRightCorner<3, 3>();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(S);
  if (!(eigen.eigenvalues()[0] > 1.0 / (kAttitudeSigma_rad * kAttitudeSigma_rad))) {
    return std::nullopt;
  }
  const Vector3d turn_rad = -S.ldlt().solve(g.tail<3>() - by_position * g.head<3>());
  return (result.measured_at.q * so3_exp(turn_rad)).normalized();
}

/// What `more` knows beyond `known`, along the axes along which it knows more.
Matrix6d beyond(const Matrix6d& known, const Matrix6d& more) {
  const Eigen::LLT<Matrix6d> root(known + kUnseen * Matrix6d::Identity());
  const Eigen::SelfAdjointEigenSolver<Matrix6d> axes(whitened(root, more));
  const Matrix6d directions = root.matrixL() * axes.eigenvectors();
  const Vector6d excess = (axes.eigenvalues().array() - 1.0).max(0.0);
  return directions * excess.asDiagonal() * directions.transpose();
}

/// By how much a pose at `p` moves with a displacement of odom that is expressed about its origin,
/// ROS order; -p is the way back.
Matrix6d transport(const Vector3d& p_odom_m) {
  Matrix6d jacobian = Matrix6d::Identity();
  jacobian.topRightCorner<3, 3>() = -hat(p_odom_m);
  return jacobian;
}

}  // namespace

PointCloud transformed(const PointCloud& points, const Pose& T) {
  const Eigen::Matrix3f R = T.q.toRotationMatrix().cast<float>();
  const Eigen::Vector3f t = T.p.cast<float>();
  PointCloud moved;
  moved.reserve(points.size());
  for (const PointXyzi& point : points) {
    const Eigen::Vector3f p = R * point.position() + t;
    moved.push_back({p.x(), p.y(), p.z(), point.intensity});
  }
  return moved;
}

ScanFilter::ScanFilter(const Config& config,
                       const Pose& T_base_lidar,
                       const InitialState& initial,
                       StageObserver observe)
    : config_(config),
      T_base_lidar_(T_base_lidar),
      initial_(with_extrinsic(initial, T_base_lidar, config.extrinsic)),
      observe_(std::move(observe)),
      workers_(std::make_unique<Workers>(static_cast<std::size_t>(config.matching.threads))),
      map_(make_local_map(config.local_map)),
      extrinsic_rotation_(config.extrinsic.rotation_sigma_rad),
      history_(config.rows) {}

Nanoseconds ScanFilter::stamp_ns() const {
  return history_.empty() ? initial_.stamp_ns : history_.newest().stamp_ns;
}

const State& ScanFilter::state() const {
  return history_.empty() ? initial_.state : history_.newest().state;
}

const ErrorMatrix& ScanFilter::covariance() const {
  return history_.empty() ? initial_.covariance : history_.newest().covariance;
}

ScanFilter::Prediction ScanFilter::predict(const Sweep& sweep, const ImuBuffer& imu) const {
  Prediction prediction{state(), covariance()};
  const auto steps = imu.steps_between(stamp_ns(), sweep.end_ns, kLongestStep_s);
  const double gap_s = imu.longest_gap_s(stamp_ns(), sweep.end_ns);
  PathNode node{stamp_ns(), state().T_odom_base, state().v_odom_mps};
  for (const InertialStep& step : steps) {
    const StepJacobian jacobian = step_jacobian(prediction.state, step);
    const State next = propagate(prediction.state, step);
    const double dt_s = step.duration_s();
    node.acceleration_odom_mps2 = (next.v_odom_mps - prediction.state.v_odom_mps) / dt_s;
    node.angular_radps =
        0.5 * (step.begin.gyro_radps + step.end.gyro_radps) - prediction.state.gyro_bias_radps;
    prediction.path.push_back(node);
    const StepNoise noise = noise_of(config_.imu, step, gap_s);
    propagate_covariance(jacobian, config_.imu, noise, prediction.covariance);
    prediction.guessed |= step.noise_factor() > 1.0;
    node.turn_variance_rad2 += noise.gyro2 * dt_s;
    apply_transition(jacobian, prediction.transition);
    prediction.state = next;
    node.stamp_ns = step.end.stamp_ns;
    node.T_odom_base = next.T_odom_base;
    node.v_odom_mps = next.v_odom_mps;
  }
  prediction.path.push_back(node);
  return prediction;
}

void ScanFilter::add_drift(Prediction& prediction) {
  const double moved_m = (prediction.state.T_odom_base.p - state().T_odom_base.p).norm();
  if (moved_m < kLeastMotion_m) {
    return;
  }
  distance_m_ += moved_m;
  const DriftRate rate = drift_rate(config_.drift, pose_covariance_in_local_map());
  Matrix6d at_robot = Matrix6d::Zero();
  at_robot.topLeftCorner<3, 3>() = moved_m * rate.position_m2;
  at_robot.block<2, 2>(3, 3) = moved_m * rate.tilt_rad2;
  at_robot(5, 5) = moved_m * rate.yaw_rad2;
  const Matrix6d to_origin = transport(-prediction.state.T_odom_base.p);
  drift_covariance_ += to_origin * at_robot * to_origin.transpose();
  add_drift_noise(rate, moved_m, prediction.state, aligned_, prediction.covariance);
}

/// A sweep whose time is uncertain against that of the sweeps before was taken that much farther
/// along the way.
void ScanFilter::add_clock_noise(const Sweep& sweep, Prediction& prediction) {
  if (sweep.clock_sigma_s > 0.0) {
    Vector6d way = Vector6d::Zero();  // in a second
    way << prediction.state.v_odom_mps, prediction.path.back().angular_radps;
    way *= sweep.clock_sigma_s;
    prediction.covariance.topLeftCorner<6, 6>() += way * way.transpose();
  }
}

UpdateResult ScanFilter::update(const Prediction& prediction, ScanMatcher& matcher) {
  const IterationLimits limits = limits_of(config_.matching);
  const auto timed = [&](const auto& linearise) {
    begin(Stage::kMatch);
    auto information = linearise();
    unbent_ = unbent_share(prediction.covariance, information);
    keep_unbent(unbent_, information);
    begin(Stage::kSolve);
    return information;
  };
  return iterated_update(
      prediction.state,
      prediction.covariance,
      [&](const Pose& T_odom_base) {
        return timed([&] { return matcher.linearise(T_odom_base); });
      },
      limits);
}

UpdateResult ScanFilter::match(const Prediction& prediction,
                               const PointCloud& thinned_base,
                               ScanOutcome& outcome) {
  ScanMatcher matcher(
      thinned_base, *map_, prediction.state.T_base_lidar, config_.matching, *workers_);
  UpdateResult result = update(prediction, matcher);
  outcome.used = result.used;
  known_by_patches_.setZero();
  if (result.used && result.measured.weight_per_m2 > 0.0) {
    blind_ = blindness(result.measured.information.topLeftCorner<3, 3>());
    PoseInformation known;
    known.information = matcher.information_by_patches();
    keep_unbent(unbent_, known);
    known_by_patches_ = beyond(result.measured.information, known.information);
  }
  outcome.matches = result.count;
  outcome.iterations = result.iterations;
  outcome.observability = result.observability;
  outcome.share_within_10_cm = matcher.share_within(0.1);
  return result;
}

void ScanFilter::shape(const Sweep& sweep,
                       const Prediction& prediction,
                       ScanOutcome& outcome) const {
  begin(Stage::kUndistort);
  outcome.points_base = undistort(sweep, prediction.path, prediction.state.T_base_lidar);
  begin(Stage::kDownsample);
  outcome.thinned_base = downsample(outcome.points_base, config_.matching.voxel_m);
  outcome.points = outcome.thinned_base.size();
}

/// Where the motion within the sweep was a guess, the match tells better how the sweep is to be
/// undistorted; then it is matched anew.
UpdateResult ScanFilter::match_guessed(const Sweep& sweep,
                                       Prediction& prediction,
                                       ScanOutcome& outcome) {
  UpdateResult result = match(prediction, outcome.thinned_base, outcome);
  for (int i = 0; i < kMostReshapes && result.used; ++i) {
    const Pose T_end_found =
        prediction.path.back().T_odom_base.inverse() * result.state.T_odom_base;
    if (T_end_found.p.norm() < kSmear_m && so3_log(T_end_found.q).norm() < kSmear_rad) {
      break;
    }
    prediction.path = prediction.path.ending_at(result.state.T_odom_base);
    shape(sweep, prediction, outcome);
    result = match(prediction, outcome.thinned_base, outcome);
  }
  return result;
}

void ScanFilter::begin(Stage stage) const {
  if (observe_) {
    observe_(stage);
  }
}

void ScanFilter::take_over(Past past) {
  aligned_ = past.aligned;
  distance_m_ = past.distance_m;
  drift_covariance_ = past.drift_covariance;
  map_ = std::move(past.map);
  pruned_at_m_ = state().T_odom_base.p;
  searched_at_m_ = distance_m_;
}

bool ScanFilter::search(const PoseSearch& look,
                        const PointCloud& thinned_base,
                        Prediction& prediction) {
  const Sighting sighting = look(prediction.state, prediction.covariance, thinned_base);
  if (sighting.match_as_usual || !sighting.T_odom_base) {
    return sighting.match_as_usual;
  }
  const Pose& found = *sighting.T_odom_base;
  Matrix3d covariance_m2 =
      Vector3d(kFoundPlace_m, kFoundPlace_m, kFoundHeight_m).cwiseAbs2().asDiagonal();
  covariance_m2.topLeftCorner<2, 2>() += sighting.spread_m2;
  const Matrix3d position = covariance_m2.inverse();
  // An ordinary measurement of the whole pose: the cross-covariances that grew while the IMU was
  // alone correct velocity and biases with it. d Log(R_found^T R exp(e)) / de = J_r^-1.
  const UpdateResult result = iterated_update(
      prediction.state,
      prediction.covariance,
      [&](const Pose& T) {
        const Vector3d turn = so3_log(found.q.conjugate() * T.q);
        const Matrix3d J = so3_right_jacobian_inverse(turn);
        constexpr double kRotation = 1.0 / (kFoundRotation_rad * kFoundRotation_rad);
        PoseInformation pose;
        pose.information.topLeftCorner<3, 3>() = position;
        pose.information.bottomRightCorner<3, 3>() = kRotation * J.transpose() * J;
        pose.gradient.head<3>() = position * (T.p - found.p);
        pose.gradient.tail<3>() = kRotation * J.transpose() * turn;
        pose.count = static_cast<std::size_t>(config_.matching.min_matches);
        return pose;
      },
      limits_of(config_.matching));
  prediction.state = result.state;
  prediction.covariance = result.covariance;
  prediction.transition = (result.transition * prediction.transition).eval();
  if (result.used) {
    searched_at_m_ = distance_m_;
  }
  return result.used;
}

void ScanFilter::compare_with_gyro(const UpdateResult& result,
                                   Nanoseconds stamp_ns,
                                   const ImuBuffer& imu) {
  const auto attitude = result.used ? attitude_of_scan(result) : std::nullopt;
  const bool gap = imu.longest_gap_s(this->stamp_ns(), stamp_ns) > config_.imu.max_gap_s;
  learn_from(attitude && !gap ? windows_.add(stamp_ns, *attitude, result.state.gyro_bias_radps, imu)
                              : windows_.interrupt());
}

void ScanFilter::learn_from(const AttitudeWindow& window) {
  clock_offset_.add(window);
  if (config_.extrinsic.estimate) {
    extrinsic_rotation_.add(window, extrinsic_taken_rad_);
  }
}

/// Takes what is known of the extrinsic by now. The LiDAR stays where it is in odom, as scans hold
/// it there; base turns under it. The accelerometer had been at odds with it: by how much that went
/// into gravity, by which the map is tilted, and how much into the bias, is open.
void ScanFilter::turn_extrinsic(Prediction& prediction) {
  State& state = prediction.state;
  const double turn_rad =
      (extrinsic_rotation_.certain_turn_base_rad() - extrinsic_taken_rad_).norm();
  if (turn_rad > kLeastCorrection_rad) {
    windows_.interrupt();  // what follows is compared with the gyro anew
    extrinsic_taken_rad_ = extrinsic_rotation_.certain_turn_base_rad();
    const State before = state;
    state.T_base_lidar.q = (so3_exp(extrinsic_taken_rad_) * T_base_lidar_.q).normalized();
    const Pose T_old_new = before.T_base_lidar * state.T_base_lidar.inverse();
    prediction.path = prediction.path.seen_from(T_old_new);
    state.T_odom_base = before.T_odom_base * T_old_new;
    add_tilt_noise(
        turn_rad * turn_rad * Eigen::Matrix2d::Identity(), state, aligned_, prediction.covariance);
    const double accel_mps2 = turn_rad * state.gravity_odom_mps2.norm();
    prediction.covariance.diagonal().segment<3>(error::kAccelBias).array() +=
        accel_mps2 * accel_mps2;
  }
  const Matrix3d R_lidar_base = state.T_base_lidar.q.toRotationMatrix().transpose();
  prediction.covariance.block<3, 3>(error::kExtrinsicRotation, error::kExtrinsicRotation) =
      R_lidar_base * extrinsic_rotation_.certain_covariance() * R_lidar_base.transpose();
}

ScanOutcome ScanFilter::process(const Sweep& sweep, const ImuBuffer& imu, const PoseSearch& look) {
  begin(Stage::kPredict);
  Prediction prediction = predict(sweep, imu);
  if (config_.extrinsic.estimate) {
    turn_extrinsic(prediction);
  }
  add_drift(prediction);
  add_clock_noise(sweep, prediction);
  add_blind_tilt_noise(config_.drift,
                       to_seconds(sweep.end_ns - stamp_ns()),
                       blind_,
                       prediction.state,
                       aligned_,
                       prediction.covariance);

  ScanOutcome outcome;
  shape(sweep, prediction, outcome);
  outcome.first = map_->empty();

  begin(Stage::kSolve);
  const bool match_it = !outcome.first && (!look || search(look, outcome.thinned_base, prediction));
  ScanRecord record;
  record.stamp_ns = sweep.end_ns;
  record.before_rows = prediction.state;
  record.covariance_before_rows = prediction.covariance;
  record.transition = prediction.transition;
  known_by_patches_.setZero();
  if (outcome.first) {
    outcome.used = outcome.points >= static_cast<std::size_t>(config_.matching.min_matches);
  } else if (match_it) {
    const UpdateResult result = prediction.guessed
                                    ? match_guessed(sweep, prediction, outcome)
                                    : match(prediction, outcome.thinned_base, outcome);
    compare_with_gyro(result, sweep.end_ns, imu);
    record.before_rows = result.state;
    record.covariance_before_rows = result.covariance;
    record.transition = result.transition * prediction.transition;
  } else {
    learn_from(windows_.interrupt());
  }
  record.path = std::move(prediction.path);
  history_.push(std::move(record));
  return outcome;
}

PointCloud ScanFilter::insert(const ScanOutcome& outcome) {
  begin(Stage::kInsert);
  const Vector3d& p = state().T_odom_base.p;
  const double sigma2 = Eigen::SelfAdjointEigenSolver<Matrix3d>(covariance().topLeftCorner<3, 3>(),
                                                                Eigen::EigenvaluesOnly)
                            .eigenvalues()
                            .maxCoeff();
  if (sigma2 < kPlacedSigma_m * kPlacedSigma_m ||
      (searched_at_m_ && distance_m_ - *searched_at_m_ >= kMostKeptOut_m)) {
    searched_at_m_.reset();
  }
  PointCloud points_odom;
  if (is_placed() && (outcome.used || sigma2 < kMapSigma_m * kMapSigma_m)) {
    points_odom = transformed(outcome.thinned_base, state().T_odom_base);
    map_->insert(points_odom);
  }
  if ((p - pruned_at_m_).norm() > config_.local_map.prune_every_m) {
    map_->prune(p, config_.local_map.half_side_m);
    pruned_at_m_ = p;
  }
  return points_odom;
}

Calibration ScanFilter::calibration() const {
  Calibration calibration;
  calibration.T_base_lidar = state().T_base_lidar;
  // The filter has the rotation first.
  Eigen::Matrix<double, 6, 6> swap = Eigen::Matrix<double, 6, 6>::Zero();
  swap.topRightCorner<3, 3>().setIdentity();
  swap.bottomLeftCorner<3, 3>().setIdentity();
  calibration.extrinsic_covariance =
      swap * covariance().block<6, 6>(error::kExtrinsicRotation, error::kExtrinsicRotation) *
      swap.transpose();
  if (const auto clock = clock_offset_.estimate()) {
    calibration.clock_offset_s = clock->offset_s;
    calibration.clock_offset_sigma_s = clock->sigma_s;
  }
  return calibration;
}

void ScanFilter::align(const Alignment& alignment) {
  history_.align(alignment);
  aligned_ = true;
}

RowVerdict ScanFilter::apply(const StateUpdate& update) {
  if (!aligned_) {
    return {RowOutcome::kRefused, "not_aligned"};
  }
  return history_.apply(update);
}

Matrix6d ScanFilter::pose_covariance_in_local_map() const {
  Matrix6d to_odom = Matrix6d::Identity();
  to_odom.bottomRightCorner<3, 3>() = state().T_odom_base.q.toRotationMatrix();
  return to_odom * stated_covariance().topLeftCorner<6, 6>() * to_odom.transpose();
}

ErrorMatrix ScanFilter::stated_covariance() const {
  return conditioned(covariance(), known_by_patches_);
}

Matrix6d ScanFilter::placement_covariance() const {
  Eigen::Matrix<double, 6, error::kSize> by_state = Eigen::Matrix<double, 6, error::kSize>::Zero();
  by_state.block<4, 4>(0, error::kYawMapOdom).setIdentity();
  by_state.block<2, 2>(4, error::kGravity) = tilt_by_gravity(state().gravity_odom_mps2);
  return by_state * covariance() * by_state.transpose();
}

Matrix6d ScanFilter::pose_covariance() const {
  const Matrix6d jacobian = transport(state().T_odom_base.p);
  return pose_covariance_in_local_map() + jacobian * drift_covariance_ * jacobian.transpose();
}

}  // namespace trigpoint::lio_mapper
