// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The GPS filters on the simulator's campus: relief, vibration, body roll, late fixes, an outage of
// 20 s. Without LiDAR.
#include "trigpoint/gps_odometry/gps_odometry.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <variant>

namespace trigpoint {
namespace {

using gps_odometry::GpsOdometry;
using gps_odometry::Output;

constexpr int kRuns = 5;
constexpr double kOutageFrom_s = 35.0;
constexpr double kOutageTo_s = 55.0;

struct Score {
  double square_sum{0.0};
  double inside{0.0};
  int count{0};

  void add(const Odometry& odometry, const simulator::TrueState& truth) {
    const Eigen::Vector3d error = odometry.T_frame_child.p - truth.T_map_base.p;
    const Eigen::Vector3d sigma = odometry.pose_covariance.diagonal().head<3>().cwiseSqrt();
    square_sum += error.squaredNorm();
    inside += static_cast<double>((error.cwiseAbs().array() < 1.96 * sigma.array()).count()) / 3.0;
    ++count;
  }

  double rms_m() const { return std::sqrt(square_sum / count); }

  double share_inside() const { return inside / count; }
};

struct Result {
  Score aided;
  Score outage;
};

void run(const std::string& filter_name, std::uint64_t seed, Result& result) {
  const simulator::Scenario scenario = simulator::load_scenario("campus");
  simulator::StreamOptions options;
  options.lidar = false;
  const auto reader = simulator::open_scenario(scenario, seed, std::nullopt, options);
  const auto truth = reader->truth();
  gps_odometry::Config config;
  config.filter = filter_name;
  GpsOdometry filter(config, scenario.robot);
  filter.on_datum(scenario.datum);
  while (const auto entry = reader->next()) {
    Output output;
    if (const auto* imu = std::get_if<ImuSample>(&entry->measurement)) {
      output = filter.on_imu(*imu);
    } else if (const auto* fix = std::get_if<GnssFix>(&entry->measurement)) {
      output = filter.on_fix(*fix);
    }
    if (!output.odometry) {
      continue;
    }
    const double time_s = to_seconds(output.odometry->stamp_ns - scenario.start_ns());
    const bool in_outage = time_s > kOutageFrom_s && time_s < kOutageTo_s;
    const bool returning = time_s >= kOutageTo_s && time_s < kOutageTo_s + 2.0;
    if (time_s > 20.0 && !returning) {
      (in_outage ? result.outage : result.aided)
          .add(*output.odometry, truth->at(output.odometry->stamp_ns));
    }
  }
}

class Campus : public testing::TestWithParam<std::string> {};

TEST_P(Campus, is_driven_within_the_published_sigma) {
  Result result;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    run(GetParam(), seed, result);
  }
  std::printf(
      "campus, %s: aided rms %.3f m, inside 1.96 sigma %.3f; outage rms %.3f m, inside %.3f\n",
      GetParam().c_str(),
      result.aided.rms_m(),
      result.aided.share_inside(),
      result.outage.rms_m(),
      result.outage.share_inside());
  EXPECT_LT(result.aided.rms_m(), 0.10);
  EXPECT_GE(result.aided.share_inside(), 0.95);
  EXPECT_GE(result.outage.share_inside(), 0.95);
}

INSTANTIATE_TEST_SUITE_P(Filters, Campus, testing::Values("ekf15", "eskf18"));

}  // namespace
}  // namespace trigpoint
