// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The mapper on a drive whose sensors fail: it stays up, says so, recovers, and its covariance
// tells the truth. Prints one line a fault.
#include "lio_drives.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace trigpoint {

namespace {

constexpr double kFaultBegins_s = 38.0;
constexpr double kDuration_s = 70.0;
/// Of three axes' errors over their sigmas, the largest: beyond this in one scan of 370 of a
/// Gaussian axis; beyond twice that in none.
constexpr double kSigmas = 3.0;

struct Fault {
  const char* overlay;
  const char* event;     ///< the beginning of the code that must be said
  double worst_error_m;  ///< during the fault, what the sensors that are left make possible
};

class MapperWith : public testing::TestWithParam<Fault> {};

TEST_P(MapperWith, stays_up_says_so_recovers_and_knows_its_error) {
  const Fault& fault = GetParam();
  LioDriveOptions options;
  options.duration_s = kDuration_s;
  const LioDrive drive =
      drive_lio(simulator::load_scenario("campus+" + std::string(fault.overlay)), 1, options);
  ASSERT_GT(drive.samples.size(), 300U);
  const auto anchor = std::find_if(drive.samples.begin(),
                                   drive.samples.end(),
                                   [](const LioSample& s) { return s.time_s > kFaultBegins_s; });
  ASSERT_NE(anchor, drive.samples.end());
  double worst_m = 0.0;
  double worst_sigmas = 0.0;
  double at_s = 0.0;
  int outside = 0;
  int count = 0;
  for (auto s = anchor; s != drive.samples.end(); ++s) {
    const RelativeError relative = relative_error(*anchor, *s);
    worst_m = std::max(worst_m, relative.error.head<3>().norm());
    const double sigmas = (relative.error.head<3>().array().abs() /
                           relative.covariance.diagonal().head<3>().array().sqrt())
                              .maxCoeff();
    if (sigmas > worst_sigmas) {
      worst_sigmas = sigmas;
      at_s = s->time_s;
    }
    outside += sigmas > kSigmas ? 1 : 0;
    ++count;
  }
  const RelativeError last = relative_error(*anchor, drive.samples.back());
  const bool said = std::any_of(drive.events.begin(), drive.events.end(), [&](const Event& e) {
    return e.code.rfind(fault.event, 0) == 0;
  });
  std::printf(
      "%-20s scans %3zu of %3zu  worst %6.3f m, end %6.3f m (sigma %5.3f)  worst %5.2f "
      "sigma at %5.1f s, outside 3: %d of %d  end health %d  %s\n",
      fault.overlay,
      static_cast<std::size_t>(drive.status.scans_used),
      static_cast<std::size_t>(drive.status.scans_received),
      worst_m,
      last.error.head<3>().norm(),
      std::sqrt(last.covariance.topLeftCorner<3, 3>().trace()),
      worst_sigmas,
      at_s,
      outside,
      count,
      static_cast<int>(drive.status.health),
      said ? "said" : "NOT SAID");
  std::fflush(stdout);
  EXPECT_TRUE(said) << fault.event;
  EXPECT_EQ(drive.status.health, LioHealth::kOk);
  EXPECT_GT(drive.samples.back().time_s, kDuration_s - 1.0);
  EXPECT_LT(worst_m, fault.worst_error_m);
  EXPECT_LT(outside, 1 + count / 50);
  EXPECT_LT(worst_sigmas, 2.0 * kSigmas);
}

INSTANTIATE_TEST_SUITE_P(
    Faults,
    MapperWith,
    testing::Values(Fault{"lidar_lost_scans", "lio_started", 0.3},
                    Fault{"lidar_back_in_time", "scan_refused_stamp_not_after_previous", 0.3},
                    Fault{"lidar_blocked", "lio_lost", 10.0},
                    Fault{"lidar_blank", "lio_lost", 10.0},
                    Fault{"lidar_nan", "scan_refused_", 0.5},
                    Fault{"lidar_one_ring", "lio_", 1.0},
                    Fault{"imu_gaps", "imu_gap", 2.0},
                    Fault{"imu_saturated", "imu_saturated", 1.0}),
    [](const auto& tested) { return std::string(tested.param.overlay); });

}  // namespace

}  // namespace trigpoint
