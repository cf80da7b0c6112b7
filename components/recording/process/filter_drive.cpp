// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "filter_drive.hpp"

#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>
#include <variant>

namespace trigpoint::recording {

namespace {

namespace topics = bus::topics;
using WallClock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr std::uint64_t kFilterImuBurst = 100;
constexpr Nanoseconds kFilterClockPeriod_ns = 10'000'000;
constexpr std::uint64_t kGiveUpAnswers = 5;  // a filter without gps/status is not waited for
constexpr auto kStragglers = 500ms;

/// What the filter says; filled on the bus's threads.
class Notes {
 public:
  template <class T>
  void add(std::vector<Heard<T>> FilterRecord::*list, T message, const bus::MessageInfo& info) {
    {
      const std::scoped_lock lock(mutex_);
      (record_.*list).push_back({std::move(message), info.writer_guid, reached_ns_});
    }
    changed_.notify_all();
  }

  void reach(Nanoseconds data_ns) {
    const std::scoped_lock lock(mutex_);
    reached_ns_ = data_ns;
  }

  std::size_t statuses() {
    const std::scoped_lock lock(mutex_);
    return record_.statuses.size();
  }

  bool wait_for_status(std::size_t before, std::chrono::milliseconds patience) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, patience, [&] { return record_.statuses.size() > before; });
  }

  FilterRecord take() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(record_, {});
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  FilterRecord record_;
  Nanoseconds reached_ns_{0};
};

class FilterDriver {
 public:
  explicit FilterDriver(const FilterDriveOptions& options)
      : options_(options),
        participant_(options.bus, "doctor", options.on_event),
        imu_(participant_, topics::imu.renamed(options.robot.imu_topic)),
        fixes_(participant_, topics::fix.renamed(options.robot.fix_topic)),
        clock_(participant_, topics::clock),
        odometry_(participant_,
                  topics::gps_odometry,
                  [this](const nav_msgs::msg::Odometry& m, const bus::MessageInfo& info) {
                    notes_.add(&FilterRecord::odometry, bus::from_message(m), info);
                  }),
        status_(participant_,
                topics::gps_status,
                [this](const trigpoint_msgs::msg::GpsStatus& m, const bus::MessageInfo& info) {
                  notes_.add(&FilterRecord::statuses, bus::from_message(m), info);
                }),
        datum_(participant_,
               topics::datum,
               [this](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo& info) {
                 notes_.add(&FilterRecord::datums, bus::datum_from_message(m), info);
               }) {}

  void wait_for_filter() {
    const auto deadline = WallClock::now() + options_.wait_for_filter;
    const auto complete = [this] {
      return imu_.matched() > 0 && fixes_.matched() > 0 && odometry_.matched() > 0;
    };
    while (!complete() && WallClock::now() < deadline && !stop_requested()) {
      std::this_thread::sleep_for(20ms);
    }
    if (imu_.matched() == 0 || fixes_.matched() == 0) {
      throw std::runtime_error("nobody reads both " + options_.robot.imu_topic + " (" +
                               std::to_string(imu_.matched()) + " readers) and " +
                               options_.robot.fix_topic + " (" + std::to_string(fixes_.matched()) +
                               "): start the filter first, on the same ROS_DOMAIN_ID");
    }
    std::this_thread::sleep_for(200ms);  // it must have found our readers too
  }

  void publish(const LogEntry& entry) {
    wait_for_time(entry.receive_ns);
    notes_.reach(entry.receive_ns);
    if (entry.receive_ns - clock_ns_ >= kFilterClockPeriod_ns) {
      clock_ns_ = entry.receive_ns;
      clock_.publish(bus::to_clock_message(entry.receive_ns));
    }
    if (const auto* sample = std::get_if<ImuSample>(&entry.measurement)) {
      imu_.publish(bus::to_message(*sample));
      if (++imu_count_ % kFilterImuBurst == 0) {
        imu_.wait_for_acknowledgments(options_.patience);
      }
    } else if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
      send(*fix);
    }
  }

  FilterRecord finish() {
    imu_.wait_for_acknowledgments(options_.patience);
    fixes_.wait_for_acknowledgments(options_.patience);
    std::this_thread::sleep_for(kStragglers);
    FilterRecord record = notes_.take();
    record.imu = imu_count_;
    record.fixes = fix_count_;
    record.unanswered = unanswered_;
    record.stopped = stop_requested();
    return record;
  }

  bool stop_requested() const { return options_.stop && options_.stop(); }

 private:
  void send(const GnssFix& fix) {
    const std::size_t before = notes_.statuses();
    fixes_.publish(bus::to_message(fix));
    ++fix_count_;
    if (unanswered_in_a_row_ >= kGiveUpAnswers) {
      return;
    }
    const bool answered = notes_.wait_for_status(before, options_.patience);
    unanswered_ += answered ? 0 : 1;
    unanswered_in_a_row_ = answered ? 0 : unanswered_in_a_row_ + 1;
  }

  void wait_for_time(Nanoseconds receive_ns) {
    if (first_ns_ == 0) {
      first_ns_ = receive_ns;
      started_ = WallClock::now();
    }
    const auto due = started_ + std::chrono::nanoseconds(static_cast<Nanoseconds>(
                                    static_cast<double>(receive_ns - first_ns_) / options_.rate));
    std::this_thread::sleep_until(due);
  }

  const FilterDriveOptions& options_;
  Notes notes_;
  std::uint64_t imu_count_{0};
  std::uint64_t fix_count_{0};
  std::uint64_t unanswered_{0};
  std::uint64_t unanswered_in_a_row_{0};
  Nanoseconds first_ns_{0};
  Nanoseconds clock_ns_{0};
  WallClock::time_point started_;
  bus::Participant participant_;
  bus::Publisher<sensor_msgs::msg::Imu> imu_;
  bus::Publisher<sensor_msgs::msg::NavSatFix> fixes_;
  bus::Publisher<rosgraph_msgs::msg::Clock> clock_;
  bus::Subscription<nav_msgs::msg::Odometry> odometry_;
  bus::Subscription<trigpoint_msgs::msg::GpsStatus> status_;
  bus::Subscription<sensor_msgs::msg::NavSatFix> datum_;
};

}  // namespace

FilterRecord drive_filter(LogReader& log, const FilterDriveOptions& options) {
  FilterDriver driver(options);
  driver.wait_for_filter();
  while (!driver.stop_requested()) {
    const std::optional<LogEntry> entry = log.next();
    if (!entry) {
      break;
    }
    driver.publish(*entry);
    if (options.progress) {
      options.progress(log.progress());
    }
  }
  return driver.finish();
}

std::optional<Datum> hear_datum(const bus::Config& config, std::chrono::milliseconds wait) {
  std::mutex mutex;
  std::condition_variable changed;
  std::optional<Datum> heard;
  bus::Participant participant(config, "doctor");
  bus::Subscription<sensor_msgs::msg::NavSatFix> datums(
      participant,
      topics::datum,
      [&](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo&) {
        {
          const std::scoped_lock lock(mutex);
          heard = bus::datum_from_message(m);
        }
        changed.notify_all();
      });
  std::unique_lock lock(mutex);
  changed.wait_for(lock, wait, [&] { return heard.has_value(); });
  return heard;
}

}  // namespace trigpoint::recording
