// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Does the mapper know how far it drifts? NEES / 6 of the change of pose over 10 m and 50 m, three
// seeds each, in well-conditioned surroundings. Prints one table.
#include "lio_drives.hpp"
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <string>

namespace trigpoint {

namespace {

constexpr int kSeeds = 3;
constexpr double kLeast = 1.0 / 3.0;
constexpr double kMost = 3.0;

struct Case {
  const char* name;
  double duration_s;
};

/// Mean squares over the pairs of a kind, in the order x y z roll pitch yaw.
struct Honesty {
  Eigen::Matrix<double, 6, 1> error2{Eigen::Matrix<double, 6, 1>::Zero()};
  Eigen::Matrix<double, 6, 1> stated2{Eigen::Matrix<double, 6, 1>::Zero()};
  double nees{0.0};
  int count{0};

  void add(const RelativeError& e) {
    error2 += e.error.cwiseAbs2();
    stated2 += e.covariance.diagonal();
    nees += e.nees_per_axis();
    ++count;
  }
};

void print(const Honesty& h) {
  const auto mm = [&](const Eigen::Matrix<double, 6, 1>& sums) {
    const Eigen::Matrix<double, 6, 1> rms = 1e3 * (sums / h.count).cwiseSqrt();
    std::printf(
        " %5.1f %5.1f %5.1f %5.2f %5.2f %5.2f |", rms[0], rms[1], rms[2], rms[3], rms[4], rms[5]);
  };
  mm(h.error2);
  mm(h.stated2);
  std::printf(" %6.2f (%d)\n", h.nees / h.count, h.count);
}

class RelativePose : public testing::TestWithParam<Case> {};

TEST_P(RelativePose, error_over_10_and_50_m_is_what_the_covariance_says) {
  const Case& c = GetParam();
  const auto scenario = simulator::load_scenario(c.name);
  const auto drives = drive_lio_all(kSeeds, [&](int i) {
    LioDriveOptions options;
    options.duration_s = c.duration_s;
    return drive_lio(scenario, static_cast<std::uint64_t>(i + 1), options);
  });
  for (const double distance_m : {10.0, 50.0}) {
    Honesty honesty;
    for (const LioDrive& drive : drives) {
      for (const RelativeError& error : relative_errors(drive, distance_m)) {
        honesty.add(error);
      }
    }
    ASSERT_GT(honesty.count, 0);
    std::printf("%-22s %3.0f m |", c.name, distance_m);
    print(honesty);
    std::fflush(stdout);
    EXPECT_GT(honesty.nees / honesty.count, kLeast) << distance_m << " m";
    EXPECT_LT(honesty.nees / honesty.count, kMost) << distance_m << " m";
  }
  Honesty local;
  for (const LioDrive& drive : drives) {
    for (const LioSample& s : drive.samples) {
      for (int i = 0; i < 6; ++i) {
        const double sigma = s.status.sigma[static_cast<std::size_t>(i)];
        local.stated2[i] += sigma * sigma;
      }
      ++local.count;
    }
  }
  std::printf("%-22s local |", c.name);
  print(local);
}

std::string name_of(const testing::TestParamInfo<Case>& tested) {
  std::string name = tested.param.name;
  name[name.find('+')] = '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Drives,
                         RelativePose,
                         testing::Values(Case{"campus+beams_16", 122.0},
                                         Case{"campus+beams_32", 122.0},
                                         Case{"campus+beams_64", 122.0},
                                         Case{"park+beams_16", 120.0},
                                         Case{"park+beams_32", 120.0},
                                         Case{"park+beams_64", 60.0},
                                         Case{"long_drive+beams_16", 200.0},
                                         Case{"long_drive+beams_32", 100.0},
                                         Case{"long_drive+beams_64", 60.0}),
                         name_of);

}  // namespace

}  // namespace trigpoint
