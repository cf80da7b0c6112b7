// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/gyro_unit_check.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace trigpoint {

namespace {

constexpr Nanoseconds kBlock_ns = kNanosecondsPerSecond / 5;
constexpr std::size_t kBlocks = 6;  // in a window
constexpr int kFewestSamples = 4;   // in a block
constexpr Nanoseconds kLongestInterval_ns = kBlock_ns / 2;
constexpr double kFastestTurning_radps = 2.0 * std::numbers::pi;
constexpr double kClaimedTilt_rad = std::numbers::pi / 3.0;
constexpr double kMeasuredTilt_rad = std::numbers::pi / 9.0;
constexpr double kGravity_mps2 = 9.80665;
constexpr double kGravityTolerance_mps2 = 2.0;
constexpr char kRemedy[] =
    "; the gyro seems to speak in degrees a second: multiply it by 0.0174533 (pi/180)";

double angle_between_rad(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

template <class... Arguments>
std::string print(const char* format, Arguments... arguments) {
  std::array<char, 300> text{};
  std::snprintf(text.data(), text.size(), format, arguments...);
  return text.data();
}

}  // namespace

const std::optional<std::string>& GyroUnitCheck::add(Nanoseconds stamp_ns,
                                                     const Eigen::Vector3d& gyro_radps,
                                                     const Eigen::Vector3d& accel_mps2) {
  if (contradiction_) {
    return contradiction_;
  }
  const Nanoseconds interval_ns = stamp_ns - last_ns_;
  last_ns_ = stamp_ns;
  if (blocks_.empty() || interval_ns <= 0 || interval_ns > kLongestInterval_ns) {
    blocks_.clear();
    blocks_.push_back({stamp_ns, stamp_ns});
    return contradiction_;
  }
  Block& block = blocks_.back();
  const Eigen::Vector3d turned_rad = to_seconds(interval_ns) * gyro_radps;
  block.turned_rad += turned_rad;
  block.q_begin_end = (block.q_begin_end * so3_exp(turned_rad)).normalized();
  block.force_sum_mps2 += accel_mps2;
  ++block.samples;
  block.end_ns = stamp_ns;
  if (stamp_ns - block.begin_ns >= kBlock_ns) {
    judge();
    blocks_.push_back({stamp_ns, stamp_ns});
  }
  return contradiction_;
}

void GyroUnitCheck::judge() {
  if (blocks_.size() > kBlocks) {
    blocks_.pop_front();
  }
  const bool enough =
      blocks_.size() == kBlocks && std::all_of(blocks_.begin(), blocks_.end(), [](const Block& b) {
        return b.samples >= kFewestSamples;
      });
  if (!enough) {
    return;
  }
  judge_rate();
  judge_tilt();
}

/// Of the mean rate as a vector: what shakes is not turning.
void GyroUnitCheck::judge_rate() {
  Eigen::Vector3d turned_rad = Eigen::Vector3d::Zero();
  for (const Block& block : blocks_) {
    turned_rad += block.turned_rad;
  }
  const double duration_s = to_seconds(blocks_.back().end_ns - blocks_.front().begin_ns);
  const double rate_radps = turned_rad.norm() / duration_s;
  if (rate_radps > kFastestTurning_radps) {
    contradiction_ = print("the mean angular rate over %.1f s is %.1f rad/s, expected at most %.1f",
                           duration_s,
                           rate_radps,
                           kFastestTurning_radps) +
                     kRemedy;
  }
}

/// A direction fixed in the world turns the other way round in the body: u_end = R^T u_begin.
void GyroUnitCheck::judge_tilt() {
  const bool about_gravity = std::all_of(blocks_.begin(), blocks_.end(), [](const Block& block) {
    return std::abs(block.mean_force_mps2().norm() - kGravity_mps2) < kGravityTolerance_mps2;
  });
  if (contradiction_ || !about_gravity) {
    return;
  }
  Eigen::Quaterniond q_begin_end = Eigen::Quaterniond::Identity();
  for (std::size_t i = 1; i + 1 < blocks_.size(); ++i) {
    q_begin_end = q_begin_end * blocks_[i].q_begin_end;
  }
  const Eigen::Vector3d begin = blocks_.front().mean_force_mps2();
  const double claimed_rad = angle_between_rad(q_begin_end.conjugate() * begin, begin);
  double measured_rad = 0.0;
  for (const Block& block : blocks_) {
    measured_rad = std::max(measured_rad, angle_between_rad(block.mean_force_mps2(), begin));
  }
  if (claimed_rad > kClaimedTilt_rad && measured_rad < kMeasuredTilt_rad) {
    constexpr double kDegrees = 180.0 / std::numbers::pi;
    contradiction_ =
        print(
            "the gyro's rates would tilt the robot by %.0f deg within a second, but the specific "
            "force keeps its direction within %.0f deg",
            claimed_rad * kDegrees,
            measured_rad * kDegrees) +
        kRemedy;
  }
}

}  // namespace trigpoint
