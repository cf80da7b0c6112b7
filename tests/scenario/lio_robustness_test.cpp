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
/// Scans of one drive share the error of the pose that they are compared with.
constexpr int kSeeds = 3;
/// Of three axes' errors over their sigmas, the largest: beyond this in one scan of 370 of a
/// Gaussian axis; beyond twice that in none.
constexpr double kSigmas = 3.0;

struct Fault {
  const char* overlay;
  const char* event;     ///< the beginning of the code that must be said
  double worst_error_m;  ///< during the fault, what the sensors that are left make possible
  int seeds{kSeeds};
};

class MapperWith : public testing::TestWithParam<Fault> {};

/// What one drive with a fault came to, relative to where it was when the fault began.
struct Outcome {
  double worst_m{0.0};
  double worst_sigmas{0.0};
  double worst_at_s{0.0};
  int outside{0};
  int count{0};
  RelativeError last;
};

Outcome outcome_of(const LioDrive& drive) {
  const auto anchor = std::find_if(drive.samples.begin(),
                                   drive.samples.end(),
                                   [](const LioSample& s) { return s.time_s > kFaultBegins_s; });
  Outcome outcome;
  for (auto s = anchor; s != drive.samples.end(); ++s) {
    outcome.last = relative_error(*anchor, *s);
    const RelativeError& relative = outcome.last;
    outcome.worst_m = std::max(outcome.worst_m, relative.error.head<3>().norm());
    const double sigmas = (relative.error.head<3>().array().abs() /
                           relative.covariance.diagonal().head<3>().array().sqrt())
                              .maxCoeff();
    if (sigmas > outcome.worst_sigmas) {
      outcome.worst_sigmas = sigmas;
      outcome.worst_at_s = s->time_s;
    }
    outcome.outside += sigmas > kSigmas ? 1 : 0;
    ++outcome.count;
  }
  return outcome;
}

TEST_P(MapperWith, stays_up_says_so_recovers_and_knows_its_error) {
  const Fault& fault = GetParam();
  const auto scenario = simulator::load_scenario("campus+" + std::string(fault.overlay));
  const auto drives = drive_lio_all(fault.seeds, [&](int i) {
    LioDriveOptions options;
    options.duration_s = kDuration_s;
    return drive_lio(scenario, static_cast<std::uint64_t>(i + 1), options);
  });
  int outside = 0;
  int count = 0;
  for (const LioDrive& drive : drives) {
    ASSERT_GT(drive.samples.size(), 300U);
    const Outcome outcome = outcome_of(drive);
    ASSERT_GT(outcome.count, 0);
    const bool said = std::any_of(drive.events.begin(), drive.events.end(), [&](const Event& e) {
      return e.code.rfind(fault.event, 0) == 0;
    });
    std::printf(
        "%-20s scans %3zu of %3zu  worst %6.3f m, end %6.3f m (sigma %5.3f)  worst %5.2f "
        "sigma at %5.1f s, outside 3: %d of %d  end health %d  %s\n",
        fault.overlay,
        static_cast<std::size_t>(drive.status.scans_used),
        static_cast<std::size_t>(drive.status.scans_received),
        outcome.worst_m,
        outcome.last.error.head<3>().norm(),
        std::sqrt(outcome.last.covariance.topLeftCorner<3, 3>().trace()),
        outcome.worst_sigmas,
        outcome.worst_at_s,
        outcome.outside,
        outcome.count,
        static_cast<int>(drive.status.health),
        said ? "said" : "NOT SAID");
    std::fflush(stdout);
    EXPECT_TRUE(said) << fault.event;
    EXPECT_EQ(drive.status.health, LioHealth::kOk);
    EXPECT_GT(drive.samples.back().time_s, kDuration_s - 1.0);
    EXPECT_LT(outcome.worst_m, fault.worst_error_m);
    EXPECT_LT(outcome.worst_sigmas, 2.0 * kSigmas);
    outside += outcome.outside;
    count += outcome.count;
  }
  EXPECT_LT(outside, 1 + count / 100);
}

INSTANTIATE_TEST_SUITE_P(
    Faults,
    MapperWith,
    testing::Values(
        Fault{"lidar_lost_scans", "lio_started", 0.3},
        Fault{"lidar_back_in_time", "scan_refused_stamp_not_after_previous", 0.3},
        Fault{"lidar_blocked", "lio_lost", 10.0, 24},  // each is found from another place
        Fault{"lidar_blank", "lio_lost", 10.0},
        Fault{"lidar_nan", "scan_refused_", 0.5},
        Fault{"lidar_one_ring", "lio_", 1.0},
        Fault{"imu_gaps", "imu_gap", 2.0},
        Fault{"imu_saturated", "imu_saturated", 1.0}),
    [](const auto& tested) { return std::string(tested.param.overlay); });

}  // namespace

}  // namespace trigpoint
