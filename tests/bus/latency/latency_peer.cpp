// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The measuring process of tests/bus/latency_table, and the bare echo beside which it measures;
// linked once with each vendor.
//
//   latency_peer CONFIG... -- echo
//   latency_peer CONFIG... -- drive LOG RECORD full|raw
//
// `drive` puts a recorded drive on the bus at its true rate and hears what comes back: lio/odometry
// for a cloud, fusion/odometry for an IMU sample. RECORD then has a line for each of them that was
// sent while the processes were at work:
//   points|imu,bytes,sent ns,received ns (0: never),processing ms (nan: none told)
// on this process's monotonic clock. `full`: the mapper, the gate and a GPS filter answer; `raw`:
// an `echo`, with the same messages at once.
#include "trigpoint/base/config.hpp"
#include "trigpoint/base/robot.hpp"
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/recording/log.hpp"
#include "trigpoint/shell/shell.hpp"

#include <sys/prctl.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

namespace trigpoint::bus {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

/// A driver hands a sweep over after its last point; by then the IMU sample that the mapper needs
/// for that point is there, so that no waiting for it is in the figures.
constexpr Nanoseconds kAssembly_ns = 7'500'000;
constexpr auto kToFindEachOther = 30s;
constexpr auto kAfterMatching = 1s;  ///< the first samples of a match may be lost
/// By then the processes have all that they need to align map and odom. On a computer with much
/// other work they may not have got so far: the drive waits there.
constexpr Nanoseconds kLeadIn_ns = 4'000'000'000;
constexpr auto kLongestHold = 60s;
constexpr auto kAfterTheFirst = 1s;    ///< answer of all, before anything counts
constexpr auto kBeforeTheEnd = 500ms;  ///< sent, but not counted: a last sweep lacks its IMU
constexpr auto kLongestDrain = 15s;    ///< what is not answered by then is lost
constexpr auto kLastStatus = 200ms;    ///< the processing time comes behind the odometry

Nanoseconds now_ns() {
  return std::chrono::nanoseconds(Clock::now().time_since_epoch()).count();
}

struct Sent {
  std::size_t bytes{0};
  Nanoseconds sent_ns{0};
  Nanoseconds received_ns{0};
  double processing_ms{std::numeric_limits<double>::quiet_NaN()};
};

/// What was sent on one topic, by its stamp, and what came of it.
class Ledger {
 public:
  void sent(Nanoseconds stamp_ns, std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    by_stamp_[stamp_ns] = {bytes, now_ns()};
  }

  /// An answer about what was stamped then; the first one counts.
  void answered(Nanoseconds stamp_ns, Nanoseconds received_ns) {
    const std::lock_guard lock(mutex_);
    if (const auto found = by_stamp_.find(stamp_ns); found != by_stamp_.end()) {
      note(found->second, received_ns);
    }
  }

  /// A sweep's odometry has the stamp of its last point: the newest cloud that began before.
  void answered_at_end(Nanoseconds end_ns, Nanoseconds received_ns) {
    const std::lock_guard lock(mutex_);
    if (Sent* sent = begun_before(end_ns)) {
      note(*sent, received_ns);
    }
  }

  void processed(Nanoseconds end_ns, double processing_ms) {
    const std::lock_guard lock(mutex_);
    if (Sent* sent = begun_before(end_ns); sent != nullptr && processing_ms > 0.0) {
      sent->processing_ms = processing_ms;
    }
  }

  bool all_answered(Nanoseconds from_ns, Nanoseconds to_ns) const {
    const std::lock_guard lock(mutex_);
    return std::all_of(by_stamp_.begin(), by_stamp_.end(), [&](const auto& each) {
      const Sent& sent = each.second;
      return sent.sent_ns < from_ns || sent.sent_ns > to_ns || sent.received_ns != 0;
    });
  }

  void write(std::ostream& out, const char* name, Nanoseconds from_ns, Nanoseconds to_ns) const {
    const std::lock_guard lock(mutex_);
    for (const auto& [stamp_ns, each] : by_stamp_) {
      if (each.sent_ns >= from_ns && each.sent_ns <= to_ns) {
        out << name << "," << each.bytes << "," << each.sent_ns << "," << each.received_ns << ","
            << each.processing_ms << "\n";
      }
    }
  }

 private:
  static void note(Sent& sent, Nanoseconds received_ns) {
    if (sent.received_ns == 0) {
      sent.received_ns = received_ns;
    }
  }

  Sent* begun_before(Nanoseconds end_ns) {
    const auto next = by_stamp_.lower_bound(end_ns);
    return next == by_stamp_.begin() ? nullptr : &std::prev(next)->second;
  }

  mutable std::mutex mutex_;
  std::map<Nanoseconds, Sent> by_stamp_;
};

struct Settings {
  Config bus;
  RobotConfig robot;
};

// ---- the echo -----------------------------------------------------------------------------------

/// Answers in the callback, with the message that the processes would answer with.
int echo(const Settings& settings) {
  Loop loop;  // before every other thread: SIGTERM goes to it
  Participant participant(settings.bus, "latency_echo");
  Publisher lio(participant, topics::lio_odometry);
  Publisher fused(participant, topics::fusion_odometry);
  const auto answer = [](Nanoseconds stamp_ns) {
    Odometry odometry;
    odometry.stamp_ns = stamp_ns;
    odometry.frame_id = "odom";
    odometry.child_frame_id = "base_link";
    return to_message(odometry);
  };
  const Subscription clouds(participant,
                            topics::points.renamed(settings.robot.points_topic),
                            [&](const sensor_msgs::msg::PointCloud2& m, const MessageInfo&) {
                              lio.publish(answer(from_message(m.header().stamp()) + 1));
                            });
  const Subscription imu(participant,
                         topics::imu.renamed(settings.robot.imu_topic),
                         [&](const sensor_msgs::msg::Imu& m, const MessageInfo&) {
                           fused.publish(answer(from_message(m.header().stamp())));
                         });
  loop.run();
  return 0;
}

// ---- the drive ----------------------------------------------------------------------------------

using Message =
    std::variant<sensor_msgs::msg::PointCloud2, sensor_msgs::msg::Imu, sensor_msgs::msg::NavSatFix>;

struct Due {
  Nanoseconds at_ns{0};
  Nanoseconds stamp_ns{0};
  Message message;
};

/// Everything that is to be sent, ready and in order: nothing is read or converted on the way.
std::vector<Due> read_drive(const std::string& log, const RobotConfig& robot) {
  std::vector<Due> all;
  const auto reader = recording::open_log(log, robot);
  while (auto entry = reader->next()) {
    if (const auto* imu = std::get_if<ImuSample>(&entry->measurement)) {
      all.push_back({entry->receive_ns, imu->stamp_ns, to_message(*imu)});
    } else if (const auto* fix = std::get_if<GnssFix>(&entry->measurement)) {
      all.push_back({entry->receive_ns, fix->stamp_ns, to_message(*fix)});
    } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry->measurement)) {
      all.push_back({entry->receive_ns + kAssembly_ns, cloud->stamp_ns, to_message(*cloud)});
    }
  }
  std::stable_sort(
      all.begin(), all.end(), [](const Due& a, const Due& b) { return a.at_ns < b.at_ns; });
  return all;
}

class Drive {
 public:
  Drive(const Settings& settings, bool raw)
      : raw_(raw),
        participant_(settings.bus, "latency_drive"),
        points_(participant_, topics::points.renamed(settings.robot.points_topic)),
        imu_(participant_, topics::imu.renamed(settings.robot.imu_topic)),
        fixes_(participant_, topics::fix.renamed(settings.robot.fix_topic)),
        lio_(participant_,
             topics::lio_odometry,
             [this](const nav_msgs::msg::Odometry& m, const MessageInfo&) {
               const Nanoseconds at_ns = now_ns();
               clouds_sent_.answered_at_end(from_message(m.header().stamp()), at_ns);
             }),
        status_(participant_,
                topics::lio_status,
                [this](const trigpoint_msgs::msg::LioStatus& m, const MessageInfo&) {
                  clouds_sent_.processed(from_message(m.stamp()), m.scan_ms());
                }),
        fused_(participant_,
               topics::fusion_odometry,
               [this](const nav_msgs::msg::Odometry& m, const MessageInfo&) {
                 const Nanoseconds at_ns = now_ns();
                 imu_sent_.answered(from_message(m.header().stamp()), at_ns);
                 Nanoseconds none = 0;
                 first_answer_ns_.compare_exchange_strong(none, at_ns);
               }) {}

  /// Throws when the others do not come.
  void wait_for_everybody() const {
    const auto deadline = Clock::now() + kToFindEachOther;
    const auto there = [this] {
      const int imu_readers = raw_ ? 1 : 2;  // mapper and filter
      const int fix_readers = raw_ ? 0 : 2;  // filter and gate
      return points_.matched() >= 1 && imu_.matched() >= imu_readers &&
             fixes_.matched() >= fix_readers && lio_.matched() >= 1 && fused_.matched() >= 1;
    };
    while (!there()) {
      if (Clock::now() > deadline) {
        throw std::runtime_error("the processes that should answer are not all on the bus");
      }
      std::this_thread::sleep_for(20ms);
    }
    std::this_thread::sleep_for(kAfterMatching);
  }

  void send(const std::vector<Due>& all) {
    Clock::time_point start = Clock::now();
    bool is_leading_in = true;
    for (const Due& due : all) {
      const Nanoseconds at_ns = due.at_ns - all.front().at_ns;
      std::this_thread::sleep_until(start + std::chrono::nanoseconds(at_ns));
      if (is_leading_in && at_ns > kLeadIn_ns) {
        is_leading_in = false;
        start += hold();
      }
      std::visit([&](const auto& message) { send(due.stamp_ns, message); }, due.message);
    }
    counted_to_ns_ = now_ns() - std::chrono::nanoseconds(kBeforeTheEnd).count();
    const auto deadline = Clock::now() + kLongestDrain;
    while (Clock::now() < deadline &&
           !(clouds_sent_.all_answered(counted_from_ns(), counted_to_ns_) &&
             imu_sent_.all_answered(counted_from_ns(), counted_to_ns_))) {
      std::this_thread::sleep_for(20ms);
    }
    std::this_thread::sleep_for(kLastStatus);
  }

  /// False when nothing was ever answered.
  bool write(const std::string& file) const {
    if (first_answer_ns_ == 0) {
      return false;
    }
    std::ofstream out(file);
    clouds_sent_.write(out, "points", counted_from_ns(), counted_to_ns_);
    imu_sent_.write(out, "imu", counted_from_ns(), counted_to_ns_);
    return static_cast<bool>(out.flush());
  }

 private:
  /// Until something was answered; how long that took.
  Clock::duration hold() const {
    const Clock::time_point since = Clock::now();
    while (first_answer_ns_ == 0 && Clock::now() - since < kLongestHold) {
      std::this_thread::sleep_for(5ms);
    }
    return Clock::now() - since;
  }

  Nanoseconds counted_from_ns() const {
    return first_answer_ns_ + std::chrono::nanoseconds(kAfterTheFirst).count();
  }

  void send(Nanoseconds stamp_ns, const sensor_msgs::msg::PointCloud2& message) {
    clouds_sent_.sent(stamp_ns, message.data().size());
    points_.publish(message);
  }

  void send(Nanoseconds stamp_ns, const sensor_msgs::msg::Imu& message) {
    imu_sent_.sent(stamp_ns, sensor_msgs::msg::Imu::getCdrSerializedSize(message));
    imu_.publish(message);
  }

  void send(Nanoseconds, const sensor_msgs::msg::NavSatFix& message) { fixes_.publish(message); }

  bool raw_;
  Ledger clouds_sent_;
  Ledger imu_sent_;
  std::atomic<Nanoseconds> first_answer_ns_{0};
  Nanoseconds counted_to_ns_{0};
  Participant participant_;
  Publisher<sensor_msgs::msg::PointCloud2> points_;
  Publisher<sensor_msgs::msg::Imu> imu_;
  Publisher<sensor_msgs::msg::NavSatFix> fixes_;
  Subscription<nav_msgs::msg::Odometry> lio_;
  Subscription<trigpoint_msgs::msg::LioStatus> status_;
  Subscription<nav_msgs::msg::Odometry> fused_;
};

int drive(const Settings& settings, const std::vector<std::string>& what) {
  const std::vector<Due> all = read_drive(what[1], settings.robot);
  Drive drive(settings, what[3] == "raw");
  drive.wait_for_everybody();
  drive.send(all);
  if (!drive.write(what[2])) {
    throw std::runtime_error("no fusion/odometry was heard, or " + what[2] + " cannot be written");
  }
  return 0;
}

int run(const std::vector<std::string>& arguments) {
  const auto split = std::find(arguments.begin(), arguments.end(), "--");
  const std::vector<std::string> what(split == arguments.end() ? split : split + 1,
                                      arguments.end());
  const bool is_echo = what.size() == 1 && what[0] == "echo";
  if (!is_echo && (what.size() != 4 || what[0] != "drive")) {
    std::cerr << "usage: latency_peer CONFIG... -- echo | drive LOG RECORD full|raw\n";
    return 2;
  }
  Settings settings;
  shell::load_sections(
      {arguments.begin(), split},
      {{"bus", [&](ConfigFields& fields) { describe(settings.bus, fields); }},
       {"robot", [&](ConfigFields& fields) { describe(settings.robot, fields); }}});
  return is_echo ? echo(settings) : drive(settings, what);
}

}  // namespace
}  // namespace trigpoint::bus

int main(int count, char** arguments) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that fails
  try {
    return trigpoint::bus::run({arguments + 1, arguments + count});
  } catch (const std::exception& error) {
    std::cerr << "latency_peer: " << error.what() << "\n";
    return 1;
  }
}
