// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/inspect.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace trigpoint::recording {

namespace {

constexpr double kGravity_mps2 = 9.80665;
/// The mean of the specific force over a drive: gravity and the drive's own accelerations.
constexpr double kGravityTolerance_mps2 = 1.0;
/// 2000 degrees a second is the widest range of the IMUs in use.
constexpr double kFastestGyro_radps = 35.0;
constexpr double kSlowestImu_hz = 50.0;
constexpr double kLargestClockDifference_s = 1.0;
constexpr double kGapInPeriods = 5.0;
constexpr double kShortestGap_s = 0.1;

template <class... Arguments>
std::string print(const char* format, Arguments... arguments) {
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(), format, arguments...);
  return text.data();
}

/// Stamps and arrivals of one input.
class Stream {
 public:
  explicit Stream(std::string input) { statistics_.input = std::move(input); }

  void add(Nanoseconds stamp_ns, Nanoseconds receive_ns, const std::string& frame_id) {
    if (statistics_.messages++ == 0) {
      statistics_.frame_id = frame_id;
      first_ns_ = stamp_ns;
      newest_ns_ = stamp_ns;
    }
    latency_sum_s_ += to_seconds(receive_ns - stamp_ns);
    if (stamp_ns < newest_ns_) {
      ++statistics_.backward_stamps;
      return;
    }
    statistics_.longest_gap_s =
        std::max(statistics_.longest_gap_s, to_seconds(stamp_ns - newest_ns_));
    newest_ns_ = stamp_ns;
  }

  InputStatistics statistics() const {
    InputStatistics result = statistics_;
    const double span_s = to_seconds(newest_ns_ - first_ns_);
    const auto messages = static_cast<double>(result.messages);
    result.rate_hz = span_s > 0.0 ? (messages - 1.0) / span_s : 0.0;
    result.latency_s = result.messages > 0 ? latency_sum_s_ / messages : 0.0;
    return result;
  }

 private:
  InputStatistics statistics_;
  Nanoseconds first_ns_{0};
  Nanoseconds newest_ns_{0};
  double latency_sum_s_{0.0};
};

struct ImuContent {
  std::uint64_t samples{0};
  std::uint64_t not_finite{0};
  Eigen::Vector3d force_sum_mps2{Eigen::Vector3d::Zero()};
  double fastest_radps{0.0};

  void add(const ImuSample& imu) {
    if (!imu.accel_mps2.allFinite() || !imu.gyro_radps.allFinite()) {
      ++not_finite;
      return;
    }
    ++samples;
    force_sum_mps2 += imu.accel_mps2;
    fastest_radps = std::max(fastest_radps, imu.gyro_radps.norm());
  }
};

struct FixContent {
  std::uint64_t fixes{0};
  std::uint64_t invalid{0};
  std::uint64_t without_covariance{0};
  std::uint64_t at_zero{0};

  void add(const GnssFix& fix) {
    ++fixes;
    const bool finite = std::isfinite(fix.latitude_deg) && std::isfinite(fix.longitude_deg);
    invalid += fix.status < FixStatus::kFix || !finite ? 1 : 0;
    at_zero += fix.latitude_deg == 0.0 && fix.longitude_deg == 0.0 ? 1 : 0;
    const bool known = fix.covariance_type != CovarianceType::kUnknown &&
                       fix.covariance_enu_m2.diagonal().minCoeff() > 0.0;
    without_covariance += known ? 0 : 1;
  }
};

struct PointsContent {
  std::uint64_t clouds{0};
  std::uint64_t without_time{0};
  std::uint64_t empty{0};
  std::string fields;  ///< of the first cloud

  void add(const PointCloudMessage& cloud) {
    if (clouds++ == 0) {
      for (const auto& field : cloud.fields) {
        fields += (fields.empty() ? "" : " ") + field.name;
      }
    }
    empty += static_cast<std::uint64_t>(cloud.width) * cloud.height == 0 ? 1 : 0;
    without_time += has_time(cloud) ? 0 : 1;
  }

  static bool has_time(const PointCloudMessage& cloud) {
    constexpr std::array<const char*, 6> kNames{
        "time", "t", "timestamp", "offset_time", "time_offset", "time_stamp"};
    return std::any_of(cloud.fields.begin(), cloud.fields.end(), [&](const PointField& field) {
      return std::find(kNames.begin(), kNames.end(), field.name) != kNames.end();
    });
  }
};

class Inspector {
 public:
  void add(const LogEntry& entry) {
    now_ns_ = entry.receive_ns;
    std::visit([&](const auto& measurement) { add(measurement, entry.receive_ns); },
               entry.measurement);
  }

  void broke_off(const std::string& what) { say(Severity::kError, "log_breaks_off", what); }

  Inspection result() {
    judge_imu();
    judge_points();
    judge_fixes();
    Inspection inspection;
    for (const Stream* stream : {&points_, &imu_, &fixes_, &twists_, &yaws_}) {
      const auto statistics = stream->statistics();
      if (statistics.messages > 0) {
        judge_stamps(statistics);
        inspection.inputs.push_back(statistics);
      }
    }
    inspection.events = std::move(events_);
    return inspection;
  }

 private:
  void add(const ImuSample& imu, Nanoseconds receive_ns) {
    imu_.add(imu.stamp_ns, receive_ns, imu.frame_id);
    imu_content_.add(imu);
  }

  void add(const GnssFix& fix, Nanoseconds receive_ns) {
    fixes_.add(fix.stamp_ns, receive_ns, fix.frame_id);
    fix_content_.add(fix);
  }

  void add(const PointCloudMessage& cloud, Nanoseconds receive_ns) {
    points_.add(cloud.stamp_ns, receive_ns, cloud.frame_id);
    points_content_.add(cloud);
  }

  void add(const TwistMeasurement& twist, Nanoseconds receive_ns) {
    twists_.add(twist.stamp_ns, receive_ns, twist.frame_id);
  }

  void add(const YawMeasurement& yaw, Nanoseconds receive_ns) {
    yaws_.add(yaw.stamp_ns, receive_ns, yaw.frame_id);
  }

  void say(Severity severity, const char* code, std::string text) {
    events_.push_back({severity, now_ns_, code, std::move(text)});
  }

  void judge_imu() {
    if (imu_content_.not_finite > 0) {
      say(Severity::kWarning,
          "imu_not_finite",
          print("%llu IMU samples hold values that are not finite.",
                as_printed(imu_content_.not_finite)));
    }
    if (imu_content_.samples == 0) {
      return;
    }
    judge_gravity((imu_content_.force_sum_mps2 / static_cast<double>(imu_content_.samples)).norm());
    if (imu_content_.fastest_radps > kFastestGyro_radps) {
      say(Severity::kError,
          "imu_gyro_in_degrees",
          print("The fastest angular rate is %.1f, expected below %.0f rad/s: it seems to be in "
                "degrees a second.",
                imu_content_.fastest_radps,
                kFastestGyro_radps));
    }
    const double rate_hz = imu_.statistics().rate_hz;
    if (rate_hz > 0.0 && rate_hz < kSlowestImu_hz) {
      say(Severity::kWarning,
          "imu_slow",
          print("The IMU comes at %.1f Hz; below %.0f Hz sweeps can't be undistorted well.",
                rate_hz,
                kSlowestImu_hz));
    }
  }

  void judge_gravity(double mean_force) {
    constexpr double kToleranceG = 0.15;
    if (std::abs(mean_force - 1.0) < kToleranceG) {
      say(Severity::kError,
          "imu_in_g",
          print("The mean specific force is %.3f, expected %.1f m/s^2: it seems to be in g.",
                mean_force,
                kGravity_mps2));
    } else if (mean_force < kGravity_mps2 / 4.0) {
      say(Severity::kError,
          "imu_without_gravity",
          print("The mean specific force is %.3f m/s^2, expected %.1f: the driver seems to remove "
                "gravity.",
                mean_force,
                kGravity_mps2));
    } else if (std::abs(mean_force - kGravity_mps2) > kGravityTolerance_mps2) {
      say(Severity::kWarning,
          "imu_gravity_odd",
          print("The mean specific force is %.3f m/s^2, expected %.1f +- %.1f: wrong unit or "
                "scale, or the IMU turns over.",
                mean_force,
                kGravity_mps2,
                kGravityTolerance_mps2));
    }
  }

  void judge_points() {
    if (points_content_.without_time > 0) {
      say(Severity::kError,
          "points_without_time",
          print("%llu of %llu clouds have no field with the points' times (time, t, timestamp, "
                "...), only: %s. Motion during the sweep can't be undone; set the mapper's "
                "point_time to azimuth or snapshot.",
                as_printed(points_content_.without_time),
                as_printed(points_content_.clouds),
                points_content_.fields.c_str()));
    }
    if (points_content_.empty > 0) {
      say(Severity::kWarning,
          "points_empty",
          print("%llu of %llu clouds are empty.",
                as_printed(points_content_.empty),
                as_printed(points_content_.clouds)));
    }
  }

  void judge_fixes() {
    const auto& content = fix_content_;
    if (content.invalid > 0 && content.invalid == content.fixes) {
      say(Severity::kError,
          "fix_none_valid",
          print("None of %llu fixes is valid (status NO_FIX or no position).",
                as_printed(content.fixes)));
    } else if (content.invalid > 0) {
      say(Severity::kInfo,
          "fix_some_invalid",
          print("%llu of %llu fixes are not valid.",
                as_printed(content.invalid),
                as_printed(content.fixes)));
    }
    if (content.without_covariance > 0) {
      say(Severity::kWarning,
          "fix_covariance_unknown",
          print(
              "%llu of %llu fixes have no usable covariance; the filter's default takes its place.",
              as_printed(content.without_covariance),
              as_printed(content.fixes)));
    }
    if (content.at_zero > 0) {
      say(Severity::kWarning,
          "fix_at_zero",
          print("%llu fixes are at latitude 0, longitude 0.", as_printed(content.at_zero)));
    }
  }

  void judge_stamps(const InputStatistics& input) {
    const char* const name = input.input.c_str();
    if (input.backward_stamps > 0) {
      say(Severity::kWarning,
          "stamps_backward",
          print("%llu of %llu stamps of %s are older than one before.",
                as_printed(input.backward_stamps),
                as_printed(input.messages),
                name));
    }
    if (input.longest_gap_s >
        std::max(kShortestGap_s, kGapInPeriods / std::max(input.rate_hz, 1e-3))) {
      say(Severity::kWarning,
          "stamps_gap",
          print("The longest gap in %s is %.2f s, at a mean rate of %.1f Hz.",
                name,
                input.longest_gap_s,
                input.rate_hz));
    }
    if (std::abs(input.latency_s) > kLargestClockDifference_s) {
      say(Severity::kWarning,
          "clocks_differ",
          print("%s arrives %.3f s after its stamp in the mean, expected 0 to %.0f s: the sensor's "
                "clock is not the recorder's.",
                name,
                input.latency_s,
                kLargestClockDifference_s));
    }
  }

  static unsigned long long as_printed(std::uint64_t value) { return value; }

  Nanoseconds now_ns_{0};
  Stream points_{"points"};
  Stream imu_{"imu"};
  Stream fixes_{"fix"};
  Stream twists_{"twist"};
  Stream yaws_{"yaw"};
  ImuContent imu_content_;
  FixContent fix_content_;
  PointsContent points_content_;
  Events events_;
};

}  // namespace

Inspection inspect_log(LogReader& log, double at_most_s) {
  Inspector inspector;
  std::optional<Nanoseconds> begin_ns;
  try {
    while (const auto entry = log.next()) {
      begin_ns = begin_ns.value_or(entry->receive_ns);
      if (at_most_s > 0.0 && to_seconds(entry->receive_ns - *begin_ns) > at_most_s) {
        break;
      }
      inspector.add(*entry);
    }
  } catch (const LogError& error) {
    inspector.broke_off(error.what());
  }
  return inspector.result();
}

Events inspect(LogReader& log) {
  return inspect_log(log).events;
}

}  // namespace trigpoint::recording
