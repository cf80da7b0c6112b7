// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Sequences of messages with wild values, stamps and covariances into every GPS filter. Whatever
// comes: what is published is finite, its covariance symmetric and positive, its stamps go forward.
// With clang: a libFuzzer target (TRIGPOINT_FUZZ). Else a program of its own that draws sequences
// from a seed: gps_odometry_fuzz [SEQUENCES] [SEED].
#include "trigpoint/gps_odometry/gps_odometry.hpp"

#include <Eigen/Eigenvalues>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace trigpoint;
using gps_odometry::GpsOdometry;
using gps_odometry::Output;

constexpr std::array<const char*, 3> kFilters{"ekf15", "eskf18", "ekf15_strict"};
constexpr Nanoseconds kStart_ns = 1'700'000'000LL * kNanosecondsPerSecond;
/// Rounding of a covariance, relative to its largest element.
constexpr double kRounding = 1e-9;

/// Reads numbers from bytes; zeros when they are used up.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  bool is_empty() const { return next_ >= size_; }

  std::uint8_t byte() { return is_empty() ? std::uint8_t{0} : data_[next_++]; }

  /// Mostly near `usual`; now and then anything that a double can be.
  double number(double usual, double spread) {
    static constexpr std::array<double, 12> kWild{0.0,
                                                  -1.0,
                                                  1e-300,
                                                  1e300,
                                                  -1e300,
                                                  1e9,
                                                  -2e10,
                                                  9.81,
                                                  std::numeric_limits<double>::quiet_NaN(),
                                                  std::numeric_limits<double>::infinity(),
                                                  -std::numeric_limits<double>::infinity(),
                                                  1.7e308};
    const std::uint8_t kind = byte();
    if (kind >= 250) {
      return kWild[byte() % kWild.size()];
    }
    return usual + spread * (static_cast<double>(kind) - 125.0) / 125.0;
  }

  Eigen::Vector3d vector(const Eigen::Vector3d& usual, double spread) {
    const double x = number(usual.x(), spread);
    const double y = number(usual.y(), spread);
    return {x, y, number(usual.z(), spread)};
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t next_{0};
};

[[noreturn]] void fail(const std::string& filter, const std::string& what) {
  std::fprintf(stderr, "%s: %s\n", filter.c_str(), what.c_str());
  std::abort();
}

void check_covariance(const std::string& filter, const char* name, const Matrix6d& covariance) {
  const double largest = covariance.cwiseAbs().maxCoeff();
  if (!covariance.allFinite()) {
    fail(filter, std::string(name) + " covariance is not finite");
  }
  if ((covariance - covariance.transpose()).cwiseAbs().maxCoeff() > kRounding * largest) {
    fail(filter, std::string(name) + " covariance is not symmetric");
  }
  // Scaled to correlations, so that metres and radians count alike.
  const Eigen::Matrix<double, 6, 1> sigma = covariance.diagonal().cwiseSqrt();
  if (!(covariance.diagonal().minCoeff() > 0.0)) {
    fail(filter, std::string(name) + " variance is not positive");
  }
  const Matrix6d correlation =
      sigma.cwiseInverse().asDiagonal() * covariance * sigma.cwiseInverse().asDiagonal();
  const double least =
      Eigen::SelfAdjointEigenSolver<Matrix6d>(correlation, Eigen::EigenvaluesOnly).eigenvalues()(0);
  if (!(least > -1e-6)) {
    fail(filter, std::string(name) + " covariance is not positive: " + std::to_string(least));
  }
}

class Checked {
 public:
  explicit Checked(const std::string& name) : name_(name), filter_(config_of(name), robot()) {}

  GpsOdometry& filter() { return filter_; }

  void check(const Output& output) {
    for (const Event& event : output.events) {
      // A clock that was reset, and that alone, may take the stamps back.
      if (event.code == "imu_clock_reset") {
        newest_ns_ = std::numeric_limits<Nanoseconds>::min();
      }
    }
    if (!output.odometry) {
      return;
    }
    const Odometry& odometry = *output.odometry;
    if (!odometry.T_frame_child.is_finite() || !odometry.linear_mps.allFinite() ||
        !odometry.angular_radps.allFinite()) {
      fail(name_, "state is not finite");
    }
    check_covariance(name_, "pose", odometry.pose_covariance);
    check_covariance(name_, "twist", odometry.twist_covariance);
    if (odometry.stamp_ns < newest_ns_) {
      fail(name_, "stamps go back");
    }
    newest_ns_ = odometry.stamp_ns;
  }

 private:
  static gps_odometry::Config config_of(const std::string& name) {
    gps_odometry::Config config;
    config.filter = name;
    return config;
  }

  static RobotConfig robot() {
    RobotConfig robot;
    robot.antenna_position_base_m = {0.35, 0.15, 0.6};
    return robot;
  }

  std::string name_;
  GpsOdometry filter_;
  Nanoseconds newest_ns_{std::numeric_limits<Nanoseconds>::min()};
};

/// A vehicle that drives north, as far as the bytes let it.
class Sequence {
 public:
  explicit Sequence(Bytes& bytes) : bytes_(bytes) {}

  void run(Checked& checked) {
    GpsOdometry& filter = checked.filter();
    checked.check(filter.on_datum({49.0, 8.4, 100.0, 0}));
    while (!bytes_.is_empty()) {
      const std::uint8_t kind = bytes_.byte();
      if (kind < 8) {
        checked.check(filter.on_datum({bytes_.number(49.0, 0.001),
                                       bytes_.number(8.4, 0.001),
                                       bytes_.number(100.0, 10.0),
                                       0}));
      } else if (kind < 150) {
        // A few samples of one kind, so that the IMU warms up in a short sequence.
        ImuSample sample = imu();
        for (int i = 0; i < 1 + kind % 32; ++i) {
          sample.stamp_ns = stamp(10'000'000);
          sample.gyro_radps.x() += 1e-6;
          checked.check(filter.on_imu(sample));
        }
      } else {
        checked.check(filter.on_fix(fix()));
      }
      (void)filter.status();
    }
  }

 private:
  Nanoseconds stamp(Nanoseconds step_ns) {
    if (bytes_.byte() < 250) {
      return now_ns_ += step_ns;
    }
    switch (bytes_.byte() % 8) {
      case 0:
        return now_ns_;
      case 1:
        return now_ns_ -= 3'000'000'000;
      case 2:
        return now_ns_ += 7'000'000'000;
      case 3:
        return std::numeric_limits<Nanoseconds>::max();
      case 4:
        return std::numeric_limits<Nanoseconds>::min();
      case 5:
        return 0;
      case 6:
        return now_ns_ += 300'000'000'000;
      default:
        return now_ns_ - 120'000'000;
    }
  }

  ImuSample imu() {
    ImuSample sample;
    sample.gyro_radps = bytes_.vector({0.0, 0.0, 0.0}, 0.5);
    sample.accel_mps2 = bytes_.vector({0.0, 0.0, 9.81}, 2.0);
    return sample;
  }

  GnssFix fix() {
    GnssFix fix;
    const std::uint8_t age = bytes_.byte();
    fix.stamp_ns = age < 200 ? now_ns_ - 1'000'000LL * age : stamp(0);
    fix.status = static_cast<FixStatus>(static_cast<int>(bytes_.byte() % 5) - 2);
    const double driven_deg = 1.5 / 111'000.0 * to_seconds(now_ns_ - kStart_ns);
    fix.latitude_deg = bytes_.number(49.0 + driven_deg, 1e-5);
    fix.longitude_deg = bytes_.number(8.4, 1e-5);
    fix.altitude_m = bytes_.number(100.0, 1.0);
    const double variance = bytes_.number(1.0, 1.0);
    fix.covariance_enu_m2 = variance * Eigen::Matrix3d::Identity();
    if (bytes_.byte() < 40) {
      for (int i = 0; i < 9; ++i) {
        fix.covariance_enu_m2(i) = bytes_.number(0.0, 5.0);
      }
    }
    fix.covariance_type = static_cast<CovarianceType>(bytes_.byte() % 4);
    return fix;
  }

  Bytes& bytes_;
  Nanoseconds now_ns_{kStart_ns};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (const char* name : kFilters) {
    Bytes bytes(data, size);
    Checked checked(name);
    Sequence(bytes).run(checked);
  }
  return 0;
}

#ifndef TRIGPOINT_LIBFUZZER
int main(int argc, char** argv) {
  const long sequences = argc > 1 ? std::atol(argv[1]) : 2000;
  const auto seed = static_cast<std::uint64_t>(argc > 2 ? std::atol(argv[2]) : 1);
  std::mt19937_64 random(seed);
  std::size_t total = 0;
  for (long i = 0; i < sequences; ++i) {
    std::vector<std::uint8_t> bytes(random() % 400);
    const bool tame = random() % 2 == 0;  // else so wild that little passes the checks
    for (std::uint8_t& byte : bytes) {
      byte =
          static_cast<std::uint8_t>(tame && random() % 64 != 0 ? random() % 250 : random() % 256);
    }
    total += bytes.size();
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  }
  std::printf("%ld sequences of %.0f bytes on average, %zu filters: no violation\n",
              sequences,
              static_cast<double>(total) / static_cast<double>(sequences),
              kFilters.size());
  return 0;
}
#endif
