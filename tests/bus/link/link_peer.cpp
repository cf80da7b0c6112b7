// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A process on one of two computers, for tests/bus/link_table; linked once with each vendor.
//
//   link_peer RECORD CONFIG... -- write:TOPIC[:BYTES] hear:TOPIC ...
//
// Writes numbered messages at the usual rate of their topic (points, imu, lio, gps) and hears them,
// until SIGTERM; RECORD then says what happened, one line each:
//   write,TOPIC,NUMBER,wall clock ns,ns that publish() took
//   hear,TOPIC,NUMBER,wall clock ns,ns since it was written
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/shell/shell.hpp"

#include "../matrix_messages.hpp"
#include <sys/prctl.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <functional>
#include <iostream>
#include <mutex>
#include <thread>

namespace trigpoint::bus {
namespace {

using matrix::wall_clock_now_ns;

class Record {
 public:
  explicit Record(std::string file) : file_(std::move(file)) {}

  void add(const char* event, const std::string& topic, std::uint32_t number, Nanoseconds took_ns) {
    const std::lock_guard lock(mutex_);
    lines_.push_back({event, topic, number, wall_clock_now_ns(), took_ns});
  }

  void write() const {
    std::ofstream out(file_);
    for (const Line& line : lines_) {
      out << line.event << "," << line.topic << "," << line.number << "," << line.at_ns << ","
          << line.took_ns << "\n";
    }
  }

 private:
  struct Line {
    const char* event;
    std::string topic;
    std::uint32_t number;
    Nanoseconds at_ns;
    Nanoseconds took_ns;
  };

  std::string file_;
  std::mutex mutex_;
  std::deque<Line> lines_;
};

// ---- numbered messages, with the wall clock as their stamp --------------------------------------

struct Numbered {
  std::uint32_t number{0};
  std::size_t bytes{0};  ///< of a cloud
};

void make(const Numbered& wanted, sensor_msgs::msg::PointCloud2& message) {
  if (message.data().empty()) {
    message = to_message(matrix::numbered_cloud(0, wanted.bytes));
  }
  message.height(wanted.number);
  message.header().stamp(to_message(wall_clock_now_ns()));
}

void make(const Numbered& wanted, sensor_msgs::msg::Imu& message) {
  ImuSample imu = matrix::numbered_imu(wanted.number);
  imu.stamp_ns = wall_clock_now_ns();
  message = to_message(imu);
}

void make(const Numbered& wanted, nav_msgs::msg::Odometry& message) {
  Odometry odometry = samples::odometry();
  odometry.stamp_ns = wall_clock_now_ns();
  message = to_message(odometry);
  message.pose().pose().position().x(wanted.number);
}

std::uint32_t number_of(const sensor_msgs::msg::PointCloud2& message) {
  return message.height();
}

std::uint32_t number_of(const sensor_msgs::msg::Imu& message) {
  return static_cast<std::uint32_t>(message.angular_velocity().x());
}

std::uint32_t number_of(const nav_msgs::msg::Odometry& message) {
  return static_cast<std::uint32_t>(message.pose().pose().position().x());
}

/// Calls `visit(topic, usual rate)` for the topic of that name; false when there is none.
template <class Visitor>
bool visit_topic(const std::string& name, Visitor&& visit) {
  if (name == "points") {
    visit(topics::points, 10);
  } else if (name == "imu") {
    visit(topics::imu, 400);
  } else if (name == "lio") {
    visit(topics::lio_odometry, 10);
  } else if (name == "gps") {
    visit(topics::gps_odometry, 50);
  } else {
    return false;
  }
  return true;
}

// ---- writing and hearing ------------------------------------------------------------------------

template <class T>
void keep_writing(const std::stop_token& stop,
                  Participant& participant,
                  const Topic<T>& topic,
                  int rate_hz,
                  const std::string& name,
                  std::size_t bytes,
                  Record& record) {
  Publisher<T> publisher(participant, topic);
  T message;
  Numbered wanted{0, bytes};
  const std::chrono::nanoseconds period(1'000'000'000 / rate_hz);
  for (auto due = std::chrono::steady_clock::now(); !stop.stop_requested(); due += period) {
    std::this_thread::sleep_until(due);
    ++wanted.number;
    make(wanted, message);
    const auto before = std::chrono::steady_clock::now();
    publisher.publish(message);
    record.add("write",
               name,
               wanted.number,
               std::chrono::nanoseconds(std::chrono::steady_clock::now() - before).count());
  }
}

class Peer {
 public:
  Peer(const Config& config, const std::string& record_file)
      : record_(record_file), participant_(config, "link_peer", [](const Event& event) {
          std::cerr << event.code << ": " << event.text << "\n";
        }) {}

  ~Peer() {
    writers_.clear();
    record_.write();
  }

  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  /// "write:points:500000", "hear:imu"; false when that is nothing.
  bool add(const std::string& role) {
    const std::size_t first = role.find(':');
    const std::size_t second = role.find(':', first + 1);
    const std::string verb = role.substr(0, first);
    const std::string name = role.substr(first + 1, second - first - 1);
    const std::size_t bytes =
        second == std::string::npos ? 1 : std::strtoul(role.c_str() + second + 1, nullptr, 10);
    return visit_topic(name, [&]<class T>(const Topic<T>& topic, int rate_hz) {
      if (verb == "write") {
        writers_.emplace_back([=, this](const std::stop_token& stop) {
          keep_writing(stop, participant_, topic, rate_hz, name, bytes, record_);
        });
      } else {
        hear(topic, name);
      }
    });
  }

 private:
  template <class T>
  void hear(const Topic<T>& topic, const std::string& name) {
    subscriptions_.push_back(std::make_shared<Subscription<T>>(
        participant_, topic, [this, name](const T& message, const MessageInfo& info) {
          record_.add("hear",
                      name,
                      number_of(message),
                      info.reception_stamp_ns - from_message(message.header().stamp()));
        }));
  }

  Record record_;
  Participant participant_;
  std::deque<std::jthread> writers_;
  std::vector<std::shared_ptr<void>> subscriptions_;
};

int run(const std::vector<std::string>& arguments) {
  const auto split = std::find(arguments.begin(), arguments.end(), "--");
  if (arguments.size() < 2 || split == arguments.end()) {
    std::cerr << "usage: link_peer RECORD CONFIG... -- write:TOPIC[:BYTES] hear:TOPIC ...\n";
    return 2;
  }
  Config config;
  shell::load_sections({arguments.begin() + 1, split},
                       {{"bus", [&](ConfigFields& fields) { describe(config, fields); }}});
  Loop loop;  // before every other thread: SIGTERM goes to it
  Peer peer(config, arguments.front());
  for (auto role = split + 1; role != arguments.end(); ++role) {
    if (!peer.add(*role)) {
      std::cerr << "link_peer: no role " << *role << "\n";
      return 2;
    }
  }
  loop.run();
  return 0;
}

}  // namespace
}  // namespace trigpoint::bus

int main(int count, char** arguments) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that fails
  return trigpoint::bus::run({arguments + 1, arguments + count});
}
