// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "drive.hpp"

#include "trigpoint/base/so3.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::gps_odometry {

namespace {

constexpr double kG = 9.80665;
constexpr double kTruthStep_s = 1e-3;

double ramp(double time_s, double rest_s, double speed_mps) {
  return std::clamp(time_s - rest_s, 0.0, speed_mps);
}

}  // namespace

Profile circle(double speed_mps, double yaw_rate_radps, double rest_s) {
  Profile profile;
  profile.speed_mps = [=](double t) { return ramp(t, rest_s, speed_mps); };
  // The turn grows smoothly over two seconds once the speed is reached and 4 s were driven
  // straight.
  const double start_s = rest_s + speed_mps + 4.0;
  profile.yaw_rate_radps = [=](double t) {
    const double u = std::clamp((t - start_s) / 2.0, 0.0, 1.0);
    return yaw_rate_radps * u * u * (3.0 - 2.0 * u);
  };
  return profile;
}

Profile town(double speed_mps, double rest_s) {
  constexpr double kLeg_s = 12.0;
  constexpr double kTurn_s = 4.0;
  Profile profile;
  profile.speed_mps = [=](double t) {
    const double leg = std::fmod(std::max(t - rest_s, 0.0), 2.0 * kLeg_s);
    const double slow = leg > 20.0 ? 0.4 * std::sin(std::numbers::pi * (leg - 20.0) / 4.0) : 0.0;
    return ramp(t, rest_s, speed_mps) * (1.0 - slow);
  };
  profile.yaw_rate_radps = [=](double t) {
    const double driven = t - rest_s;
    const int index = static_cast<int>(driven / kLeg_s);
    const double phase = driven - kLeg_s * index - (kLeg_s - kTurn_s);
    if (driven < 0.0 || phase < 0.0) {
      return 0.0;
    }
    const double side = (index % 3 == 2) ? -1.0 : 1.0;
    // Area pi/2 with smooth ends.
    return side * (std::numbers::pi / 2.0) / kTurn_s *
           (1.0 - std::cos(2.0 * std::numbers::pi * phase / kTurn_s));
  };
  profile.yaw_start_rad = 0.7;
  return profile;
}

Profile errands(double speed_mps, double rest_s) {
  constexpr double kErrand_s = 40.0;
  constexpr double kStop_s = 4.0;
  Profile profile = town(1.0, rest_s);
  const auto turn = profile.yaw_rate_radps;
  // Share of the speed: up and down at 1 m/s^2, a stop at the end of every errand.
  const auto share = [=](double t) {
    const double phase = std::fmod(std::max(t - rest_s, 0.0), kErrand_s);
    const double left_s = kErrand_s - kStop_s - phase;
    return std::clamp(std::min(phase, left_s) / speed_mps, 0.0, 1.0);
  };
  profile.speed_mps = [=](double t) { return speed_mps * share(t); };
  profile.yaw_rate_radps = [=](double t) {
    return share(t) * (turn(t) + 0.08 * std::sin(2.0 * std::numbers::pi * t / 7.0));
  };
  return profile;
}

Profile reverse_start(double speed_mps, double rest_s) {
  constexpr double kBack_s = 6.0;
  Profile profile = town(speed_mps, rest_s + kBack_s + 2.0);
  const auto forward = profile.speed_mps;
  profile.speed_mps = [=](double t) {
    const double since = t - rest_s;
    const double back = std::clamp(std::min(since, kBack_s - since), 0.0, 0.8);
    return forward(t) - back;
  };
  return profile;
}

Pose Truth::T_map_base() const {
  return {from_yaw(yaw_rad), position_map_m};
}

std::vector<Truth> drive(const Profile& profile, double duration_s) {
  std::vector<Truth> truth;
  Truth now;
  now.yaw_rad = profile.yaw_start_rad;
  const auto steps = static_cast<int>(duration_s / kTruthStep_s);
  for (int i = 0; i <= steps; ++i) {
    const double t = i * kTruthStep_s;
    now.time_s = t;
    now.speed_mps = profile.speed_mps(t);
    now.yaw_rate_radps = profile.yaw_rate_radps(t);
    now.forward_accel_mps2 = (profile.speed_mps(t + 1e-4) - profile.speed_mps(t - 1e-4)) / 2e-4;
    truth.push_back(now);
    // Midpoint rule.
    const double speed = profile.speed_mps(t + 0.5 * kTruthStep_s);
    const double rate = profile.yaw_rate_radps(t + 0.5 * kTruthStep_s);
    const double middle = now.yaw_rad + 0.5 * kTruthStep_s * now.yaw_rate_radps;
    now.position_map_m +=
        kTruthStep_s * speed * Eigen::Vector3d(std::cos(middle), std::sin(middle), 0.0);
    now.yaw_rad += kTruthStep_s * rate;
  }
  return truth;
}

Datum test_datum() {
  return {49.011, 8.4167, 114.0, 0};
}

Nanoseconds stamp_of(double time_s) {
  return kEpoch_ns + from_seconds(time_s);
}

GnssFix fix_at(const Eigen::Vector3d& antenna_map_m, double time_s, double sigma_m) {
  static const geodesy::LocalFrame frame(test_datum());
  const geodesy::Geographic place = frame.to_geographic(antenna_map_m);
  GnssFix fix;
  fix.stamp_ns = stamp_of(time_s);
  fix.status = FixStatus::kGbas;
  fix.latitude_deg = place.latitude_deg;
  fix.longitude_deg = place.longitude_deg;
  fix.altitude_m = place.height_m;
  fix.covariance_enu_m2 = Eigen::Vector3d(sigma_m, sigma_m, 1.8 * sigma_m).cwiseAbs2().asDiagonal();
  fix.covariance_type = CovarianceType::kDiagonalKnown;
  return fix;
}

ImuSample imu_at(double time_s) {
  ImuSample imu;
  imu.stamp_ns = stamp_of(time_s);
  // A sensor's last digits always move.
  imu.gyro_radps = Eigen::Vector3d::Constant(1e-5 * std::sin(1e3 * time_s));
  imu.accel_mps2 = {1e-4 * std::cos(1e3 * time_s), 0.0, kG};
  return imu;
}

std::vector<Input> sense(const std::vector<Truth>& truth, const Sensors& s, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) {
    return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  const Eigen::Quaterniond q_imu_base = s.robot.q_base_imu().conjugate();
  std::vector<Input> inputs;
  const auto imu_every = static_cast<std::size_t>(std::lround(1.0 / (s.imu_hz * kTruthStep_s)));
  const auto fix_every = static_cast<std::size_t>(std::lround(1.0 / (s.fix_hz * kTruthStep_s)));
  Eigen::Vector3d wander = noise(s.wander_sigma_m);
  const double keep = std::exp(-1.0 / (s.fix_hz * s.wander_tau_s));
  const auto shaken = [&](double sigma, double vibration, bool moves) {
    return moves ? std::hypot(sigma, vibration) : sigma;
  };
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Truth& now = truth[i];
    const bool moves = std::abs(now.speed_mps) > 0.01;
    if (i % imu_every == 0) {
      Input input;
      input.available_s = now.time_s + 1e-3;
      input.imu.stamp_ns = stamp_of(now.time_s);
      input.imu.gyro_radps = q_imu_base * Eigen::Vector3d(0.0, 0.0, now.yaw_rate_radps) +
                             s.gyro_bias_radps +
                             noise(shaken(s.gyro_noise_radps, s.gyro_vibration_radps, moves));
      input.imu.accel_mps2 =
          q_imu_base *
              Eigen::Vector3d(now.forward_accel_mps2, now.speed_mps * now.yaw_rate_radps, kG) +
          s.accel_bias_mps2 + noise(shaken(s.accel_noise_mps2, s.accel_vibration_mps2, moves));
      inputs.push_back(input);
    }
    if (i % fix_every == 0) {
      wander = keep * wander + noise(s.wander_sigma_m * std::sqrt(1.0 - keep * keep));
      const Eigen::Vector3d error = wander + noise(s.white_sigma_m);
      if (now.time_s < s.outage_from_s || now.time_s >= s.outage_to_s) {
        Input input;
        input.is_fix = true;
        input.available_s = now.time_s + s.latency_s;
        const Eigen::Vector3d antenna = now.T_map_base() * s.robot.antenna_position_base_m;
        input.fix = fix_at(antenna + error.cwiseProduct(Eigen::Vector3d(1.0, 1.0, 1.8)),
                           now.time_s,
                           s.reported_sigma_m);
        input.fix.status = s.status;
        inputs.push_back(input);
      }
    }
  }
  std::stable_sort(inputs.begin(), inputs.end(), [](const Input& a, const Input& b) {
    return a.available_s < b.available_s;
  });
  return inputs;
}

Recorded run(GpsOdometry& filter,
             const std::vector<Input>& inputs,
             const std::vector<Truth>& truth) {
  Recorded result;
  for (const Input& input : inputs) {
    Output output = input.is_fix ? filter.on_fix(input.fix) : filter.on_imu(input.imu);
    result.events.insert(result.events.end(), output.events.begin(), output.events.end());
    if (output.status) {
      result.statuses.push_back(*output.status);
    }
    if (!output.odometry) {
      continue;
    }
    const Odometry& odometry = *output.odometry;
    result.odometry.push_back(odometry);
    const double time_s = to_seconds(odometry.stamp_ns - kEpoch_ns);
    const auto index = static_cast<std::size_t>(std::lround(time_s / kTruthStep_s));
    const Truth& now = truth.at(std::min(index, truth.size() - 1));
    Sample sample;
    sample.time_s = time_s;
    sample.error_m = odometry.T_frame_child.p - now.position_map_m;
    sample.sigma_m = odometry.pose_covariance.diagonal().head<3>().cwiseSqrt();
    sample.yaw_error_rad = wrap_angle(yaw_of(odometry.T_frame_child.q) - now.yaw_rad);
    sample.yaw_sigma_rad = std::sqrt(odometry.pose_covariance(5, 5));
    sample.speed_mps = odometry.linear_mps.x();
    result.samples.push_back(sample);
  }
  return result;
}

double rms_m(const std::vector<Sample>& samples, double from_s, double to_s) {
  double sum = 0.0;
  int count = 0;
  for (const Sample& sample : samples) {
    if (sample.time_s >= from_s && sample.time_s < to_s) {
      sum += sample.error_m.squaredNorm();
      ++count;
    }
  }
  return count == 0 ? std::nan("") : std::sqrt(sum / count);
}

std::uint64_t count_of(const GpsStatus& status, const std::string& reason) {
  for (const NamedCount& count : status.rejections) {
    if (count.name == reason) {
      return count.count;
    }
  }
  return 0;
}

Config config_with_datum(const std::string& filter) {
  Config config;
  config.filter = filter;
  config.use_configured_datum = true;
  config.datum_latitude_deg = test_datum().latitude_deg;
  config.datum_longitude_deg = test_datum().longitude_deg;
  config.datum_height_m = test_datum().height_m;
  return config;
}

}  // namespace trigpoint::gps_odometry
