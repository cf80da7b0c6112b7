// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gps_drives.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <future>
#include <stdexcept>
#include <variant>

namespace trigpoint {

namespace {

using gps_odometry::GpsOdometry;
using gps_odometry::Output;

/// One filter and what it has published so far.
class Driven {
 public:
  Driven(const std::string& name, const simulator::Scenario& scenario)
      : start_ns_(scenario.start_ns()), filter_(config_of(name), scenario.robot) {
    filter_.on_datum(scenario.datum);
  }

  void take(const ImuSample& imu, const simulator::Truth& truth) {
    note(filter_.on_imu(imu), truth);
  }

  void take(const GnssFix& fix, const simulator::Truth& truth) { note(filter_.on_fix(fix), truth); }

  DriveSamples samples;

 private:
  static gps_odometry::Config config_of(const std::string& name) {
    gps_odometry::Config config;
    config.filter = name;
    return config;
  }

  void note(const Output& output, const simulator::Truth& truth) {
    if (output.status) {
      health_ = output.status->health;
    }
    if (!output.odometry) {
      return;
    }
    const Odometry& odometry = *output.odometry;
    DriveSample sample;
    sample.time_s = to_seconds(odometry.stamp_ns - start_ns_);
    sample.error_m = odometry.T_frame_child.p - truth.at(odometry.stamp_ns).T_map_base.p;
    const Eigen::Matrix3d P = odometry.pose_covariance.topLeftCorner<3, 3>();
    sample.sigma_m = P.diagonal().cwiseMax(0.0).cwiseSqrt();
    sample.nees = sample.error_m.dot(P.ldlt().solve(sample.error_m));
    sample.health = health_;
    samples.push_back(sample);
  }

  Nanoseconds start_ns_;
  GpsOdometry filter_;
  GpsHealth health_{GpsHealth::kInit};
};

}  // namespace

std::array<DriveSamples, 3> drive_all(const simulator::Scenario& scenario,
                                      std::uint64_t seed,
                                      double duration_s,
                                      const FixFilter& only) {
  simulator::StreamOptions options;
  options.lidar = false;
  const auto reader = simulator::open_scenario(scenario, seed, duration_s, options);
  const auto truth = reader->truth();
  std::array<Driven, 3> filters{
      Driven(kFilters[0], scenario), Driven(kFilters[1], scenario), Driven(kFilters[2], scenario)};
  while (const auto entry = reader->next()) {
    for (Driven& filter : filters) {
      if (const auto* imu = std::get_if<ImuSample>(&entry->measurement)) {
        filter.take(*imu, *truth);
      } else if (const auto* fix = std::get_if<GnssFix>(&entry->measurement)) {
        if (!only || only(to_seconds(fix->stamp_ns - scenario.start_ns()))) {
          filter.take(*fix, *truth);
        }
      }
    }
  }
  return {
      std::move(filters[0].samples), std::move(filters[1].samples), std::move(filters[2].samples)};
}

simulator::Scenario scenario_with(const std::string& name, const std::vector<std::string>& faults) {
  std::string yaml = simulator::load_scenario(name).source_yaml;
  if (!faults.empty() && yaml.find("\nfaults:") == std::string::npos) {
    yaml += "\nfaults:\n";
  }
  for (const std::string& fault : faults) {
    yaml += "  - " + fault + "\n";
  }
  return simulator::load_scenario_text(yaml, name);
}

std::vector<std::array<DriveSamples, 3>> drive_seeds(
    int runs,
    const std::function<std::array<DriveSamples, 3>(std::uint64_t)>& drive) {
  std::vector<std::array<DriveSamples, 3>> results(static_cast<std::size_t>(runs));
  const auto every_second = [&](std::size_t first) {
    for (std::size_t i = first; i < results.size(); i += 2) {
      results[i] = drive(i + 1);
    }
  };
  auto other = std::async(std::launch::async, every_second, std::size_t{1});
  every_second(0);
  other.get();
  return results;
}

void Honesty::add(const DriveSample& sample) {
  square_sum_ += sample.error_m.cwiseAbs2();
  inside_ +=
      (sample.error_m.cwiseAbs().array() < 1.96 * sample.sigma_m.array()).cast<double>().matrix();
  nees_sum_ += sample.nees;
  worst_m_ = std::max(worst_m_, sample.error_m.norm());
  sigmas_.push_back(sample.sigma_m.norm());
}

void Honesty::add(const DriveSamples& samples, double from_s, double to_s) {
  for (const DriveSample& sample : samples) {
    if (sample.time_s >= from_s && sample.time_s < to_s) {
      add(sample);
    }
  }
}

double Honesty::rms_m() const {
  return std::sqrt(square_sum_.sum() / static_cast<double>(count()));
}

double Honesty::rms_up_m() const {
  return std::sqrt(square_sum_.z() / static_cast<double>(count()));
}

double Honesty::rms_level_m() const {
  return std::sqrt(square_sum_.head<2>().sum() / static_cast<double>(count()));
}

double Honesty::anees() const {
  return nees_sum_ / (3.0 * static_cast<double>(count()));
}

double Honesty::inside() const {
  return inside_.sum() / (3.0 * static_cast<double>(count()));
}

double Honesty::inside_up() const {
  return inside_.z() / static_cast<double>(count());
}

double Honesty::median_sigma_m() const {
  std::vector<double> sorted = sigmas_;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

const DriveSample& sample_at(const DriveSamples& samples, double time_s) {
  const auto after = std::upper_bound(
      samples.begin(), samples.end(), time_s, [](double t, const DriveSample& sample) {
        return t < sample.time_s;
      });
  if (after == samples.begin()) {
    throw std::runtime_error("nothing was published before " + std::to_string(time_s) + " s");
  }
  return *std::prev(after);
}

double largest_step_m(const DriveSamples& samples, double from_s, double to_s) {
  double largest = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].time_s >= from_s && samples[i].time_s < to_s) {
      largest = std::max(largest, (samples[i].error_m - samples[i - 1].error_m).norm());
    }
  }
  return largest;
}

}  // namespace trigpoint
