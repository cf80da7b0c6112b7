// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What an IMU sample must be before it comes near the filter, and what is learnt from the samples
// alone: the mean specific force (for levelling) and the gyro's bias at rest.
#pragma once

#include "trigpoint/base/gyro_unit_check.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/gps_odometry/config.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::gps_odometry {

/// Half a second in which nothing shook: at rest, or moving very smoothly.
struct QuietWindow {
  Eigen::Vector3d mean_gyro_radps{Eigen::Vector3d::Zero()};  ///< as measured, bias included
  Eigen::Vector3d mean_accel_mps2{Eigen::Vector3d::Zero()};
  double gyro_sigma_radps{0.0};  ///< of the mean, by the spread
};

/// A sample that may be used, in base_link's axes.
struct CheckedImu {
  Nanoseconds stamp_ns{0};
  Eigen::Vector3d gyro_radps{Eigen::Vector3d::Zero()};  ///< bias found at rest removed
  Eigen::Vector3d accel_mps2{Eigen::Vector3d::Zero()};
  Eigen::Vector3d mean_accel_mps2{Eigen::Vector3d::Zero()};  ///< of about half a second
  double gyro_bias_sigma_radps{0.0};
  Eigen::Vector3d raw_gyro_radps{Eigen::Vector3d::Zero()};  ///< as measured, bias included
  std::optional<QuietWindow> quiet;                         ///< just ended
};

/// At the limit of an axis: motion was more than the sample says.
bool is_saturated(const CheckedImu& imu, const Config& config);

struct ImuVerdict {
  std::optional<CheckedImu> sample;  ///< nullopt: refused, or still warming up
  std::string reason;                ///< name of the counter; empty while warming up
  std::string text;
  bool clock_reset{false};  ///< the IMU's clock has moved: start anew at this sample
};

/// Averages gyro samples while nothing moves: low spread of gyro and accelerometer over windows of
/// half a second (research/gps C5).
class RestBias {
 public:
  explicit RestBias(const Config& config);

  void add(Nanoseconds stamp_ns,
           const Eigen::Vector3d& gyro_radps,
           const Eigen::Vector3d& accel_mps2);

  const Eigen::Vector3d& bias_radps() const { return bias_radps_; }

  double sigma_radps() const { return sigma_radps_; }

  /// The window that the newest sample ended, when it was quiet.
  const std::optional<QuietWindow>& quiet() const { return quiet_; }

 private:
  void close_window();

  double rest_sigma_radps_;
  double sigma_radps_;
  Eigen::Vector3d bias_radps_{Eigen::Vector3d::Zero()};
  bool known_{false};
  std::optional<QuietWindow> quiet_;
  Nanoseconds window_start_ns_{0};
  int count_{0};
  Eigen::Vector3d gyro_sum_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gyro_square_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_sum_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_square_{Eigen::Vector3d::Zero()};
};

class ImuChecks {
 public:
  ImuChecks(const Config& config, const Eigen::Quaterniond& q_base_imu);

  ImuVerdict check(const ImuSample& sample);

  /// The last samples were refused because of what the IMU is or how it is mounted.
  bool is_faulty() const { return !fault_.empty(); }

  /// What others found about it; from now on every sample is refused for that reason.
  void condemn(const std::string& reason, const std::string& text);

 private:
  ImuVerdict check_stamp(const ImuSample& sample);
  ImuVerdict check_mean();
  void restart();

  Eigen::Quaterniond q_base_imu_;
  RestBias rest_;
  GyroUnitCheck gyro_unit_;
  std::optional<Nanoseconds> last_ns_;
  std::optional<Nanoseconds> jump_ns_;  ///< newest of the stamps that do not follow last_ns_
  int jump_count_{0};
  int warm_up_{0};
  Eigen::Vector3d mean_accel_mps2_{Eigen::Vector3d::Zero()};
  std::string fault_;
  std::string condemned_text_;  ///< not empty: fault_ stays
  Eigen::Matrix<double, 6, 1> previous_;
  int identical_{0};
};

}  // namespace trigpoint::gps_odometry
