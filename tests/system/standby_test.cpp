// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Two GPS filters as programs, each with fixes of its own: the gate leaves the one that loses them.
// Times are data time, so that a loaded computer delays the test but does not fail it.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/participant_of.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "player.hpp"
#include "run_command.hpp"
#include "wait_until.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using tests::Command;
namespace topics = bus::topics;

constexpr double kHandOver_s = 0.5;      // issue
constexpr double kLargestStep_m = 0.05;  // issue 5's bound of a step
constexpr double kCut_s = 18.0;  // both have found their heading, GPS carries fusion/odometry
constexpr double kApart_deg = 0.2 / 111e3;  // what a change without hand-over would step by
constexpr double kAfterwards_s = 4.0;
constexpr double kDeadReckoning_s = 1.25;  // README of gps_odometry: two and a half fix intervals

const char* const kDrive = R"(
name: standby
duration_s: 60.0
route: {type: figure_eight, length_m: 60.0, width_m: 30.0, speed_mps: 3.0, laps: 8}
imu: {rate_hz: 100.0}
gnss: {gnss_class: fixed, rate_hz: 2.0, latency_s: 0.12, noise_scale: 0.2}
)";

constexpr std::array<const char*, 2> kFilters{"eskf18", "ekf15"};

std::string fixes_of(const std::string& filter) {
  return "gps/fix_" + filter;
}

/// What is on the bus while it drives. Hands the receiver's fixes to each filter until they are cut
/// off.
class StandbyRoad {
 public:
  StandbyRoad() : participant_(bus::Config{}, "standby_test") {
    for (const char* filter : kFilters) {
      to_filter_.try_emplace(filter, participant_, topics::fix.renamed(fixes_of(filter)));
    }
    fixes_.emplace(participant_,
                   topics::fix,
                   [this](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo&) {
                     const std::scoped_lock lock(mutex_);
                     GnssFix fix = bus::from_message(m);
                     for (auto& [filter, publisher] : to_filter_) {
                       if (filter != cut_) {
                         publisher.publish(bus::to_message(fix));
                       }
                       fix.latitude_deg += kApart_deg;
                     }
                   });
    statuses_.emplace(
        participant_,
        topics::gps_status,
        [this](const trigpoint_msgs::msg::GpsStatus& m, const bus::MessageInfo& info) {
          const GpsStatus status = bus::from_message(m);
          const std::scoped_lock lock(mutex_);
          names_[bus::participant_of(info.writer_guid)] = status.source;
          newest_[status.source] = status;
          if (status.source == cut_ && !degraded_ && status.health != GpsHealth::kOk) {
            degraded_ = status;
          }
        });
    fused_status_.emplace(
        participant_,
        topics::fusion_status,
        [this](const trigpoint_msgs::msg::FusionStatus& m, const bus::MessageInfo&) {
          const FusionStatus status = bus::from_message(m);
          const std::scoped_lock lock(mutex_);
          followed_ = names_.contains(status.gps_source) ? names_.at(status.gps_source) : "";
          if (!cut_.empty() && !followed_.empty() && followed_ != cut_ && !handed_over_ns_) {
            handed_over_ns_ = status.stamp_ns;
          }
        });
    fused_.emplace(participant_,
                   topics::fusion_odometry,
                   [this](const nav_msgs::msg::Odometry& m, const bus::MessageInfo&) {
                     const std::scoped_lock lock(mutex_);
                     trajectory_.push_back(bus::from_message(m));
                   });
  }

  /// Drives until some seconds after the gate has changed over.
  void drive() {
    const auto scenario = simulator::load_scenario_text(kDrive, "standby");
    const auto reader = simulator::open_scenario(scenario, 3, std::nullopt, {.lidar = false});
    truth_ = reader->truth();
    recording::PlayOptions options;
    options.rate = 1.0;
    options.settle = 2s;
    options.on_entry = [&](const recording::LogEntry& entry) { at(entry.receive_ns); };
    options.stop = [&] {
      const std::scoped_lock lock(mutex_);
      return handed_over_ns_ && to_seconds(now_ns_ - *handed_over_ns_) > kAfterwards_s;
    };
    recording::play(*reader, options);
  }

  std::string cut() const {
    const std::scoped_lock lock(mutex_);
    return cut_;
  }

  std::optional<GpsStatus> degraded() const {
    const std::scoped_lock lock(mutex_);
    return degraded_;
  }

  std::optional<Nanoseconds> handed_over_ns() const {
    const std::scoped_lock lock(mutex_);
    return handed_over_ns_;
  }

  /// Of what is published, beyond the robot's own motion, from the cut on.
  double largest_step_m() const {
    const std::scoped_lock lock(mutex_);
    double largest_m = 0.0;
    for (std::size_t k = 1; k < trajectory_.size(); ++k) {
      const Odometry& before = trajectory_[k - 1];
      const Odometry& now = trajectory_[k];
      if (before.stamp_ns < cut_ns_) {
        continue;
      }
      const Pose truth_before = truth_->at(before.stamp_ns).T_map_base;
      const Pose truth_now = truth_->at(now.stamp_ns).T_map_base;
      const Eigen::Vector3d driven_m = truth_now.p - truth_before.p;
      const Eigen::Vector3d moved_m = now.T_frame_child.p - before.T_frame_child.p;
      largest_m = std::max(largest_m, (moved_m - driven_m).norm());
    }
    return largest_m;
  }

  std::size_t fused_after_cut() const {
    const std::scoped_lock lock(mutex_);
    return static_cast<std::size_t>(
        std::count_if(trajectory_.begin(), trajectory_.end(), [this](const Odometry& each) {
          return each.stamp_ns > cut_ns_;
        }));
  }

 private:
  /// Cuts the followed filter off when both are well.
  void at(Nanoseconds now_ns) {
    const std::scoped_lock lock(mutex_);
    now_ns_ = now_ns;
    const bool both_well =
        std::all_of(kFilters.begin(), kFilters.end(), [this](const char* filter) {
          const auto found = newest_.find(filter);
          return found != newest_.end() && found->second.health == GpsHealth::kOk;
        });
    if (cut_.empty() && both_well && !followed_.empty() && !trajectory_.empty() &&
        to_seconds(now_ns - truth_->first_ns()) > kCut_s) {
      cut_ = followed_;
      cut_ns_ = now_ns;
    }
  }

  mutable std::mutex mutex_;
  std::shared_ptr<const simulator::Truth> truth_;
  std::map<std::string, std::string> names_;  ///< filter of a participant
  std::map<std::string, GpsStatus> newest_;
  std::string followed_;
  std::string cut_;
  Nanoseconds cut_ns_{0};
  Nanoseconds now_ns_{0};
  std::optional<GpsStatus> degraded_;
  std::optional<Nanoseconds> handed_over_ns_;
  std::vector<Odometry> trajectory_;
  bus::Participant participant_;
  std::map<std::string, bus::Publisher<sensor_msgs::msg::NavSatFix>> to_filter_;
  std::optional<bus::Subscription<sensor_msgs::msg::NavSatFix>> fixes_;
  std::optional<bus::Subscription<trigpoint_msgs::msg::GpsStatus>> statuses_;
  std::optional<bus::Subscription<trigpoint_msgs::msg::FusionStatus>> fused_status_;
  std::optional<bus::Subscription<nav_msgs::msg::Odometry>> fused_;
};

TEST(Standby, takes_over_within_half_a_second_from_a_filter_that_loses_its_fixes_without_a_step) {
  setenv("ROS_DOMAIN_ID", tests::own_domain(117).c_str(), 1);
  const tests::TemporaryFolder folder;
  StandbyRoad road;
  const auto datum = simulator::load_scenario_text(kDrive, "standby").datum;
  const auto start = [&](const std::string& filter) {
    const std::string config = folder.path(filter + ".yaml");
    tests::write_file(config,
                      "robot:\n  fix_topic: " + fixes_of(filter) +
                          "\ngps_odometry:\n  use_configured_datum: true\n"
                          "  datum_latitude_deg: " +
                          std::to_string(datum.latitude_deg) +
                          "\n  datum_longitude_deg: " + std::to_string(datum.longitude_deg) +
                          "\n  datum_height_m: " + std::to_string(datum.height_m) + "\n");
    return std::vector<std::string>{
        std::string(TRIGPOINT_BIN_DIR) + "/trigpoint_gps_" + filter, "--config", config};
  };
  const Command gate({std::string(TRIGPOINT_BIN_DIR) + "/trigpoint_fusion_gate"});
  const Command first(start(kFilters[0]));
  const Command second(start(kFilters[1]));
  road.drive();
  const std::string said = gate.output_so_far() + first.output_so_far() + second.output_so_far();
  ASSERT_NE(road.cut(), "") << "never both well: " << said;
  ASSERT_TRUE(road.degraded()) << said;
  ASSERT_TRUE(road.handed_over_ns()) << said;
  const GpsStatus degraded = *road.degraded();
  const double degrades_s = to_seconds(degraded.last_accepted_fix_ns) + kDeadReckoning_s;
  const double told_after_s = to_seconds(degraded.stamp_ns) - degrades_s;
  const double after_s = to_seconds(*road.handed_over_ns()) - degrades_s;
  std::printf("%s degrades: told after %.3f s, handed over after %.3f s, largest step %.3f m\n",
              road.cut().c_str(),
              told_after_s,
              after_s,
              road.largest_step_m());
  EXPECT_GT(after_s, 0.0);
  EXPECT_LT(after_s, kHandOver_s);
  EXPECT_GT(road.fused_after_cut(), 100U) << "GPS alone carries fusion/odometry";
  EXPECT_LT(road.largest_step_m(), kLargestStep_m);
}

/// It says so after 2 s without a fix.
TEST(Passthrough, says_that_it_has_no_fixes_with_the_imu_sample_that_shows_it) {
  setenv("ROS_DOMAIN_ID", tests::own_domain(118).c_str(), 1);
  bus::Participant participant(bus::Config{}, "passthrough_test");
  std::mutex mutex;
  GpsStatus newest;
  const auto heard = [&] {
    const std::scoped_lock lock(mutex);
    return newest;
  };
  const bus::Subscription<trigpoint_msgs::msg::GpsStatus> statuses(
      participant,
      topics::gps_status,
      [&](const trigpoint_msgs::msg::GpsStatus& m, const bus::MessageInfo&) {
        const std::scoped_lock lock(mutex);
        if (newest.health != GpsHealth::kDeadReckoning) {
          newest = bus::from_message(m);
        }
      });
  bus::Publisher datums(participant, topics::datum);
  datums.publish(bus::to_message(Datum{49.0, 8.0, 100.0, 0}));
  bus::Publisher fixes(participant, topics::fix);
  bus::Publisher imu(participant, topics::imu);
  const Command filter({std::string(TRIGPOINT_BIN_DIR) + "/trigpoint_gps_passthrough"});
  GnssFix fix;
  fix.stamp_ns = from_seconds(1000.0);
  fix.status = FixStatus::kFix;
  fix.latitude_deg = 49.0;
  fix.longitude_deg = 8.0;
  fix.altitude_m = 100.0;
  fix.covariance_enu_m2 = Eigen::Matrix3d::Identity();
  fix.covariance_type = CovarianceType::kKnown;
  ASSERT_TRUE(tests::wait_until(
      [&] {
        fix.stamp_ns += from_seconds(0.1);
        fixes.publish(bus::to_message(fix));
        return heard().health == GpsHealth::kOk && imu.matched() > 0;
      },
      20s))
      << filter.output_so_far();
  ImuSample sample;
  sample.stamp_ns = fix.stamp_ns;
  ASSERT_TRUE(tests::wait_until(
      [&] {
        sample.stamp_ns += from_seconds(0.01);
        imu.publish(bus::to_message(sample));
        return heard().health == GpsHealth::kDeadReckoning;
      },
      20s))
      << filter.output_so_far();
  const GpsStatus told = heard();
  const double age_s = to_seconds(told.stamp_ns - told.last_accepted_fix_ns);
  EXPECT_GT(age_s, 2.0);
  EXPECT_LT(age_s, 2.015);
}

}  // namespace
}  // namespace trigpoint
