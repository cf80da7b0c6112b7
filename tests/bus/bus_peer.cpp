// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Another process on the bus for tests, linked once with each vendor:
//   bus_peer DOMAIN TOPIC            its example, again and again until it is killed
//   bus_peer DOMAIN hear TOPIC       hears it until it is killed, and is missed only long after
//   bus_peer DOMAIN stream BYTES     IMU at 400 Hz beside clouds of so many bytes at 10 Hz
//   bus_peer DOMAIN everything       a writer of every topic, each sending its example
//   bus_peer DOMAIN nothing          a reader of every topic
// BUS_PEER_SECURITY in the environment names the folder of its credentials.
#include "bus_fixture.hpp"
#include "matrix_messages.hpp"
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string_view>
#include <thread>
#include <vector>

namespace trigpoint::bus::matrix {
namespace {

using std::this_thread::sleep_for;
using std::this_thread::sleep_until;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kAgain{20};
constexpr std::chrono::seconds kForever{60};

/// The first samples after a match may be lost between vendors, so once is not enough.
int repeat(Participant& participant, const std::string& wanted) {
  bool found = false;
  visit_topics([&]<class T>(const char* name, const Topic<T>& topic, const T& example) {
    if (wanted == name) {
      found = true;
      Publisher<T> publisher(participant, topic);
      while (publisher.publish(example)) {
        sleep_for(kAgain);
      }
    }
  });
  std::fprintf(stderr, "bus_peer: %s %s\n", found ? "cannot publish" : "no topic", wanted.c_str());
  return 1;
}

int hear(Participant& participant, const std::string& wanted) {
  visit_topics([&]<class T>(const char* name, const Topic<T>& topic, const T&) {
    if (wanted == name) {
      Subscription<T> subscription(participant, topic, [](const T&, const MessageInfo&) {});
      pause();
    }
  });
  std::fprintf(stderr, "bus_peer: no topic %s\n", wanted.c_str());
  return 1;
}

/// Of two topics with the same name the first: a participant takes a name with one type only.
template <class Visitor>
void visit_names(Visitor&& visit) {
  std::set<std::string_view> names;
  visit_topics([&]<class T>(const char*, const Topic<T>& topic, const T& example) {
    if (names.insert(topic.name).second) {
      visit(topic, example);
    }
  });
}

int write_everything(Participant& participant) {
  std::vector<std::function<bool()>> writers;
  visit_names([&]<class T>(const Topic<T>& topic, const T& example) {
    writers.push_back([publisher = std::make_shared<Publisher<T>>(participant, topic), example] {
      return publisher->publish(example);
    });
  });
  while (std::all_of(writers.begin(), writers.end(), [](const auto& write) { return write(); })) {
    sleep_for(kAgain);
  }
  std::fprintf(stderr, "bus_peer: cannot publish\n");
  return 1;
}

int hear_everything(Participant& participant) {
  std::vector<std::shared_ptr<void>> readers;
  visit_names([&]<class T>(const Topic<T>& topic, const T&) {
    readers.push_back(
        std::make_shared<Subscription<T>>(participant, topic, [](const T&, const MessageInfo&) {}));
  });
  pause();
  return 1;
}

bool publish(Publisher<sensor_msgs::msg::PointCloud2>& clouds, PointCloudMessage cloud) {
  auto message = to_message(cloud);
  message.header().stamp(to_message(wall_clock_now_ns()));
  return clouds.publish(message);
}

bool publish(Publisher<sensor_msgs::msg::Imu>& samples, ImuSample imu) {
  imu.stamp_ns = wall_clock_now_ns();
  return samples.publish(to_message(imu));
}

int stream(Participant& participant, std::size_t bytes) {
  Publisher clouds(participant, topics::points);
  Publisher samples(participant, topics::imu);
  Publisher begin(participant, kBegin);
  bool all_sent = true;
  while (begin.matched() == 0) {
    all_sent = publish(clouds, numbered_cloud(0, bytes)) && publish(samples, numbered_imu(0));
    sleep_for(kCloudPeriod);
  }
  const auto start = Clock::now();
  std::thread imu([&] {
    for (std::uint32_t number = 1; number <= kImuSamples; ++number) {
      sleep_until(start + number * kImuPeriod);
      all_sent = publish(samples, numbered_imu(number)) && all_sent;
    }
  });
  bool clouds_sent = true;
  for (std::uint32_t number = 1; number <= kClouds; ++number) {
    PointCloudMessage cloud = numbered_cloud(number, bytes);
    sleep_until(start + number * kCloudPeriod);
    clouds_sent = publish(clouds, std::move(cloud)) && clouds_sent;
  }
  imu.join();
  const bool acknowledged =
      clouds.wait_for_acknowledgments(kForever) && samples.wait_for_acknowledgments(kForever);
  return all_sent && clouds_sent && acknowledged ? 0 : 1;
}

}  // namespace
}  // namespace trigpoint::bus::matrix

int main(int count, char** arguments) {
  using namespace trigpoint::bus;
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that fails
  if (count < 3) {
    std::fprintf(stderr,
                 "usage: bus_peer DOMAIN TOPIC | DOMAIN hear TOPIC | DOMAIN stream BYTES | "
                 "DOMAIN everything | DOMAIN nothing\n");
    return 2;
  }
  const std::string what = arguments[2];
  Config config = trigpoint::bus::testing::config_of_domain(std::atoi(arguments[1]));
  if (const char* folder = std::getenv("BUS_PEER_SECURITY")) {
    config.security_folder = folder;
    config.datagram_bytes = 1'472;  // of bringup/profiles/lan.yaml
  }
  if (what == "hear") {
    config.lease_s = 60.0;  // stays matched also when it is stopped
  }
  Participant participant(config, "bus_peer");
  if (count > 3 && what == "hear") {
    return matrix::hear(participant, arguments[3]);
  }
  if (what == "everything" || what == "nothing") {
    return what == "nothing" ? matrix::hear_everything(participant)
                             : matrix::write_everything(participant);
  }
  return count > 3 && what == "stream"
             ? matrix::stream(participant, std::strtoul(arguments[3], nullptr, 10))
             : matrix::repeat(participant, what);
}
