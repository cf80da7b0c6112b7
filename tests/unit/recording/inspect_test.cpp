// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/recording/inspect.hpp"

#include "samples.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::recording {
namespace {

/// A healthy log of two seconds in memory, each entry through `alter`; it may break off at its end.
class MemoryLog : public LogReader {
 public:
  explicit MemoryLog(
      const std::function<void(LogEntry&)>& alter = [](LogEntry&) {},
      bool breaks_off = false)
      : breaks_off_(breaks_off) {
    for (int i = 0; i < 200; ++i) {
      auto imu = sample_imu(i);
      imu.gyro_radps = {0.01, 0.02, 0.03};
      add(imu, alter);
      if (i % 10 == 0) {
        add(sample_fix(i / 10), alter);
        add(sample_cloud(i / 10), alter);
      }
    }
  }

  const LogSummary& summary() const override { return summary_; }

  std::optional<LogEntry> next() override {
    if (next_ == entries_.size()) {
      if (breaks_off_) {
        throw LogError("somewhere.bag: the log breaks off");
      }
      return std::nullopt;
    }
    return entries_[next_++];
  }

  double progress() const override { return 0.0; }

 private:
  template <class Measured>
  void add(const Measured& measured, const std::function<void(LogEntry&)>& alter) {
    entries_.push_back({measured.stamp_ns + 20 * kMillisecond_ns, measured, false});
    alter(entries_.back());
  }

  bool breaks_off_;
  LogSummary summary_;
  std::vector<LogEntry> entries_;
  std::size_t next_{0};
};

/// Alters measurements of one kind.
template <class Measured>
std::function<void(LogEntry&)> each(const std::function<void(Measured&)>& change) {
  return [change](LogEntry& entry) {
    if (auto* measured = std::get_if<Measured>(&entry.measurement)) {
      change(*measured);
    }
  };
}

std::vector<std::string> codes(LogReader& log) {
  std::vector<std::string> found;
  for (const auto& event : inspect(log)) {
    found.push_back(event.code);
  }
  return found;
}

using testing::ElementsAre;
using testing::IsEmpty;

TEST(Inspect, finds_nothing_odd_in_a_healthy_log) {
  MemoryLog log;
  EXPECT_THAT(codes(log), IsEmpty());
}

TEST(Inspect, counts_rates_frames_and_latency) {
  MemoryLog log;
  const auto inputs = inspect_log(log).inputs;
  ASSERT_EQ(3U, inputs.size());
  EXPECT_EQ("imu", inputs[1].input);
  EXPECT_EQ(200U, inputs[1].messages);
  EXPECT_NEAR(100.0, inputs[1].rate_hz, 1e-6);
  EXPECT_EQ("imu_link", inputs[1].frame_id);
  EXPECT_NEAR(0.02, inputs[1].latency_s, 1e-9);
  EXPECT_NEAR(10.0, inputs[0].rate_hz, 1e-6);
}

TEST(Inspect, sees_an_imu_in_g) {
  MemoryLog log(each<ImuSample>([](ImuSample& imu) { imu.accel_mps2 /= 9.80665; }));
  EXPECT_THAT(codes(log), ElementsAre("imu_in_g"));
}

TEST(Inspect, sees_an_imu_whose_gravity_is_removed) {
  MemoryLog log(each<ImuSample>([](ImuSample& imu) { imu.accel_mps2.z() -= 9.80665; }));
  EXPECT_THAT(codes(log), ElementsAre("imu_without_gravity"));
}

TEST(Inspect, sees_angular_rates_in_degrees) {
  MemoryLog log(each<ImuSample>([](ImuSample& imu) { imu.gyro_radps.z() = 57.3; }));
  EXPECT_THAT(codes(log), ElementsAre("imu_gyro_in_degrees"));
}

TEST(Inspect, sees_points_without_time) {
  MemoryLog log(each<PointCloudMessage>([](PointCloudMessage& cloud) { cloud.fields.pop_back(); }));
  EXPECT_THAT(codes(log), ElementsAre("points_without_time"));
}

TEST(Inspect, sees_that_no_fix_is_valid) {
  MemoryLog log(each<GnssFix>([](GnssFix& fix) { fix.status = FixStatus::kNoFix; }));
  EXPECT_THAT(codes(log), ElementsAre("fix_none_valid"));
}

TEST(Inspect, sees_a_covariance_of_zero) {
  MemoryLog log(each<GnssFix>([](GnssFix& fix) { fix.covariance_enu_m2.setZero(); }));
  EXPECT_THAT(codes(log), ElementsAre("fix_covariance_unknown"));
}

TEST(Inspect, sees_stamps_that_step_back) {
  MemoryLog log(each<ImuSample>([](ImuSample& imu) {
    if (imu.stamp_ns == sample_imu(50).stamp_ns) {
      imu.stamp_ns -= 50 * kMillisecond_ns;
    }
  }));
  EXPECT_THAT(codes(log), ElementsAre("stamps_backward"));
}

TEST(Inspect, sees_a_hole) {
  MemoryLog log(each<ImuSample>([](ImuSample& imu) {
    if (imu.stamp_ns > sample_imu(50).stamp_ns) {
      imu.stamp_ns += 550 * kMillisecond_ns;
    }
  }));
  EXPECT_THAT(codes(log), ElementsAre("stamps_gap"));
}

TEST(Inspect, sees_a_sensor_with_a_clock_of_its_own) {
  MemoryLog log(each<PointCloudMessage>(
      [](PointCloudMessage& cloud) { cloud.stamp_ns -= 3600 * kNanosecondsPerSecond; }));
  EXPECT_THAT(codes(log), ElementsAre("clocks_differ"));
}

TEST(Inspect, tells_where_a_log_breaks_off) {
  MemoryLog log([](LogEntry&) {}, true);
  EXPECT_THAT(codes(log), ElementsAre("log_breaks_off"));
}

}  // namespace
}  // namespace trigpoint::recording
