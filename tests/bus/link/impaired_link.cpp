// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A cable between two network namespaces that can be bad: delay, loss, rate with a tail-drop queue,
// no multicast, unplugged. In user space between two TAP devices, since not every kernel has netem.
//
//   impaired_link      prints "ready PATH PATH", the two namespaces for nsenter --net, and obeys
//                      lines on standard input until it ends:
//     delay MS | loss PERCENT | rate MBIT QUEUE_MS | multicast on|off | link up|down | count
//   `count` answers with frames, bytes, lost and queue drops of both directions.
//
// Addresses are 10.77.0.1 and 10.77.0.2 on "lan0". Exit code 77: such a link cannot be made here.
#include <arpa/inet.h>
#include <fcntl.h>
#include <net/if.h>
// after net/if.h
#include <linux/if_tun.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <iostream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;
using Duration = std::chrono::nanoseconds;

constexpr int kCannot = 77;  // of ctest: skipped
constexpr std::size_t kLargestFrame_bytes = 2048;
constexpr int kDeviceQueue_frames = 10'000;  // drops are ours alone

[[noreturn]] void cannot(const std::string& what) {
  std::cout << "no impaired link here: " << what << ": " << std::strerror(errno) << std::endl;
  std::exit(kCannot);
}

void configure(int socket, unsigned long request, ifreq& device, const char* what) {
  if (ioctl(socket, request, &device) != 0) {
    cannot(what);
  }
}

ifreq named(const char* name) {
  ifreq device{};
  std::strncpy(device.ifr_name, name, IFNAMSIZ - 1);
  return device;
}

void bring_up(int socket, const char* name) {
  ifreq device = named(name);
  device.ifr_flags = IFF_UP | IFF_RUNNING | IFF_MULTICAST;
  configure(socket, SIOCSIFFLAGS, device, "bringing a device up");
}

void set_address(int socket, unsigned long request, const char* address) {
  ifreq device = named("lan0");
  auto& inet = reinterpret_cast<sockaddr_in&>(device.ifr_addr);
  inet.sin_family = AF_INET;
  inet_pton(AF_INET, address, &inet.sin_addr);
  configure(socket, request, device, "setting an address");
}

struct Computer {
  int network{-1};  ///< namespace
  int tap{-1};      ///< every frame that it sends, and receives
};

/// This process moves into the new namespace, where the device must be made.
Computer make_computer(const char* address) {
  if (unshare(CLONE_NEWNET) != 0) {
    cannot("a network namespace");
  }
  Computer computer{open("/proc/self/ns/net", O_RDONLY | O_CLOEXEC),
                    open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC)};
  ifreq device = named("lan0");
  device.ifr_flags = IFF_TAP | IFF_NO_PI;
  if (computer.tap < 0) {
    cannot("/dev/net/tun");
  }
  configure(computer.tap, TUNSETIFF, device, "a TAP device");
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  device = named("lan0");
  device.ifr_qlen = kDeviceQueue_frames;
  configure(socket, SIOCSIFTXQLEN, device, "a queue");
  set_address(socket, SIOCSIFADDR, address);
  set_address(socket, SIOCSIFNETMASK, "255.255.255.0");
  bring_up(socket, "lan0");
  bring_up(socket, "lo");
  close(socket);
  return computer;
}

struct Impairments {
  Duration delay{0};
  double loss{0.0};  ///< of each frame, 0 to 1
  double bits_per_second{0.0};
  Duration queue{0};  ///< a frame that would wait longer is dropped
  bool multicast{true};
  bool up{true};
};

struct Counters {
  long frames{0};
  long bytes{0};
  long lost{0};
  long queue_drops{0};
};

class Direction {
 public:
  Direction(int from, int to) : from_(from), to_(to) {}

  Counters counters;

  int from() const { return from_; }

  void take(const Impairments& how, std::mt19937& random) {
    constexpr int kBurst = 256;  // then the other direction has its turn
    for (int i = 0; i < kBurst; ++i) {
      const ssize_t size = read(from_, frame_.data(), frame_.size());
      if (size <= 0) {
        return;
      }
      take(std::vector<char>(frame_.begin(), frame_.begin() + size), how, random);
    }
  }

  void give() {
    for (const auto now = Clock::now(); !waiting_.empty() && waiting_.front().due <= now;
         waiting_.pop_front()) {
      const auto& bytes = waiting_.front().bytes;
      if (write(to_, bytes.data(), bytes.size()) < 0) {
        ++counters.lost;
      }
    }
  }

  Clock::time_point next(Clock::time_point latest) const {
    return waiting_.empty() ? latest : std::min(latest, waiting_.front().due);
  }

 private:
  struct Frame {
    Clock::time_point due;
    std::vector<char> bytes;
  };

  /// IPv4 multicast has Ethernet addresses of its own, 01:00:5e:...
  static bool is_multicast(const std::vector<char>& bytes) {
    return bytes.size() > 3 && bytes[0] == 1 && bytes[1] == 0 && bytes[2] == 0x5e;
  }

  void take(std::vector<char> bytes, const Impairments& how, std::mt19937& random) {
    ++counters.frames;
    counters.bytes += static_cast<long>(bytes.size());
    if (!how.up || (!how.multicast && is_multicast(bytes)) ||
        std::bernoulli_distribution(how.loss)(random)) {
      ++counters.lost;
      return;
    }
    const auto now = Clock::now();
    const auto begin = std::max(sent_until_, now);
    if (how.bits_per_second > 0.0) {
      if (begin - now > how.queue) {
        ++counters.queue_drops;
        return;
      }
      const double seconds = static_cast<double>(bytes.size()) * 8.0 / how.bits_per_second;
      sent_until_ =
          begin + std::chrono::duration_cast<Duration>(std::chrono::duration<double>(seconds));
    } else {
      sent_until_ = begin;
    }
    waiting_.push_back({sent_until_ + how.delay, std::move(bytes)});
  }

  int from_;
  int to_;
  std::array<char, kLargestFrame_bytes> frame_{};
  Clock::time_point sent_until_{};
  std::deque<Frame> waiting_;
};

using Directions = std::array<Direction, 2>;

void answer_count(const Directions& directions) {
  for (const Direction& each : directions) {
    const Counters& c = each.counters;
    std::cout << c.frames << " " << c.bytes << " " << c.lost << " " << c.queue_drops << " ";
  }
  std::cout << std::endl;
}

/// False for what it does not know.
bool obey(const std::string& line, Impairments& how, const Directions& directions) {
  std::istringstream words(line);
  std::string verb;
  std::string word;
  double number = 0.0;
  words >> verb;
  const auto milliseconds = [](double count) {
    return std::chrono::duration_cast<Duration>(std::chrono::duration<double, std::milli>(count));
  };
  if (verb == "count") {
    answer_count(directions);
  } else if (verb == "delay" && words >> number) {
    how.delay = milliseconds(number);
  } else if (verb == "loss" && words >> number) {
    how.loss = number / 100.0;
  } else if (double queue_ms = 0.0; verb == "rate" && words >> number >> queue_ms) {
    how.bits_per_second = number * 1e6;
    how.queue = milliseconds(queue_ms);
  } else if (verb == "multicast" && words >> word) {
    how.multicast = word == "on";
  } else if (verb == "link" && words >> word) {
    how.up = word == "up";
  } else {
    return false;
  }
  return true;
}

/// False at the end of the input.
bool read_orders(std::string& unread, Impairments& how, const Directions& directions) {
  char text[256];
  const ssize_t size = read(STDIN_FILENO, text, sizeof text);
  if (size <= 0) {
    return false;
  }
  unread.append(text, static_cast<std::size_t>(size));
  for (std::size_t end; (end = unread.find('\n')) != std::string::npos; unread.erase(0, end + 1)) {
    if (!obey(unread.substr(0, end), how, directions)) {
      std::cerr << "impaired_link: unknown order '" << unread.substr(0, end) << "'\n";
      return false;
    }
  }
  return true;
}

void forward(Directions& directions) {
  constexpr auto kLongest = std::chrono::milliseconds(50);
  Impairments how;
  std::mt19937 random(42);
  std::string unread;
  while (true) {
    const auto now = Clock::now();
    auto next = now + kLongest;
    for (const Direction& each : directions) {
      next = each.next(next);
    }
    const auto wait = std::max(Duration{0}, std::chrono::duration_cast<Duration>(next - now));
    const timespec timeout{0, static_cast<long>(wait.count())};
    std::array<pollfd, 3> inputs{{{directions[0].from(), POLLIN, 0},
                                  {directions[1].from(), POLLIN, 0},
                                  {STDIN_FILENO, POLLIN, 0}}};
    ppoll(inputs.data(), inputs.size(), &timeout, nullptr);
    if (inputs[2].revents != 0 && !read_orders(unread, how, directions)) {
      return;
    }
    for (Direction& each : directions) {
      each.take(how, random);
      each.give();
    }
  }
}

}  // namespace

int main() {
  const Computer first = make_computer("10.77.0.1");
  const Computer second = make_computer("10.77.0.2");
  const std::string descriptors = "/proc/" + std::to_string(getpid()) + "/fd/";
  std::cout << "ready " << descriptors << first.network << " " << descriptors << second.network
            << std::endl;
  Directions directions{Direction(first.tap, second.tap), Direction(second.tap, first.tap)};
  forward(directions);
  return 0;
}
