// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "log_window.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/base/sentence.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::recording {

namespace {

/// Lets a fix through when it begins a new slot of the limit's period, counted from the first one;
/// the mean rate then never exceeds the limit. A fix may come this share of a period early.
class FixRateLimit {
 public:
  explicit FixRateLimit(double rate_hz) : rate_hz_(rate_hz) {}

  bool withholds(const GnssFix& fix) {
    if (rate_hz_ <= 0.0) {
      return false;
    }
    if (!first_ns_) {
      first_ns_ = fix.stamp_ns;
    }
    constexpr double kEarly = 0.15;
    const auto slot = static_cast<std::int64_t>(
        std::floor(to_seconds(fix.stamp_ns - *first_ns_) * rate_hz_ + kEarly));
    const bool fed = slot > last_slot_;
    last_slot_ = fed ? slot : last_slot_;
    return !fed;
  }

 private:
  double rate_hz_;
  std::optional<Nanoseconds> first_ns_;
  std::int64_t last_slot_{-1};
};

/// Throws ConfigError when nothing of the log would be left.
Nanoseconds begin_of(const LogSummary& log, double start_s) {
  const double lasts_s = to_seconds(log.last_ns - log.first_ns);
  if (start_s > 0.0 && start_s >= lasts_s) {
    throw ConfigError(log.path + sentence(": lasts %g s, log.start_s skips %g s: nothing is left",
                                          lasts_s,
                                          start_s));
  }
  return log.first_ns + from_seconds(start_s);
}

/// However long a duration is (it need not fit into nanoseconds), the log's end ends it.
Nanoseconds end_of(const LogSummary& log, Nanoseconds begin_ns, double duration_s) {
  const bool is_within = duration_s > 0.0 && duration_s < to_seconds(log.last_ns - begin_ns);
  return is_within ? begin_ns + from_seconds(duration_s) : log.last_ns;
}

class LogWindow : public LogReader {
 public:
  LogWindow(std::unique_ptr<LogReader> log, const LogOptions& options)
      : log_(std::move(log)),
        limit_(options.fix_rate_limit_hz),
        begin_ns_(begin_of(log_->summary(), options.start_s)),
        end_ns_(end_of(log_->summary(), begin_ns_, options.duration_s)) {}

  const LogSummary& summary() const override { return log_->summary(); }

  std::optional<LogEntry> next() override {
    while (auto entry = log_->next()) {
      if (entry->receive_ns > end_ns_) {
        break;
      }
      if (entry->receive_ns < begin_ns_) {
        continue;
      }
      now_ns_ = entry->receive_ns;
      if (const auto* fix = std::get_if<GnssFix>(&entry->measurement)) {
        entry->withheld = limit_.withholds(*fix);
      }
      return entry;
    }
    now_ns_ = end_ns_;
    return std::nullopt;
  }

  double progress() const override {
    const double span_s = to_seconds(end_ns_ - begin_ns_);
    return span_s > 0.0 && now_ns_ ? std::clamp(to_seconds(*now_ns_ - begin_ns_) / span_s, 0.0, 1.0)
                                   : (now_ns_ ? 1.0 : 0.0);
  }

  std::vector<Undecodable> undecodable() const override { return log_->undecodable(); }

  Events take_events() override { return log_->take_events(); }

  std::optional<std::string> truth_file() const override { return log_->truth_file(); }

  std::optional<RobotConfig> robot() const override { return log_->robot(); }

 private:
  std::unique_ptr<LogReader> log_;
  FixRateLimit limit_;
  Nanoseconds begin_ns_;
  Nanoseconds end_ns_;
  std::optional<Nanoseconds> now_ns_;
};

}  // namespace

std::unique_ptr<LogReader> apply_options(std::unique_ptr<LogReader> log,
                                         const LogOptions& options) {
  return std::make_unique<LogWindow>(std::move(log), options);
}

}  // namespace trigpoint::recording
