// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/shell/shell.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <map>
#include <mutex>

namespace trigpoint::shell {

namespace {

using Clock = std::chrono::steady_clock;

constexpr int kBurst = 5;                   ///< of one code in full ...
constexpr std::chrono::seconds kQuiet{10};  ///< ... per this time

spdlog::level::level_enum level_of(Severity severity) {
  switch (severity) {
    case Severity::kInfo:
      return spdlog::level::info;
    case Severity::kWarning:
      return spdlog::level::warn;
    case Severity::kError:
      break;
  }
  return spdlog::level::err;
}

}  // namespace

struct EventLog::Impl {
  struct Rate {
    Clock::time_point window_start;
    int in_window{0};
    std::uint64_t held_back{0};
  };

  explicit Impl(const std::string& program)
      : logger(program, std::make_shared<spdlog::sinks::stderr_color_sink_mt>()) {
    logger.set_pattern("%H:%M:%S.%e [%n] %^%l%$ %v");
    logger.flush_on(spdlog::level::info);
  }

  ~Impl() {
    for (const auto& [code, rate] : rates) {
      tell_held_back(code, rate);
    }
  }

  void tell_held_back(const std::string& code, const Rate& rate) {
    if (rate.held_back > 0) {
      logger.warn("{}: {} more like this", code, rate.held_back);
    }
  }

  void log(const Event& event) {
    const std::scoped_lock lock(mutex);
    Rate& rate = rates[event.code];
    const Clock::time_point now = Clock::now();
    if (now - rate.window_start > kQuiet) {
      tell_held_back(event.code, rate);
      rate = {now, 0, 0};
    }
    if (++rate.in_window > kBurst) {
      ++rate.held_back;
      return;
    }
    logger.log(level_of(event.severity),
               "{} [{}, t={:.3f} s]",
               event.text,
               event.code,
               to_seconds(event.stamp_ns));
  }

  spdlog::logger logger;
  std::mutex mutex;
  std::map<std::string, Rate> rates;
};

EventLog::EventLog(const std::string& program) : impl_(std::make_shared<Impl>(program)) {}

EventLog::~EventLog() = default;

void EventLog::operator()(const Event& event) const {
  impl_->log(event);
}

void EventLog::operator()(const Events& events) const {
  for (const Event& event : events) {
    impl_->log(event);
  }
}

void EventLog::info(const std::string& text) const {
  impl_->logger.info(text);
}

void EventLog::warning(const std::string& text) const {
  impl_->logger.warn(text);
}

void EventLog::error(const std::string& text) const {
  impl_->logger.error(text);
}

}  // namespace trigpoint::shell
