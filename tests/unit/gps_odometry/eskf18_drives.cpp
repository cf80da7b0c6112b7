// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "eskf18_drives.hpp"

#include "trigpoint/geodesy/local_frame.hpp"

#include "fix_checks.hpp"
#include "imu_checks.hpp"
#include "ins_tracker.hpp"
#include "rewind.hpp"
#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace trigpoint::gps_odometry {

namespace {

using Eigen::Vector3d;

constexpr double kOutageFrom_s = 83.0;  // after two errands, at the start of a leg

int axes_inside(const Sample& sample) {
  return static_cast<int>(
      (sample.error_m.cwiseAbs().array() < 1.96 * sample.sigma_m.array()).count());
}

/// The filter without its face: covariances as they are, without floors and holds.
class RawFilter {
 public:
  RawFilter(const Config& config, const RobotConfig& robot)
      : config_(config),
        frame_(test_datum()),
        checks_(config, robot.q_base_imu()),
        tracker_(config, robot.antenna_position_base_m),
        buffer_(tracker_, from_seconds(config.rewind_s)) {}

  void take(const Input& input) {
    if (!input.is_fix) {
      if (const auto verdict = checks_.check(input.imu); verdict.sample) {
        buffer_.insert(*verdict.sample);
      }
      return;
    }
    const auto verdict = check_fix(input.fix, config_);
    if (verdict.fix && buffer_.newest_imu_ns()) {
      buffer_.insert(MapFix{
          *verdict.fix, frame_.to_map(verdict.fix->place).value(), verdict.fix->covariance_enu_m2});
    }
  }

  const InsTrack& track() const { return buffer_.newest(); }

 private:
  Config config_;
  geodesy::LocalFrame frame_;
  ImuChecks checks_;
  InsTracker tracker_;
  RewindBuffer<InsTracker> buffer_;
};

/// The filter is told what the truth is made of.
Config matched_config(const Sensors& sensors) {
  Config config = config_with_datum("eskf18");
  const double reported = sensors.reported_sigma_m * sensors.reported_sigma_m;
  config.fix_sigma_scale = 1.0;
  Eskf18Config& c = config.eskf18;
  c.fix_white_share = sensors.white_sigma_m * sensors.white_sigma_m / reported;
  c.fix_slow_share = sensors.wander_sigma_m * sensors.wander_sigma_m / reported;
  c.fix_tau_float_s = sensors.wander_tau_s;
  c.gyro_noise_radps_sqrthz = sensors.gyro_noise_radps / std::sqrt(sensors.imu_hz);
  c.accel_noise_mps2_sqrthz = sensors.accel_noise_mps2 / std::sqrt(sensors.imu_hz);
  c.gyro_bias_sigma_radps = 0.003;
  c.accel_bias_sigma_mps2 = 0.05;
  c.gyro_bias_walk_radps_sqrts = 1e-7;
  c.accel_bias_walk_mps2_sqrts = 1e-6;
  c.no_side_slip = false;  // holds exactly here, which no sigma says
  return config;
}

}  // namespace

Sensors cheap_robot(unsigned seed) {
  std::mt19937_64 random(1000 + seed);
  std::normal_distribution<double> normal;
  const auto bias = [&](double sigma) {
    const double x = sigma * normal(random);
    const double y = sigma * normal(random);
    return Vector3d(x, y, sigma * normal(random));
  };
  Sensors sensors;
  sensors.robot.antenna_position_base_m = {0.35, 0.15, 0.6};
  sensors.gyro_bias_radps = bias(0.003);
  sensors.accel_bias_mps2 = bias(0.05);
  sensors.gyro_vibration_radps = 0.008;
  sensors.accel_vibration_mps2 = 0.13;
  return sensors;
}

std::vector<OutageFigure> measure_outage(double speed_mps, int runs, const Config& config) {
  std::vector<OutageFigure> figures{{1.0}, {2.0}, {5.0}, {10.0}, {30.0}, {60.0}};
  const auto truth = drive(errands(speed_mps, 3.0), kOutageFrom_s + 61.0);
  for (int run_index = 1; run_index <= runs; ++run_index) {
    const auto seed = static_cast<unsigned>(run_index);
    Sensors sensors = cheap_robot(seed);
    sensors.outage_from_s = kOutageFrom_s;
    GpsOdometry filter(config, sensors.robot);
    const Recorded result = run(filter, sense(truth, sensors, seed), truth);
    for (OutageFigure& figure : figures) {
      const auto at =
          std::find_if(result.samples.begin(), result.samples.end(), [&](const Sample& sample) {
            return sample.time_s > kOutageFrom_s + figure.age_s - 0.011;
          });
      EXPECT_NE(at, result.samples.end());
      figure.rms_m += at->error_m.squaredNorm() / runs;
      figure.sigma_m += at->sigma_m.squaredNorm() / runs;
      figure.inside += axes_inside(*at) / (3.0 * runs);
    }
  }
  for (OutageFigure& figure : figures) {
    figure.rms_m = std::sqrt(figure.rms_m);
    figure.sigma_m = std::sqrt(figure.sigma_m);
  }
  return figures;
}

std::array<double, 20> measure_raw_anees(int runs) {
  std::array<double, 20> anees{};
  // Errors of fixes that are forgotten from epoch to epoch: else all epochs are one experiment.
  constexpr double kEpoch_s = 10.0;
  const auto truth = drive(errands(3.0, 3.0), 240.0);
  for (int run_index = 1; run_index <= runs; ++run_index) {
    const auto seed = static_cast<unsigned>(run_index);
    Sensors sensors = cheap_robot(seed);
    sensors.gyro_vibration_radps = sensors.accel_vibration_mps2 = 0.0;
    sensors.gyro_noise_radps = 0.008;
    sensors.accel_noise_mps2 = 0.13;
    sensors.white_sigma_m = 0.05;
    sensors.wander_sigma_m = 0.04;
    sensors.wander_tau_s = 10.0;
    sensors.reported_sigma_m = 0.07;
    RawFilter filter(matched_config(sensors), sensors.robot);
    std::size_t epoch = 0;
    for (const Input& input : sense(truth, sensors, seed)) {
      filter.take(input);
      const double time_s = to_seconds(input.imu.stamp_ns - kEpoch_ns);
      if (input.is_fix || epoch == anees.size() ||
          time_s < 40.0 + kEpoch_s * static_cast<double>(epoch) - 1e-6) {
        continue;
      }
      EXPECT_EQ(filter.track().phase, Phase::kRunning);
      const auto index = static_cast<std::size_t>(std::lround(1000.0 * time_s));
      const Vector3d error = filter.track().filter.p_map_m - truth.at(index).position_map_m;
      const Eigen::Matrix3d P = filter.track().filter.P.topLeftCorner<3, 3>();
      anees.at(epoch) += error.dot(P.ldlt().solve(error)) / (3.0 * runs);
      ++epoch;
    }
  }
  return anees;
}

UrbanFigure measure_urban(int runs, double duration_s) {
  const auto truth = drive(errands(1.5, 3.0), duration_s);
  UrbanFigure figure;
  std::vector<double> sigmas;
  double count = 0.0;
  for (int run_index = 1; run_index <= runs; ++run_index) {
    const auto seed = static_cast<unsigned>(run_index);
    const Sensors sensors = cheap_robot(seed);
    GpsOdometry filter(config_with_datum("eskf18"), sensors.robot);
    const auto inputs = sense_urban(truth, sensors, UrbanReceiver{}, seed);
    for (const Sample& sample : run(filter, inputs, truth).samples) {
      if (sample.time_s < 30.0) {
        continue;
      }
      count += 1.0;
      figure.anees += sample.error_m.cwiseQuotient(sample.sigma_m).squaredNorm() / 3.0;
      figure.inside += axes_inside(sample) / 3.0;
      figure.rms_m += sample.error_m.squaredNorm();
      figure.worst_m = std::max(figure.worst_m, sample.error_m.norm());
      sigmas.push_back(sample.sigma_m.norm());
    }
  }
  figure.anees /= count;
  figure.inside /= count;
  figure.rms_m = std::sqrt(figure.rms_m / count);
  const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
  std::nth_element(sigmas.begin(), middle, sigmas.end());
  figure.median_sigma_m = *middle;
  return figure;
}

}  // namespace trigpoint::gps_odometry
