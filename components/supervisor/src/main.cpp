// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// trigpoint_supervise: keeps one program running, where there is no systemd to do it.
#include "trigpoint/supervisor/restart_policy.hpp"

#include "child.hpp"
#include "notify_socket.hpp"
#include "stillness.hpp"
#include <CLI/CLI.hpp>
#include <poll.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

namespace {

using namespace trigpoint::supervisor;
using Clock = std::chrono::steady_clock;

constexpr double kHeldUp_s = 1.0;  ///< a supervisor that woke so late cannot blame its program
constexpr int kTick_ms = 100;
constexpr int kStillLooks = 3;  ///< one a tick: by then a late timer would have woken it

struct Options {
  std::string name;
  std::string log_file;
  std::string records_file;
  std::string pid_file;
  double watchdog_s{3.0};
  double still_s{0.0};
  double stop_timeout_s{30.0};
  std::vector<std::string> command;
};

double seconds_since(Clock::time_point then) {
  return std::chrono::duration<double>(Clock::now() - then).count();
}

class Supervisor {
 public:
  explicit Supervisor(const Options& options) : options_(options) {
    sigset_t signals;
    sigemptyset(&signals);
    for (const int number : {SIGCHLD, SIGTERM, SIGINT}) {
      sigaddset(&signals, number);
    }
    sigprocmask(SIG_BLOCK, &signals, nullptr);
    signals_ = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
  }

  int run() {
    start();
    for (;;) {
      const Clock::time_point before = Clock::now();
      wait_for_something();
      held_up_ = seconds_since(before) > kHeldUp_s;
      take_signals();
      take_notices();
      if (const std::optional<int> code = look_after()) {
        return *code;
      }
    }
  }

 private:
  void wait_for_something() const {
    std::array<pollfd, 2> inputs{pollfd{signals_, POLLIN, 0},
                                 pollfd{notices_.descriptor(), POLLIN, 0}};
    poll(inputs.data(), inputs.size(), kTick_ms);
  }

  void take_signals() {
    signalfd_siginfo info{};
    while (read(signals_, &info, sizeof info) == static_cast<ssize_t>(sizeof info)) {
      if (info.ssi_signo != SIGCHLD && !stopping_since_) {
        stopping_since_ = Clock::now();
        if (child_ > 0) {
          kill(child_, SIGTERM);
          kill(child_, SIGCONT);  // a stopped one would never hear the first
        }
      }
    }
  }

  void take_notices() {
    const NotifySocket::Heard heard = notices_.take();
    if (heard.anything) {
      answered_ = Clock::now();
    } else if (held_up_ && answered_) {
      answered_ = Clock::now();
    }
    is_closing_ = is_closing_ || heard.stopping;
    watchdog_s_ = heard.watchdog_s.value_or(watchdog_s_);
  }

  /// The exit code once all is over.
  std::optional<int> look_after() {
    if (child_ > 0) {
      if (const std::optional<int> status = reap(child_)) {
        return on_end(*status);
      }
      insist();
      return std::nullopt;
    }
    if (stopping_since_) {
      return 0;  // between two lives
    }
    if (Clock::now() >= start_at_) {
      start();
    }
    return std::nullopt;
  }

  /// Who works may be late, on a loaded computer by seconds; who stands still without having asked
  /// for patience is not.
  double patience_with_its_silence_s() {
    if (is_closing_) {
      return options_.stop_timeout_s;
    }
    const bool asked_for_more = watchdog_s_ > options_.watchdog_s;
    if (!answered_ || options_.still_s <= 0.0 || asked_for_more) {
      return watchdog_s_;
    }
    const bool is_silent = seconds_since(*answered_) > 0.5 * options_.still_s;
    if (!is_silent) {
      stillness_.forget();
    }
    const bool is_still = is_silent && stillness_.looks_at(child_) >= kStillLooks;
    return is_still ? std::min(options_.still_s, watchdog_s_) : watchdog_s_;
  }

  /// Kills what no longer answers, or does not stop.
  void insist() {
    const double patience_s = patience_with_its_silence_s();
    const bool hangs = answered_ && !stopping_since_ && options_.watchdog_s > 0.0 &&
                       seconds_since(*answered_) > patience_s;
    const bool lingers =
        stopping_since_ && seconds_since(*stopping_since_) > options_.stop_timeout_s;
    if ((hangs || lingers) && !hung_) {
      hung_ = true;
      tell("error",
           hangs ? "has not answered for " + number_text(patience_s) + " s: killing it"
                 : "does not stop: killing it");
      kill(child_, SIGKILL);
    }
  }

  void start() {
    child_ =
        start_child({options_.command, notices_.address(), options_.watchdog_s, options_.log_file});
    started_ = Clock::now();
    answered_.reset();
    watchdog_s_ = options_.watchdog_s;
    is_closing_ = false;
    hung_ = false;
    stillness_.forget();
    if (!options_.pid_file.empty()) {
      // Whole or not at all: others read it at any moment.
      const std::string beside = options_.pid_file + ".part";
      std::ofstream(beside) << child_ << "\n";
      std::error_code ignored;
      std::filesystem::rename(beside, options_.pid_file, ignored);
    }
  }

  std::optional<int> on_end(int status) {
    child_ = -1;
    Ending ending;
    ending.code = WIFEXITED(status) ? WEXITSTATUS(status) : 0;
    ending.signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
    ending.lived_s = seconds_since(started_);
    ending.hung = hung_;
    if (stopping_since_) {
      return ending.signal != 0 ? 1 : ending.code;
    }
    const Decision decision = policy_.on_end(ending);
    switch (decision.what) {
      case Decision::What::kEnd:
        return 0;
      case Decision::What::kGiveUp:
        tell("error", decision.why + "; giving up");
        record(decision, false);
        return ending.signal == 0 && ending.code == 2 ? 2 : 1;
      case Decision::What::kRestart:
        break;
    }
    tell("error", decision.why + "; restarting it in " + number_text(decision.after_s) + " s");
    record(decision, true);
    start_at_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                   std::chrono::duration<double>(decision.after_s));
    return std::nullopt;
  }

  static std::string number_text(double value) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%g", value);
    return text.data();
  }

  /// To our standard error, and into the program's log in that log's form.
  void tell(const std::string& level, const std::string& sentence) const {
    std::cerr << "trigpoint_supervise: " << options_.name << " " << sentence << std::endl;
    if (!options_.log_file.empty()) {
      const std::time_t now = std::time(nullptr);
      std::tm local{};
      localtime_r(&now, &local);
      std::array<char, 16> clock{};
      std::strftime(clock.data(), clock.size(), "%H:%M:%S.000", &local);
      std::ofstream(options_.log_file, std::ios::app)
          << clock.data() << " [trigpoint_supervise] " << level << " " << options_.name << " "
          << sentence << "\n";
    }
  }

  /// One line for each end that was not asked for: what the session's report lists.
  void record(const Decision& decision, bool restarted) const {
    if (options_.records_file.empty()) {
      return;
    }
    std::ofstream file(options_.records_file, std::ios::app);
    if (file.tellp() == 0) {
      file << "unix_s,program,restarted,lived_s,what\n";
    }
    file << std::time(nullptr) << "," << options_.name << "," << (restarted ? 1 : 0) << ","
         << number_text(seconds_since(started_)) << ",\"" << decision.why << "\"" << std::endl;
  }

  Options options_;
  RestartPolicy policy_;
  NotifySocket notices_;
  Stillness stillness_;
  int signals_{-1};
  pid_t child_{-1};
  Clock::time_point started_;
  Clock::time_point start_at_;
  std::optional<Clock::time_point> answered_;  ///< last; none: it has not said yet that it will
  std::optional<Clock::time_point> stopping_since_;
  double watchdog_s_{0.0};  ///< the program may ask for another one
  bool is_closing_{false};
  bool hung_{false};
  bool held_up_{false};
};

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{
      "Keeps a program running: restarts it with a growing delay when it fails or no longer "
      "answers, and gives up (exit code 1) when that happens 6 times in quick succession. A "
      "program "
      "that ends with 2 (wrong options or configuration) is not restarted.",
      "trigpoint_supervise"};
  app.prefix_command();
  app.add_option("--name", options.name, "how it is called in messages (default: the program)");
  app.add_option("--log", options.log_file, "file to which its output is appended");
  app.add_option("--records", options.records_file, "CSV file that gets a line for each failure");
  app.add_option("--pid-file", options.pid_file, "file that holds the number of its process");
  app.add_option("--watchdog",
                 options.watchdog_s,
                 "s without a WATCHDOG=1 (sd_notify) after which it hangs; 0: never")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option(
         "--still",
         options.still_s,
         "the same for a program whose main thread is stopped or asleep, unless it has asked "
         "for more patience (WATCHDOG_USEC=); shorter than --watchdog, and several times as "
         "long as it usually is silent; 0: no difference")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--stop-timeout", options.stop_timeout_s, "s that it has for stopping")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.footer("Usage: trigpoint_supervise [OPTIONS] -- PROGRAM [ARGUMENTS]");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  options.command = app.remaining();
  if (!options.command.empty() && options.command.front() == "--") {
    options.command.erase(options.command.begin());
  }
  if (options.command.empty()) {
    std::cerr << "trigpoint_supervise: no program is given; see --help\n";
    return 2;
  }
  if (options.name.empty()) {
    options.name = std::filesystem::path(options.command.front()).filename().string();
  }
  try {
    return Supervisor(options).run();
  } catch (const std::exception& error) {
    std::cerr << "trigpoint_supervise: " << error.what() << "\n";
    return 1;
  }
}
