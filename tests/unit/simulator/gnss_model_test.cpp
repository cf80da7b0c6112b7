// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gnss_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint::simulator {

namespace {

const Datum kDatum{43.9456, -78.8968, 100.0, 0};
const Eigen::Vector3d kAntenna_m{40.0, -30.0, 2.0};

struct Statistics {
  double variance{0.0};  ///< in units of the closed form's
  double covariance{
      0.0};  ///< of the same receiver's errors `lag` epochs apart, in units of the closed form's
};

/// Over many seeds, all three axes pooled, each divided by what the model says.
Statistics statistics_of(const std::string& gnss_class, int lag, int seeds) {
  GnssConfig config;
  config.gnss_class = gnss_class;
  const GnssClassModel& model = gnss_class_model(gnss_class);
  const geodesy::LocalFrame frame(kDatum);
  const Eigen::Vector3d variance = model.white_m.cwiseAbs2() + model.correlated_m.cwiseAbs2();
  const Eigen::Vector3d covariance =
      std::exp(-lag / config.rate_hz / model.tau_s) * model.correlated_m.cwiseAbs2();
  Statistics sum;
  for (int seed = 0; seed < seeds; ++seed) {
    GnssModel gnss(config, kDatum, static_cast<std::uint64_t>(seed));
    Eigen::Vector3d first = Eigen::Vector3d::Zero();
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
    for (int i = 0; i <= lag; ++i) {
      const GnssEpoch epoch = gnss.begin(i, kAntenna_m);
      if (i == 0 || i == lag) {
        const GnssFix fix = gnss.finish(epoch);
        last = *frame.to_map({fix.latitude_deg, fix.longitude_deg, fix.altitude_m}) - kAntenna_m;
        first = i == 0 ? last : first;
      }
    }
    sum.variance += last.cwiseAbs2().cwiseQuotient(variance).mean() / seeds;
    sum.covariance += first.cwiseProduct(last).cwiseQuotient(covariance).mean() / seeds;
  }
  return sum;
}

GnssFix fix_of(const GnssConfig& config, const std::string& gnss_class) {
  GnssModel gnss(config, kDatum, 1);
  GnssEpoch epoch = gnss.begin(1, kAntenna_m);
  epoch.gnss_class = gnss_class;
  return gnss.finish(epoch);
}

}  // namespace

TEST(GnssModel, has_the_variance_and_the_correlation_in_time_of_white_plus_gauss_markov) {
  constexpr int kSeeds = 2000;
  constexpr int kLag = 100;  // 20 s
  // Five standard deviations of a mean of 3 x 2000 squares (variance 2 each).
  const double tolerance = 5.0 * std::sqrt(2.0 / (3.0 * kSeeds));
  for (const std::string gnss_class : {"fixed", "float", "code"}) {
    const Statistics result = statistics_of(gnss_class, kLag, kSeeds);
    EXPECT_NEAR(result.variance, 1.0, tolerance) << gnss_class;
    // The white part scatters the product more, by (1 + w^2/c^2) e^(lag/tau).
    const GnssClassModel& model = gnss_class_model(gnss_class);
    const double scatter = (1.0 + std::pow(model.white_m.x() / model.correlated_m.x(), 2)) *
                           std::exp(20.0 / model.tau_s);
    EXPECT_NEAR(result.covariance, 1.0, tolerance * scatter) << gnss_class;
  }
}

TEST(GnssModel, repeats_itself_exactly_without_noise) {
  GnssConfig config;
  config.noise_scale = 0.0;
  const GnssFix fix = fix_of(config, "code");
  const geodesy::LocalFrame frame(kDatum);
  EXPECT_LT(
      (*frame.to_map({fix.latitude_deg, fix.longitude_deg, fix.altitude_m}) - kAntenna_m).norm(),
      1e-6);
}

TEST(GnssModel, reports_the_status_and_covariance_of_the_chosen_driver) {
  GnssConfig config;
  EXPECT_EQ(fix_of(config, "fixed").status, FixStatus::kGbas);
  EXPECT_EQ(fix_of(config, "float").status, FixStatus::kFix);
  EXPECT_EQ(fix_of(config, "fixed").covariance_type, CovarianceType::kDiagonalKnown);
  EXPECT_NEAR(fix_of(config, "fixed").covariance_enu_m2(2, 2), 0.024 * 0.024, 1e-12);
  config.driver = "nmea";
  EXPECT_EQ(fix_of(config, "float").status, FixStatus::kGbas);
  EXPECT_EQ(fix_of(config, "sbas").status, FixStatus::kSbas);
  EXPECT_EQ(fix_of(config, "fixed").covariance_type, CovarianceType::kApproximated);
  EXPECT_EQ(fix_of(config, "none").status, FixStatus::kNoFix);
}

TEST(GnssModel, keeps_the_latency_within_its_jitter_and_delays_the_given_share) {
  GnssConfig config;
  config.latency_s = 0.13;
  config.latency_jitter_s = 0.03;
  config.late_share = 0.1;
  config.late_latency_s = 0.6;
  GnssModel gnss(config, kDatum, 7);
  constexpr int kEpochs = 5000;
  int late = 0;
  for (int i = 0; i < kEpochs; ++i) {
    const double latency_s = gnss.begin(i, kAntenna_m).latency_s;
    late += latency_s > 0.5 ? 1 : 0;
    const double middle_s = latency_s > 0.5 ? 0.6 : 0.13;
    ASSERT_NEAR(latency_s, middle_s, 0.03);
  }
  EXPECT_NEAR(static_cast<double>(late) / kEpochs, 0.1, 5.0 * std::sqrt(0.09 / kEpochs));
}

}  // namespace trigpoint::simulator
