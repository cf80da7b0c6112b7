// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The filter on recorded cars: one fix a second with noise, two cut outages, scored on the
// positions that were withheld.
#include "drive.hpp"
#include "kitti_route.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

namespace trigpoint::gps_odometry {
namespace {

constexpr double kFixSigma_m = 0.05;
constexpr Nanoseconds kLatency_ns = 150'000'000;
constexpr double kOutage_s = 10.0;

struct Score {
  int count{0};
  double square_sum{0.0};
  double worst_m{0.0};
  int axes_inside{0};  ///< 1.96 sigma
  double variance_sum{0.0};

  void add(const Eigen::Vector3d& error, const Eigen::Vector3d& sigma) {
    ++count;
    square_sum += error.squaredNorm();
    variance_sum += sigma.squaredNorm();
    worst_m = std::max(worst_m, error.norm());
    axes_inside += static_cast<int>((error.cwiseAbs().array() < 1.96 * sigma.array()).count());
  }

  double rms_m() const { return std::sqrt(square_sum / count); }

  double sigma_m() const { return std::sqrt(variance_sum / count); }

  double inside() const { return axes_inside / (3.0 * count); }
};

struct Drive {
  Score aided;
  Score outage;
  GpsStatus status;
};

bool in_outage(double time_s) {
  const double phase = std::fmod(time_s, 50.0);
  return time_s > 40.0 && phase < kOutage_s;
}

/// The first fix after an outage comes up to 1.15 s after its end.
bool is_returning(double time_s) {
  return time_s > 40.0 && !in_outage(time_s) && std::fmod(time_s, 50.0) < kOutage_s + 3.0;
}

GnssFix fix_of(const geodesy::LocalFrame& frame,
               const Eigen::Vector3d& position,
               Nanoseconds stamp_ns) {
  const geodesy::Geographic place = frame.to_geographic(position);
  GnssFix fix;
  fix.stamp_ns = stamp_ns;
  fix.status = FixStatus::kGbas;
  fix.latitude_deg = place.latitude_deg;
  fix.longitude_deg = place.longitude_deg;
  fix.altitude_m = place.height_m;
  fix.covariance_enu_m2 = Eigen::Matrix3d::Identity() * kFixSigma_m * kFixSigma_m;
  fix.covariance_type = CovarianceType::kDiagonalKnown;
  return fix;
}

Drive drive(const KittiRoute& route, const std::string& name, unsigned seed) {
  const geodesy::Geographic& origin = route.places.front();
  const Datum datum{origin.latitude_deg, origin.longitude_deg, origin.height_m, 0};
  const geodesy::LocalFrame frame(datum);
  Config config;
  config.filter = name;
  GpsOdometry filter(config, RobotConfig{});
  filter.on_datum(datum);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, kFixSigma_m);
  Drive result;
  std::size_t next = 0;    // fix to be delivered
  std::size_t scored = 0;  // withheld position to be compared
  for (const ImuSample& sample : route.imu) {
    for (; next < route.places.size() && route.stamps_ns[next] + kLatency_ns <= sample.stamp_ns;
         ++next) {
      const double time_s = to_seconds(route.stamps_ns[next] - route.stamps_ns[0]);
      if (next % 10 == 0 && !in_outage(time_s)) {
        const Eigen::Vector3d noise(normal(random), normal(random), normal(random));
        result.status =
            *filter
                 .on_fix(fix_of(
                     frame, *frame.to_map(route.places[next]) + noise, route.stamps_ns[next]))
                 .status;
      }
    }
    const Output output = filter.on_imu(sample);
    if (!output.odometry) {
      continue;
    }
    const Odometry& now = *output.odometry;
    while (scored < route.places.size() && route.stamps_ns[scored] < now.stamp_ns - 5'000'000) {
      ++scored;
    }
    const double time_s = to_seconds(now.stamp_ns - route.stamps_ns[0]);
    if (scored == route.places.size() ||
        std::llabs(route.stamps_ns[scored] - now.stamp_ns) > 5'000'000 || time_s < 30.0 ||
        is_returning(time_s)) {
      continue;
    }
    // Along the way travelled in the few milliseconds between the two stamps.
    const double late_s = to_seconds(route.stamps_ns[scored] - now.stamp_ns);
    const Eigen::Vector3d estimate =
        now.T_frame_child.p + late_s * (now.T_frame_child.q * now.linear_mps);
    Score& score = in_outage(time_s) ? result.outage : result.aided;
    score.add(estimate - *frame.to_map(route.places[scored]),
              now.pose_covariance.diagonal().head<3>().cwiseSqrt());
  }
  return result;
}

struct Recording {
  const char* number;
  const char* name;
  const char* filter;
};

class RealDrive : public testing::TestWithParam<Recording> {};

TEST_P(RealDrive, stays_on_the_road_and_knows_how_far_it_strayed_in_outages) {
  const auto route = read_kitti_route(GetParam().number, GetParam().name);
  if (!route) {
    GTEST_SKIP() << "The recorded KITTI routes (kitti_gnss_imu) are not at hand.";
  }
  const Drive result = drive(*route, GetParam().filter, 1);
  std::printf(
      "KITTI %s, %s: aided rms %.3f m (worst %.2f, sigma %.2f, inside %.3f), outages of %.0f s rms "
      "%.2f m (worst %.2f, sigma %.2f, inside %.3f), health %d\n",
      GetParam().number,
      GetParam().filter,
      result.aided.rms_m(),
      result.aided.worst_m,
      result.aided.sigma_m(),
      result.aided.inside(),
      kOutage_s,
      result.outage.rms_m(),
      result.outage.worst_m,
      result.outage.sigma_m(),
      result.outage.inside(),
      static_cast<int>(result.status.health));
  for (const NamedCount& count : result.status.rejections) {
    std::printf("  %s %lu\n", count.name.c_str(), static_cast<unsigned long>(count.count));
  }
  EXPECT_LT(result.aided.rms_m(), 0.3);  // 1 Hz at up to 14 m/s
  EXPECT_GE(result.aided.inside(), 0.95);
  EXPECT_GE(result.outage.inside(), 0.95);
  EXPECT_LT(result.outage.sigma_m(), 8.0 * result.outage.rms_m());
}

INSTANTIATE_TEST_SUITE_P(Kitti,
                         RealDrive,
                         testing::Values(Recording{"05", "2011_09_30_drive_0018", "ekf15"},
                                         Recording{"07", "2011_09_30_drive_0027", "ekf15"},
                                         Recording{"09", "2011_09_30_drive_0033", "ekf15"},
                                         Recording{"05", "2011_09_30_drive_0018", "eskf18"},
                                         Recording{"07", "2011_09_30_drive_0027", "eskf18"},
                                         Recording{"09", "2011_09_30_drive_0033", "eskf18"}));

}  // namespace
}  // namespace trigpoint::gps_odometry
