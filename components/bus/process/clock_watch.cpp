// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One of these runs on every computer (bringup/host starts it) and says by how much the others'
// clocks differ: on `diagnostics`, in the log, and in clock.csv of the session. Nothing in
// Trigpoint needs equal clocks, since data time is the sensors'; but sensors that are read on two
// computers are stamped by two clocks, and then this is by how much they disagree.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/shell/shell.hpp"

#include "clock_offsets.hpp"
#include <unistd.h>

#include <array>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

namespace {

using namespace trigpoint;
using Message = diagnostic_msgs::msg::DiagnosticArray;

/// Half a scan at 10 Hz: what sensors of two computers may differ by before it matters.
constexpr double kWorthAWarning_s = 0.05;

Nanoseconds wall_clock_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::nanoseconds(now).count();
}

/// What bringup/host calls this computer, or the system.
std::string own_name() {
  std::array<char, 256> of_system{};
  gethostname(of_system.data(), of_system.size() - 1);
  const char* given = std::getenv("TRIGPOINT_HOST");
  const bool is_given = given != nullptr && *given != '\0';
  const std::string name = is_given ? given : of_system.data();
  if (const auto fault = bus::find_name_fault(name)) {
    throw std::runtime_error((is_given ? "TRIGPOINT_HOST" : "the system's host name") +
                             std::string(" is '") + name + "': " + *fault +
                             "; set TRIGPOINT_HOST to another one");
  }
  return name;
}

std::string milliseconds(Nanoseconds ns) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3f ms", 1e-6 * static_cast<double>(ns));
  return text.data();
}

/// A question (without `to`) or an answer, as a diagnostic message that every tool can show.
struct Probe {
  std::string computer;  ///< who sends it
  std::string to;        ///< GUID of the question's writer
  Nanoseconds asked_ns{0};
  Nanoseconds heard_there_ns{0};
  Nanoseconds answered_there_ns{0};
};

Message to_message(const Probe& probe) {
  const bus::Diagnostic line{bus::DiagnosticLevel::kOk,
                             probe.to.empty() ? "clock: question" : "clock: answer",
                             probe.computer,
                             probe.to,
                             {{"asked_ns", std::to_string(probe.asked_ns)},
                              {"heard_there_ns", std::to_string(probe.heard_there_ns)},
                              {"answered_there_ns", std::to_string(probe.answered_there_ns)}}};
  return bus::to_message(probe.asked_ns, {&line, 1});
}

/// Nothing where there is none, or one of more than 64 bits.
std::optional<Nanoseconds> number_in(const bus::Diagnostic& line, const std::string& key) {
  for (const auto& [name, text] : line.values) {
    Nanoseconds number{0};
    const char* end = text.data() + text.size();
    if (name == key && std::from_chars(text.data(), end, number).ec == std::errc{}) {
      return number;
    }
  }
  return std::nullopt;
}

std::optional<Probe> from_message(const Message& message) {
  const auto lines = bus::from_message(message);
  if (lines.size() != 1) {
    return std::nullopt;
  }
  const auto asked_ns = number_in(lines[0], "asked_ns");
  const auto heard_there_ns = number_in(lines[0], "heard_there_ns");
  const auto answered_there_ns = number_in(lines[0], "answered_there_ns");
  if (!asked_ns || !heard_there_ns || !answered_there_ns) {
    return std::nullopt;
  }
  return Probe{
      lines[0].message, lines[0].hardware_id, *asked_ns, *heard_there_ns, *answered_there_ns};
}

class Process {
 public:
  Process(const bus::Config& config,
          const shell::Options& options,
          const shell::EventLog& log,
          bus::Loop& loop)
      : log_(log),
        participant_(config, "clock_watch", log_),
        probes_(participant_, bus::topics::clock_probe),
        diagnostics_(participant_, bus::topics::diagnostics) {
    if (!options.session.empty()) {
      std::filesystem::create_directories(options.session);
      file_.open(options.session + "/clock.csv", std::ios::app);
      file_ << "# wall_clock_ns,computer,its_clock_minus_ours_s,round_trip_s\n";
    }
    heard_.emplace(participant_,
                   bus::topics::clock_probe,
                   [this, &loop](const Message& message, const bus::MessageInfo& info) {
                     if (info.writer_guid == probes_.guid()) {
                       return;
                     }
                     if (const auto probe = from_message(message)) {
                       loop.post([this, probe = *probe, info] { take(probe, info); },
                                 bus::WhenFull::kDropOldest);
                     }
                   });
    loop.every(std::chrono::seconds(1), [this] { ask(); });
  }

 private:
  void ask() {
    probes_.publish(to_message(Probe{name_, "", wall_clock_ns(), 0, 0}));
    for (const std::string& computer : answered_) {
      if (const auto clock = offsets_.best(computer)) {
        tell(computer, *clock);
      }
    }
    answered_.clear();
    std::erase_if(told_, [this](const auto& entry) { return !offsets_.best(entry.first); });
    file_.flush();
  }

  void take(const Probe& probe, const bus::MessageInfo& info) {
    if (probe.to.empty()) {
      probes_.publish(to_message(Probe{
          name_, info.writer_guid, probe.asked_ns, info.reception_stamp_ns, wall_clock_ns()}));
    } else if (probe.to == probes_.guid()) {
      const auto refused = offsets_.add(
          probe.computer,
          {probe.asked_ns, probe.heard_there_ns, probe.answered_there_ns, info.reception_stamp_ns});
      if (refused) {
        tell_refused(*refused, info.writer_guid);
      } else if (offsets_.best(probe.computer)) {
        answered_.insert(probe.computer);
      }
    }
  }

  void tell_refused(const std::string& why, const std::string& writer) {
    if (!std::exchange(told_of_refusal_, true)) {
      log_.warning("an answer on clock_probe is refused (from " + writer + "): " + why +
                   "; said once");
    }
  }

  void tell(const std::string& computer, const bus::ClockOffset& clock) {
    const bool is_far = std::abs(to_seconds(clock.offset_ns)) > kWorthAWarning_s;
    const std::string what = "the clock of " + computer + " is " + milliseconds(clock.offset_ns) +
                             " ahead of ours (" + name_ + "), within " +
                             milliseconds(clock.round_trip_ns / 2);
    if (const auto told = told_.find(computer); told == told_.end() || told->second != is_far) {
      told_[computer] = is_far;
      is_far ? log_.warning(what + "; synchronise them (chrony), or read all sensors on one")
             : log_.info(what);
    }
    const bus::Diagnostic line{is_far ? bus::DiagnosticLevel::kWarning : bus::DiagnosticLevel::kOk,
                               "clock_watch: " + computer,
                               what,
                               name_,
                               {{"offset_s", std::to_string(to_seconds(clock.offset_ns))},
                                {"round_trip_s", std::to_string(to_seconds(clock.round_trip_ns))}}};
    diagnostics_.publish(bus::to_message(wall_clock_ns(), {&line, 1}));
    file_ << std::fixed << std::setprecision(6) << wall_clock_ns() << "," << computer << ","
          << to_seconds(clock.offset_ns) << "," << to_seconds(clock.round_trip_ns) << "\n";
  }

  const std::string name_{own_name()};
  shell::EventLog log_;
  std::ofstream file_;
  bus::ClockOffsets offsets_;
  std::set<std::string> answered_;  ///< since the last question
  std::map<std::string, bool> told_;
  bool told_of_refusal_{false};
  bus::Participant participant_;
  bus::Publisher<Message> probes_;
  bus::Publisher<Message> diagnostics_;
  std::optional<bus::Subscription<Message>> heard_;
};

int run(const shell::Options& options, const shell::EventLog& log) {
  bus::Config config;
  shell::load_sections(options.config_files,
                       {{"bus", [&](ConfigFields& fields) { describe(config, fields); }}});
  bus::Loop loop;
  Process process(config, options, log, loop);
  log.info("ready");
  loop.run();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return trigpoint::shell::run_program(
      argc,
      argv,
      "trigpoint_clock_watch",
      "Clock watch: measures by how much the clocks of the computers on the bus differ",
      run);
}
