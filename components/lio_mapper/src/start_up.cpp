// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "start_up.hpp"

#include "trigpoint/base/sentence.hpp"
#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double kRestGyro_radps = 0.03;
constexpr double kRestGyroSpread_radps = 0.03;
constexpr double kRestForceChange_mps2 = 0.1;
/// A speed must fit this much better (share of points) than standing still to be believed.
constexpr double kClearlyBetter = 0.03;
constexpr double kBackwardSpeed_mps = 4.0;
constexpr double kLongestStillStep_s = 0.02;
/// Over the waiting sweeps, by a robot that seemed to stand.
constexpr double kMoved_m = 0.1;
constexpr double kMovedSigmas = 5.0;
constexpr double kTiltMoving_rad = 0.1;
/// The trial matches against a map that its own first motion built.
constexpr double kTrialSigmaFactor = 2.0;
constexpr double kVelocityMoving_mps = 0.5;
/// A sweep that leaves more than this share of a speed's prior sigma has not seen the speed.
constexpr double kUnseenSpeed = 0.5;
/// Of the first velocity where no scan tells it: most robots start at rest or at a walking pace.
constexpr double kVelocityUnseen_mps = 2.0;
/// A trial corrects about half of what its speed is wrong by, because it undistorts the first sweep
/// with it.
constexpr int kMostRefinements = 6;
constexpr double kSettled_mps = 0.1;
/// Trials that began a step or more apart and end so near to each other, in steps, found the same
/// speed.
constexpr double kAgreeing = 0.25;
/// The share of points that a speed beside walls reaches of that which rings on the ground give to
/// standing still.
constexpr double kNearlyAsGood = 0.85;
constexpr int kTrials = 3;

Eigen::Quaterniond without_yaw(const Eigen::Quaterniond& q) {
  return (from_yaw(-yaw_of(q)) * q).normalized();
}

/// The same start with another velocity (base axes).
InitialState with_velocity(InitialState initial, const Vector3d& v_base_mps, double sigma_mps) {
  initial.state.v_odom_mps = initial.state.T_odom_base.q * v_base_mps;
  initial.covariance.block<3, 3>(error::kVelocity, error::kVelocity) =
      sigma_mps * sigma_mps * Matrix3d::Identity();
  return initial;
}

struct Trial {
  double share{0.0};
  Vector3d v_base_mps{Vector3d::Zero()};  ///< at the start, as the second scan corrected it
  double forward_sigma_mps{0.0};          ///< after the second scan
};

/// Runs the first two sweeps from `initial` and tells how well the second fits the first.
Trial try_start(const Config& config,
                const Pose& T_base_lidar,
                const ImuBuffer& imu,
                const std::deque<Sweep>& sweeps,
                const InitialState& initial) {
  ScanFilter filter(config, T_base_lidar, initial);
  filter.insert(filter.process(sweeps[0], imu));
  State unaided = filter.state();
  for (const InertialStep& step :
       imu.steps_between(filter.stamp_ns(), sweeps[1].end_ns, kLongestStillStep_s)) {
    unaided = propagate(unaided, step);
  }
  const ScanOutcome outcome = filter.process(sweeps[1], imu);
  const Vector3d correction_mps = filter.state().v_odom_mps - unaided.v_odom_mps;
  const Vector3d forward_odom = filter.state().T_odom_base.q * Vector3d::UnitX();
  const double forward_variance = forward_odom.dot(
      filter.covariance().block<3, 3>(error::kVelocity, error::kVelocity) * forward_odom);
  return {outcome.used ? outcome.share_within_10_cm : 0.0,
          initial.state.T_odom_base.q.conjugate() * (initial.state.v_odom_mps + correction_mps),
          std::sqrt(std::max(0.0, forward_variance))};
}

struct FirstVelocity {
  Vector3d base_mps;
  bool is_seen;  ///< by the sweeps, along base x
};

/// Zero unless a forward speed explains the second sweep clearly better, or several trials lead to
/// one speed and the sweep does not lock to standing still. A speed counts only where the sweep
/// determines it: on a plain all fit alike, and by which of them more points find a plane is
/// chance. A robot that stands sees also that; beside long walls, on which most of a scan fits at
/// any speed, the rings on the ground make standing still fit better than driving does, by a tenth.
/// Cars that come along fit at their speed, but the ground does not.
FirstVelocity find_velocity(const Config& config,
                            const Pose& T_base_lidar,
                            const ImuBuffer& imu,
                            const std::deque<Sweep>& sweeps,
                            const InitialState& initial) {
  const double step_mps = config.start.speed_step_mps;
  const auto attempt = [&](const Vector3d& v_base_mps) {
    return try_start(
        config, T_base_lidar, imu, sweeps, with_velocity(initial, v_base_mps, step_mps));
  };
  const auto sees_speed = [step_mps](const Trial& trial) {
    return trial.forward_sigma_mps < kUnseenSpeed * step_mps;
  };
  const auto refined = [&](Trial trial) {
    for (int i = 0; i < kMostRefinements && sees_speed(trial); ++i) {
      const Vector3d tried_mps = trial.v_base_mps;
      trial = attempt(tried_mps);
      if ((trial.v_base_mps - tried_mps).norm() < kSettled_mps) {
        break;
      }
    }
    return trial;
  };
  const Trial from_rest = refined(attempt(Vector3d::Zero()));
  const bool sees_rest = sees_speed(from_rest);
  std::vector<Trial> seen;
  for (double speed = -kBackwardSpeed_mps; speed <= config.start.max_speed_mps; speed += step_mps) {
    const Trial trial = speed == 0.0 ? from_rest : refined(attempt(speed * Vector3d::UnitX()));
    if (sees_speed(trial)) {
      seen.push_back(trial);
    }
  }
  const auto agreeing = [&](const Trial& trial) {
    return std::count_if(seen.begin(), seen.end(), [&](const Trial& other) {
      return (other.v_base_mps - trial.v_base_mps).norm() < kAgreeing * step_mps;
    });
  };
  const FirstVelocity rest{sees_rest ? from_rest.v_base_mps : Vector3d::Zero(), sees_rest};
  const Trial* best = nullptr;
  for (const Trial& trial : seen) {
    const bool is_clear = trial.share > from_rest.share + kClearlyBetter;
    const bool locks_only_there =
        !sees_rest && agreeing(trial) > 1 && trial.share > kNearlyAsGood * from_rest.share;
    if ((is_clear || locks_only_there) && (best == nullptr || trial.share > best->share)) {
      best = &trial;
    }
  }
  return best != nullptr ? FirstVelocity{best->v_base_mps, true} : rest;
}

/// A start as a trial run over the waiting sweeps corrects it.
struct Relevelled {
  Vector3d gravity_base_mps2;  ///< axes of base at the start
  Vector3d v_base_mps;         ///< at the start
  double tilt_sigma_rad;
  bool has_moved;
};

/// Gravity and first velocity after a trial run over all sweeps that the IMU covers. The velocity
/// at the end is known from the map; the IMU leads from there back to the start.
Relevelled relevel(const Config& config,
                   const Pose& T_base_lidar,
                   const ImuBuffer& imu,
                   const std::deque<Sweep>& sweeps,
                   const InitialState& initial) {
  ScanFilter filter(config, T_base_lidar, initial);
  for (const Sweep& sweep : sweeps) {
    if (sweep.end_ns <= imu.newest_ns()) {
      filter.insert(filter.process(sweep, imu));
    }
  }
  State unaided = filter.state();
  unaided.T_odom_base = initial.state.T_odom_base;
  unaided.v_odom_mps.setZero();
  for (const InertialStep& step :
       imu.steps_between(initial.stamp_ns, filter.stamp_ns(), kLongestStillStep_s)) {
    unaided = propagate(unaided, step);
  }
  const Eigen::Quaterniond q_base_odom = initial.state.T_odom_base.q.conjugate();
  const double variance = filter.covariance().diagonal().segment<2>(error::kGravity).maxCoeff();
  Vector3d moved_m = filter.state().T_odom_base.p - initial.state.T_odom_base.p;
  moved_m.z() = 0.0;
  const Vector3d way = moved_m.normalized();
  const Matrix3d moved_m2 = filter.covariance().block<3, 3>(error::kPosition, error::kPosition);
  const double moved_sigma_m = std::sqrt(std::max(0.0, way.dot(moved_m2 * way)));
  return {q_base_odom * filter.state().gravity_odom_mps2,
          q_base_odom * (filter.state().v_odom_mps - unaided.v_odom_mps),
          kTrialSigmaFactor * std::sqrt(variance),
          moved_m.norm() > std::max(kMoved_m, kMovedSigmas * moved_sigma_m)};
}

Nanoseconds start_stamp(const ImuBuffer& imu, const std::deque<Sweep>& sweeps) {
  return std::max(imu.oldest_ns(), sweeps.front().begin_ns);
}

/// What the accelerometer's bias is not known by, odom's level is not known by either.
void add_bias_with_tilt(const Matrix3d& covariance_m2ps4, InitialState& initial) {
  const State& state = initial.state;
  // dg = R db, and dg = D e with D = -[g]x B, D^T D = |g|^2 I, so e = D^T R db / |g|^2.
  const Eigen::Matrix<double, 3, 2> D =
      -hat(state.gravity_odom_mps2) * gravity_tangent(state.gravity_odom_mps2);
  const Eigen::Matrix<double, 2, 3> by_bias = D.transpose() *
                                              state.T_odom_base.q.toRotationMatrix() /
                                              (kStandardGravity_mps2 * kStandardGravity_mps2);
  const Eigen::Matrix<double, 2, 3> cross = by_bias * covariance_m2ps4;
  ErrorMatrix& P = initial.covariance;
  P.block<3, 3>(error::kAccelBias, error::kAccelBias) += covariance_m2ps4;
  P.block<2, 2>(error::kGravity, error::kGravity) += cross * by_bias.transpose();
  P.block<2, 3>(error::kGravity, error::kAccelBias) += cross;
  P.block<3, 2>(error::kAccelBias, error::kGravity) += cross.transpose();
}

}  // namespace

ImuSummary summarize(const ImuBuffer& imu, Nanoseconds from_ns, Nanoseconds to_ns) {
  ImuSummary summary;
  const auto steps = imu.steps_between(from_ns, to_ns, kLongestStillStep_s);
  summary.count = steps.size();
  if (steps.empty()) {
    return summary;
  }
  Eigen::Quaterniond q_begin_base = Eigen::Quaterniond::Identity();
  std::array<Vector3d, 2> half_sums{Vector3d::Zero(), Vector3d::Zero()};
  std::array<double, 2> half_s{};
  Vector3d turned_rad = Vector3d::Zero();
  double square = 0.0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double dt_s = steps[i].duration_s();
    const Vector3d gyro = 0.5 * (steps[i].begin.gyro_radps + steps[i].end.gyro_radps);
    const std::size_t half = 2 * i < steps.size() ? 0 : 1;
    const Eigen::Quaterniond q_begin_end = (q_begin_base * so3_exp(gyro * dt_s)).normalized();
    half_sums[half] +=
        0.5 * dt_s *
        (q_begin_base * steps[i].begin.accel_mps2 + q_begin_end * steps[i].end.accel_mps2);
    half_s[half] += dt_s;
    turned_rad += dt_s * gyro;
    square += dt_s * gyro.squaredNorm();
    q_begin_base = q_begin_end;
  }
  const double duration_s = half_s[0] + half_s[1];
  summary.mean_gyro_radps = turned_rad / duration_s;
  summary.mean_force_mps2 = q_begin_base.conjugate() * ((half_sums[0] + half_sums[1]) / duration_s);
  if (half_s[1] > 0.0) {
    summary.force_change_mps2 = (half_sums[1] / half_s[1] - half_sums[0] / half_s[0]).norm();
  }
  summary.gyro_spread_radps =
      std::sqrt(std::max(0.0, square / duration_s - summary.mean_gyro_radps.squaredNorm()));
  return summary;
}

std::optional<Event> check_specific_force(const Vector3d& force_mps2, Nanoseconds stamp_ns) {
  const double norm = force_mps2.norm();
  if (norm > 0.8 && norm < 1.2) {
    return Event{Severity::kError,
                 stamp_ns,
                 "imu_in_g",
                 sentence("mean specific force is %.3f, expected %.2f m/s^2: the accelerometer "
                          "seems to speak in g; multiply it by 9.80665",
                          norm,
                          kStandardGravity_mps2)};
  }
  if (norm < 8.5 || norm > 11.5) {
    return Event{Severity::kError,
                 stamp_ns,
                 "imu_force_implausible",
                 sentence("mean specific force is %.3f m/s^2, expected about %.2f: check the "
                          "accelerometer's unit and whether gravity was taken out",
                          norm,
                          kStandardGravity_mps2)};
  }
  if (force_mps2.z() < 0.0) {
    return Event{Severity::kError,
                 stamp_ns,
                 "imu_upside_down",
                 sentence("specific force along base_link's z is %.2f m/s^2 at the start, expected "
                          "%+.2f: the IMU is upside down; set robot.imu_roll_pitch_yaw_base_rad "
                          "(for a half turn about x: 3.14159, 0, 0)",
                          force_mps2.z(),
                          kStandardGravity_mps2)};
  }
  return std::nullopt;
}

bool looks_at_rest(const ImuSummary& summary) {
  return summary.mean_gyro_radps.norm() < kRestGyro_radps &&
         summary.gyro_spread_radps < kRestGyroSpread_radps &&
         summary.force_change_mps2 < kRestForceChange_mps2;
}

void add_unknown_mounting(double sigma_rad, InitialState& initial) {
  const Vector3d up_base = initial.state.T_odom_base.q.conjugate() * Vector3d::UnitZ();
  const double force_mps2 = sigma_rad * kStandardGravity_mps2;
  add_bias_with_tilt(
      force_mps2 * force_mps2 * (Matrix3d::Identity() - up_base * up_base.transpose()), initial);
}

InitialState level(const Vector3d& force_base_mps2,
                   Nanoseconds stamp_ns,
                   const ImuConfig& imu,
                   const StartSigmas& sigmas) {
  InitialState initial;
  initial.stamp_ns = stamp_ns;
  State& state = initial.state;
  state.T_odom_base.q = without_yaw(rotation_between(force_base_mps2, Vector3d::UnitZ()));
  state.gravity_odom_mps2 = {0.0, 0.0, -kStandardGravity_mps2};

  constexpr double kByDefinition = 1e-4;
  ErrorMatrix& P = initial.covariance;
  const auto set = [&](int at, double sigma) {
    P.block<3, 3>(at, at) = sigma * sigma * Matrix3d::Identity();
  };
  set(error::kPosition, kByDefinition);
  set(error::kRotation, kByDefinition);
  set(error::kVelocity, sigmas.velocity_mps);
  set(error::kGyroBias, sigmas.gyro_bias_radps);
  const double bias2 = imu.initial_accel_bias_sigma_mps2 * imu.initial_accel_bias_sigma_mps2;
  add_bias_with_tilt(bias2 * Matrix3d::Identity(), initial);
  P.block<2, 2>(error::kGravity, error::kGravity) +=
      sigmas.tilt_rad * sigmas.tilt_rad * Eigen::Matrix2d::Identity();
  return initial;
}

bool can_start(const StartConfig& config, const ImuBuffer& imu, const std::deque<Sweep>& sweeps) {
  return !imu.empty() && sweeps.size() >= 2 && imu.newest_ns() >= sweeps[1].end_ns &&
         to_seconds(imu.newest_ns() - sweeps.front().begin_ns) >= config.window_s;
}

StartResult start(const Config& configured,
                  const Pose& T_base_lidar,
                  const ImuBuffer& imu,
                  const std::deque<Sweep>& sweeps) {
  // A trial is too short to say anything about the extrinsic.
  Config config = configured;
  config.extrinsic.estimate = false;
  StartResult result;
  const Nanoseconds stamp_ns = start_stamp(imu, sweeps);
  const Nanoseconds window_ns = from_seconds(config.start.window_s);
  const Nanoseconds from_ns = std::max(imu.oldest_ns(), stamp_ns - window_ns);
  const Nanoseconds to_ns = std::min(imu.newest_ns(), from_ns + window_ns);
  const ImuSummary summary = summarize(imu, from_ns, to_ns);
  // The summary is in base axes at the window's end; the start is at stamp_ns.
  const auto turn = [&](Nanoseconds a, Nanoseconds b) {
    Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
    for (const InertialStep& step : imu.steps_between(a, b, kLongestStillStep_s)) {
      q = q * so3_exp(0.5 * step.duration_s() * (step.begin.gyro_radps + step.end.gyro_radps));
    }
    return q.normalized();
  };
  const Vector3d force = turn(stamp_ns, to_ns) * summary.mean_force_mps2;
  result.trouble = check_specific_force(force, stamp_ns);
  if (result.trouble) {
    return result;
  }
  result.initial =
      level(force,
            stamp_ns,
            config.imu,
            {kTiltMoving_rad, kVelocityMoving_mps, config.imu.initial_gyro_bias_sigma_radps});
  FirstVelocity first{Vector3d::Zero(), true};
  if (sweeps.size() >= 2) {
    first = find_velocity(config, T_base_lidar, imu, sweeps, result.initial);
  }
  Vector3d v_base = first.base_mps;
  const double v_sigma_mps = first.is_seen ? kVelocityMoving_mps : kVelocityUnseen_mps;
  // Two sweeps alone leave decimetres a second; all that wait leave centimetres.
  const bool is_quiet = looks_at_rest(summary);
  bool has_moved = false;
  const auto stands = [&] {
    return is_quiet && !has_moved && v_base.norm() < config.start.rest_speed_mps;
  };
  const auto relevelled = [&](const Vector3d& from_v_base_mps) {
    return relevel(config,
                   T_base_lidar,
                   imu,
                   sweeps,
                   with_velocity(result.initial, from_v_base_mps, v_sigma_mps));
  };
  // Who drives off evenly seems to lean.
  has_moved = stands() && relevelled(Vector3d::Zero()).has_moved;
  for (int i = 0; i < kTrials && !stands(); ++i) {
    const Relevelled found = relevelled(v_base);
    has_moved = found.has_moved;
    v_base = found.v_base_mps;
    // The prior of the next trial is as open as the first one's: the same data must not count
    // twice.
    const bool last = i + 1 == kTrials;
    result.initial = level(-found.gravity_base_mps2,
                           stamp_ns,
                           config.imu,
                           {last ? found.tilt_sigma_rad : kTiltMoving_rad,
                            kVelocityMoving_mps,
                            config.imu.initial_gyro_bias_sigma_radps});
  }
  result.speed_mps = v_base.norm();
  result.at_rest = stands();
  if (result.at_rest) {
    StartSigmas sigmas;
    sigmas.velocity_mps = first.is_seen ? sigmas.velocity_mps : kVelocityUnseen_mps;
    result.initial = level(force, stamp_ns, config.imu, sigmas);
    result.initial.state.gyro_bias_radps = summary.mean_gyro_radps;
    result.initial.state.accel_bias_mps2 =
        (force.norm() - kStandardGravity_mps2) * force.normalized();
  } else {
    result.initial = with_velocity(result.initial, v_base, v_sigma_mps);
  }
  const ExtrinsicConfig& mounting = configured.extrinsic;
  add_unknown_mounting(mounting.estimate ? mounting.rotation_sigma_rad : mounting.level_sigma_rad,
                       result.initial);
  return result;
}

}  // namespace trigpoint::lio_mapper
