// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Sequences of messages (IMU, fixes, twists, headings, data) with wild values, stamps and
// covariances into ekf15 and eskf18. Whatever comes: what is published is finite, its covariances
// symmetric and positive definite, its stamps go forward, and no state had to be thrown away
// because it was not finite.
// With clang a libFuzzer target (preset "fuzz"). Else a program of its own that draws sequences:
//   gps_odometry_fuzz [SEQUENCES] [SEED] [FIRST]
// Each is drawn from the seed and its number alone: a range can be shared among processes, and a
// finding is run again with SEQUENCES 1 and FIRST its number.
#include "trigpoint/gps_odometry/gps_odometry.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using namespace trigpoint;
using gps_odometry::GpsOdometry;
using gps_odometry::Output;

constexpr std::array<const char*, 2> kFilters{"ekf15", "eskf18"};
constexpr Nanoseconds kStart_ns = 1'700'000'000LL * kNanosecondsPerSecond;
constexpr Nanoseconds kImuStep_ns = 20'000'000;
constexpr int kWarmUpSamples = 20;  // before these the filters say nothing
constexpr double kSpeed_mps = 4.0;
constexpr double kDegrees = 1.0 / 111'000.0;  // a metre northwards
/// Rounding of a covariance, relative to the two variances that an element belongs to.
constexpr double kRounding = 1e-9;

/// What the sequences have reached: a fuzz that every check turns away would show nothing.
struct Reached {
  std::uint64_t messages{0};
  std::uint64_t published{0};
  std::uint64_t with_heading{0};
  std::uint64_t accepted{0};
  std::uint64_t resets{0};
};

Reached& reached() {
  static Reached total;
  return total;
}

/// Reads numbers from bytes; zeros when they are used up.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  bool is_empty() const { return next_ >= size_; }

  std::uint8_t byte() { return is_empty() ? std::uint8_t{0} : data_[next_++]; }

  /// Mostly near `usual`; now and then anything that a double can be.
  double number(double usual, double spread) {
    static constexpr std::array<double, 14> kWild{0.0,
                                                  -1.0,
                                                  1e-300,
                                                  1e300,
                                                  -1e300,
                                                  1e9,
                                                  -2e10,
                                                  9.81,
                                                  -34.0,
                                                  199.0,
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

  template <typename Matrix>
  void disturb(Matrix& matrix, double spread) {
    for (Eigen::Index i = 0; i < matrix.size(); ++i) {
      matrix(i) = number(matrix(i), spread);
    }
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t next_{0};
};

/// Nobody catches it in libFuzzer, which keeps the input then.
[[noreturn]] void fail(const std::string& filter, const std::string& what) {
  throw std::runtime_error(filter + ": " + what);
}

void check_covariance(const std::string& filter, const char* name, const Matrix6d& covariance) {
  if (!covariance.allFinite()) {
    fail(filter, std::string(name) + " covariance is not finite");
  }
  if (!(covariance.diagonal().minCoeff() > 0.0)) {
    fail(filter, std::string(name) + " variance is not positive");
  }
  // As correlations, so that metres and radians count alike.
  const Eigen::Matrix<double, 6, 1> scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix6d correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  if ((correlation - correlation.transpose()).cwiseAbs().maxCoeff() > kRounding) {
    fail(filter, std::string(name) + " covariance is not symmetric");
  }
  // Positive definite or not: what the least eigenvalue is matters only when not.
  if (correlation.llt().info() != Eigen::Success) {
    const double least =
        Eigen::SelfAdjointEigenSolver<Matrix6d>(correlation, Eigen::EigenvaluesOnly)
            .eigenvalues()(0);
    char text[120];
    std::snprintf(
        text, sizeof(text), "%s covariance: least scaled eigenvalue is %.3g", name, least);
    fail(filter, text);
  }
}

/// One filter, and the rules that its output has to keep.
class Checked {
 public:
  explicit Checked(const std::string& name) : name_(name), filter_(config_of(name), robot()) {}

  GpsOdometry& filter() { return filter_; }

  void check(const Output& output) {
    ++reached().messages;
    for (const Event& event : output.events) {
      // A clock that was reset, and that alone, may take the stamps back.
      if (event.code == "imu_clock_reset") {
        newest_ns_ = std::numeric_limits<Nanoseconds>::min();
      }
    }
    if (output.status) {
      check_status(*output.status);
    }
    if (output.odometry) {
      check_odometry(*output.odometry);
    }
  }

  void check_end() {
    const GpsStatus status = filter_.status();
    check_status(status);
    reached().accepted += status.fixes_accepted;
    reached().resets += status.reset.counter;
    for (const NamedCount& count : status.rejections) {
      if (count.count > 0 &&
          (count.name == "state_not_finite" || count.name == "output_not_finite")) {
        fail(name_, count.name);
      }
    }
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

  void check_odometry(const Odometry& odometry) {
    ++reached().published;
    if (!odometry.T_frame_child.is_finite() || !odometry.linear_mps.allFinite() ||
        !odometry.angular_radps.allFinite()) {
      fail(name_, "state is not finite");
    }
    check_covariance(name_, "pose", odometry.pose_covariance);
    check_covariance(name_, "twist", odometry.twist_covariance);
    reached().with_heading += odometry.pose_covariance(5, 5) < 1.0;
    if (odometry.stamp_ns <= newest_ns_) {
      fail(name_, "stamps do not go forward");
    }
    newest_ns_ = odometry.stamp_ns;
  }

  void check_status(const GpsStatus& status) {
    if (status.last_accepted_fix_ns == 0) {
      return;
    }
    const Eigen::Matrix3d& P = status.accepted_covariance_map_m2;
    if (!status.accepted_antenna_map_m.allFinite() || !P.allFinite() ||
        P.llt().info() != Eigen::Success) {
      fail(name_, "accepted position or its covariance");
    }
  }

  std::string name_;
  GpsOdometry filter_;
  Nanoseconds newest_ns_{std::numeric_limits<Nanoseconds>::min()};
};

/// A vehicle that drives north, as far as the bytes let it.
class Sequence {
 public:
  Sequence(Bytes& bytes, Checked& checked) : bytes_(bytes), checked_(checked) {}

  void run() {
    checked_.check(checked_.filter().on_datum(kDatum));
    begin(bytes_.byte());
    while (!bytes_.is_empty()) {
      const std::uint8_t kind = bytes_.byte();
      if (kind < 4) {
        Datum datum{49.0, 8.4, 100.0, bytes_.byte()};
        datum.latitude_deg = bytes_.number(49.0, 0.001);
        datum.longitude_deg = bytes_.number(8.4, 0.001);
        datum.height_m = bytes_.number(100.0, 10.0);
        checked_.check(checked_.filter().on_datum(datum));
      } else if (kind < 114) {
        imu_group(1 + kind % 8);
      } else if (kind < 122) {
        checked_.check(checked_.filter().on_twist(twist()));
      } else if (kind < 130) {
        checked_.check(checked_.filter().on_yaw(yaw()));
      } else {
        checked_.check(checked_.filter().on_fix(fix()));
      }
    }
    checked_.check_end();
  }

 private:
  static inline const Datum kDatum{49.0, 8.4, 100.0, 0};

  /// So that short sequences also meet filters that run: most are told their start by another
  /// filter (as the bytes disturb it), some find it in a drive without faults.
  void begin(std::uint8_t kind) {
    if (kind < 32) {
      return;
    }
    tame_imu(kWarmUpSamples);
    if (kind < 200) {
      checked_.check(checked_.filter().on_odometry(heard(kind), kDatum.id()));
      tame_imu(2);
    } else if (kind < 216) {
      for (int i = 0; i < 20; ++i) {
        tame_imu(10);
        GnssFix fix = tame_fix(now_ns_ - 100'000'000);
        fix.covariance_enu_m2 = 4e-4 * Eigen::Matrix3d::Identity();
        checked_.check(checked_.filter().on_fix(fix));
      }
    }
  }

  Odometry heard(std::uint8_t kind) {
    Odometry odometry;
    odometry.stamp_ns = now_ns_ - 100'000'000;
    odometry.frame_id = "map";
    odometry.child_frame_id = "base_link";
    odometry.T_frame_child.q = Eigen::AngleAxisd(1.5707963, Eigen::Vector3d::UnitZ());
    odometry.T_frame_child.p.y() = kSpeed_mps * to_seconds(now_ns_ - kStart_ns);
    odometry.linear_mps.x() = kSpeed_mps;
    odometry.pose_covariance = 0.01 * Matrix6d::Identity();
    odometry.twist_covariance = 0.01 * Matrix6d::Identity();
    if (kind >= 160) {
      bytes_.disturb(odometry.T_frame_child.q.coeffs(), 0.5);
      bytes_.disturb(odometry.T_frame_child.p, 10.0);
      bytes_.disturb(odometry.linear_mps, 5.0);
      bytes_.disturb(odometry.angular_radps, 1.0);
    }
    if (kind >= 180) {
      bytes_.disturb(odometry.pose_covariance, 0.005);
      bytes_.disturb(odometry.twist_covariance, 0.005);
    }
    return odometry;
  }

  void tame_imu(int count) {
    ImuSample sample;
    sample.accel_mps2.z() = 9.81;
    send(sample, count);
  }

  void imu_group(int count) {
    ImuSample sample;
    sample.stamp_ns = stamp();
    sample.gyro_radps = bytes_.vector({0.0, 0.0, 0.0}, 0.5);
    sample.accel_mps2 = bytes_.vector({0.0, 0.0, 9.81}, 2.0);
    checked_.check(checked_.filter().on_imu(sample));
    send(sample, count - 1);
  }

  void send(ImuSample sample, int count) {
    for (int i = 0; i < count; ++i) {
      now_ns_ += kImuStep_ns;
      sample.stamp_ns = now_ns_;
      sample.gyro_radps.x() += 1e-6;  // a sensor that repeats itself is refused
      checked_.check(checked_.filter().on_imu(sample));
    }
  }

  /// The next sample's stamp; now and then the clock moves.
  Nanoseconds stamp() {
    if (bytes_.byte() < 250) {
      return now_ns_ += kImuStep_ns;
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
        return now_ns_ += 1'500'000'000;
      case 6:
        return now_ns_ += 300'000'000'000;
      default:
        return now_ns_ - 120'000'000;
    }
  }

  static GnssFix tame_fix(Nanoseconds stamp_ns) {
    GnssFix fix;
    fix.stamp_ns = stamp_ns;
    fix.status = FixStatus::kGbas;
    fix.latitude_deg = 49.0 + kDegrees * kSpeed_mps * to_seconds(stamp_ns - kStart_ns);
    fix.longitude_deg = 8.4;
    fix.altitude_m = 100.0;
    fix.covariance_type = CovarianceType::kKnown;
    return fix;
  }

  /// Mostly of the last quarter of a second, or up to 0.5 s older than the buffer; some ahead.
  Nanoseconds aiding_stamp() {
    const std::uint8_t age = bytes_.byte();
    return now_ns_ - (age < 240 ? 1'000'000LL * age : 150'000'000LL * (age - 245));
  }

  TwistMeasurement twist() {
    TwistMeasurement twist;
    twist.stamp_ns = aiding_stamp();
    const std::uint8_t kind = bytes_.byte();
    static constexpr std::array<double, 4> kSigmas_mps{0.0, 0.01, 0.3, 100.0};
    const double sigma_mps = kSigmas_mps.at(kind % 4);
    twist.linear_mps = bytes_.vector({kSpeed_mps, 0.0, 0.0}, kind < 200 ? 0.5 : 60.0);
    twist.covariance_m2ps2 = sigma_mps * sigma_mps * Eigen::Matrix3d::Identity();
    if (kind % 5 == 0) {
      bytes_.disturb(twist.covariance_m2ps2, sigma_mps * sigma_mps);
    }
    return twist;
  }

  YawMeasurement yaw() {
    YawMeasurement yaw;
    yaw.stamp_ns = aiding_stamp();
    Eigen::Quaterniond q(
        Eigen::AngleAxisd(bytes_.number(1.5707963, 3.0), Eigen::Vector3d::UnitZ()));
    yaw.variance_rad2 = bytes_.number(0.02, 0.03);
    if (bytes_.byte() % 8 == 0) {
      bytes_.disturb(q.coeffs(), 0.05);
    }
    yaw.q_world_base = q;
    return yaw;
  }

  GnssFix fix() {
    const std::uint8_t age = bytes_.byte();
    GnssFix fix = tame_fix(now_ns_ - (age < 240 ? 1'000'000LL * age : 5'000'000LL * (age - 248)));
    const std::uint8_t kind = bytes_.byte();
    if (kind % 16 == 0) {
      fix.status = static_cast<FixStatus>(static_cast<int>(bytes_.byte() % 5) - 2);
      fix.covariance_type = static_cast<CovarianceType>(bytes_.byte() % 4);
    }
    // From fixes of a centimetre to such of a kilometre.
    static constexpr std::array<double, 4> kSigmas_m{0.01, 0.3, 3.0, 1000.0};
    const double sigma_m = kSigmas_m.at(kind / 16 % 4);
    const double error_m = kind < 200 ? 3.0 * sigma_m : 100.0;
    fix.latitude_deg = bytes_.number(fix.latitude_deg, kDegrees * error_m);
    fix.longitude_deg = bytes_.number(fix.longitude_deg, kDegrees * error_m);
    fix.altitude_m = bytes_.number(fix.altitude_m, error_m);
    fix.covariance_enu_m2 = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
    if (kind % 5 == 0) {
      bytes_.disturb(fix.covariance_enu_m2, sigma_m * sigma_m);
    }
    return fix;
  }

  Bytes& bytes_;
  Checked& checked_;
  Nanoseconds now_ns_{kStart_ns};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (const char* name : kFilters) {
    Bytes bytes(data, size);
    Checked checked(name);
    Sequence(bytes, checked).run();
  }
  return 0;
}

#ifndef TRIGPOINT_LIBFUZZER
namespace {

/// Mostly short, as a sequence's first messages do the most; half of them tame, since so wild a one
/// as chance makes is turned away by the first checks.
std::vector<std::uint8_t> draw(std::uint64_t seed, std::uint64_t number) {
  std::seed_seq both{seed, number};
  std::mt19937_64 random(both);
  const std::uint64_t longest = random() % 16 == 0 ? 400 : 80;
  std::vector<std::uint8_t> bytes(1 + random() % longest);
  const bool tame = random() % 2 == 0;
  for (std::uint8_t& byte : bytes) {
    byte = static_cast<std::uint8_t>(tame && random() % 64 != 0 ? random() % 250 : random() % 256);
  }
  return bytes;
}

std::uint64_t argument(int argc, char** argv, int index, std::uint64_t otherwise) {
  return argc > index ? std::strtoull(argv[index], nullptr, 10) : otherwise;
}

void print(const char* what, std::uint64_t count) {
  std::printf("  %-44s %llu\n", what, static_cast<unsigned long long>(count));
}

}  // namespace

int main(int argc, char** argv) {
  const std::uint64_t sequences = argument(argc, argv, 1, 1000);
  const std::uint64_t seed = argument(argc, argv, 2, 1);
  const std::uint64_t first = argument(argc, argv, 3, 0);
  const std::uint64_t progress = std::max<std::uint64_t>(sequences / 20, 1000);
  std::uint64_t violations = 0;
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t number = first; number < first + sequences; ++number) {
    const std::vector<std::uint8_t> bytes = draw(seed, number);
    try {
      LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
    } catch (const std::exception& error) {
      ++violations;
      std::fprintf(
          stderr, "sequence %llu: %s\n", static_cast<unsigned long long>(number), error.what());
    }
    // Where it was, should a sanitizer end it.
    if ((number - first) % progress == 0) {
      std::fprintf(stderr, "at sequence %llu\n", static_cast<unsigned long long>(number));
    }
  }
  const double duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::printf("%zu filters, seed %llu, %.0f s\n",
              kFilters.size(),
              static_cast<unsigned long long>(seed),
              duration_s);
  print("sequences", sequences);
  print("messages to a filter", reached().messages);
  print("odometries checked", reached().published);
  print("... of which with a heading", reached().with_heading);
  print("fixes accepted", reached().accepted);
  print("resets announced", reached().resets);
  print("sequences with a violation", violations);
  return violations == 0 ? 0 : 1;
}
#endif
