// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "attitude_window.hpp"

#include "trigpoint/base/so3.hpp"

#include <utility>

namespace trigpoint::lio_mapper {

using Eigen::Vector3d;

namespace {

constexpr double kWindow_s = 3.0;
constexpr std::size_t kFewest = 12;  ///< scans in a window that counts
constexpr double kLongestClockStep_s = 0.02;
/// A longer interval between two scans ends the window.
constexpr double kLongestPause_s = 0.35;

}  // namespace

Vector3d AttitudeSample::difference_rad() const {
  return so3_log(q_scan * q_gyro.conjugate());
}

AttitudeWindow AttitudeWindows::interrupt() {
  AttitudeWindow ended = std::exchange(window_, {});
  return ended.samples.size() < kFewest ? AttitudeWindow{} : ended;
}

AttitudeWindow AttitudeWindows::add(Nanoseconds stamp_ns,
                                    const Eigen::Quaterniond& q_odom_base,
                                    const Vector3d& gyro_bias_radps,
                                    const ImuBuffer& imu) {
  const bool ends =
      !window_.samples.empty() && (to_seconds(stamp_ns - window_.end_ns) > kLongestPause_s ||
                                   to_seconds(stamp_ns - window_.begin_ns) > kWindow_s);
  AttitudeWindow ended = ends ? interrupt() : AttitudeWindow{};
  const bool begins = window_.samples.empty();
  const auto steps =
      imu.steps_between(begins ? stamp_ns - 1 : window_.end_ns, stamp_ns, kLongestClockStep_s);
  if (steps.empty()) {
    return ended;
  }
  AttitudeSample sample{0.0, q_odom_base, q_odom_base, Vector3d::Zero()};
  if (begins) {
    window_.begin_ns = stamp_ns;
    gyro_bias_radps_ = gyro_bias_radps;
  } else {
    sample.time_s = to_seconds(stamp_ns - window_.begin_ns);
    sample.q_gyro = window_.samples.back().q_gyro;
    for (const InertialStep& step : steps) {
      sample.q_gyro =
          sample.q_gyro *
          so3_exp(step.duration_s() *
                  (0.5 * (step.begin.gyro_radps + step.end.gyro_radps) - gyro_bias_radps_));
    }
    sample.q_gyro.normalize();
  }
  sample.rate_odom_radps = q_odom_base * (steps.back().end.gyro_radps - gyro_bias_radps_);
  window_.samples.push_back(sample);
  window_.end_ns = stamp_ns;
  return ended;
}

}  // namespace trigpoint::lio_mapper
