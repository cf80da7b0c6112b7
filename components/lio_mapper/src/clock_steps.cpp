// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "clock_steps.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace trigpoint::lio_mapper {

namespace {

constexpr std::size_t kFewestTurns = 8;  ///< clouds that make a rhythm
constexpr std::size_t kRemembered = 20;
/// Over a longer pause a rhythm cannot be counted on.
constexpr double kMostTurnsPassed = 10.0;
/// A rhythm that scatters more, as a share of a turn, tells nothing.
constexpr double kRegularTurns = 0.02;
/// Less than this share of a turn, or than the time, is no step: IMU samples come every 5 to 10 ms.
constexpr double kLeastStepTurns = 0.2;
constexpr double kLeastStep_s = 0.02;
constexpr double kStepSigmas = 3.0;
/// Clocks that are farther apart are not yet the same one: until they are, nothing is a step.
constexpr double kSameClock_s = 1.0;
/// Standard deviation of a normal distribution over its median absolute deviation.
constexpr double kSigmaPerDeviation = 1.4826;

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void push(std::deque<double>& values, double value) {
  values.push_back(value);
  if (values.size() > kRemembered) {
    values.pop_front();
  }
}

}  // namespace

ClockSteps::Typical ClockSteps::typical(const std::deque<double>& values_s) {
  std::vector<double> values(values_s.begin(), values_s.end());
  Typical result;
  result.middle_s = median_of(values);
  for (double& value : values) {
    value = std::abs(value - result.middle_s);
  }
  result.spread_s = kSigmaPerDeviation * median_of(std::move(values));
  return result;
}

void ClockSteps::remember(Nanoseconds stamp_ns, Nanoseconds end_ns, double turn_s, double lag_s) {
  if (last_stamp_ns_) {
    push(turns_s_, turn_s);
  }
  push(lags_s_, lag_s);
  last_stamp_ns_ = stamp_ns;
  last_end_ns_ = end_ns;
  pending_ns_.reset();
  step_ns_ = 0;
}

std::optional<double> ClockSteps::step_s(double interval_s,
                                         double late_s,
                                         double turn_s,
                                         double lag_sigma_s) {
  const double least_s = std::min(kLeastStep_s, kLeastStepTurns * turn_s);
  const double lag_tolerance_s = std::max(least_s, kStepSigmas * lag_sigma_s);
  const double turns = std::round(interval_s / turn_s);
  const bool in_rhythm = turns >= 1.0 && std::abs(interval_s - turns * turn_s) < least_s;
  // Nothing arrives before it was measured; late it may well be.
  const bool is_early = late_s < -lag_tolerance_s;
  if ((in_rhythm && !is_early) || lag_tolerance_s > 0.5 * turn_s) {
    return std::nullopt;
  }
  const double passed = std::max(1.0, std::round((interval_s + late_s) / turn_s));
  const double step_s = interval_s - passed * turn_s;
  // Lost clouds while the IMU is late look like a step of whole turns, other than the way back.
  const bool is_way_back =
      offset_ns_ != 0 && std::abs(step_s - to_seconds(offset_ns_)) < lag_tolerance_s;
  const bool may_be_lost = in_rhythm && interval_s < kMostTurnsPassed * turn_s && !is_way_back;
  const bool agree = std::abs(step_s + late_s) < lag_tolerance_s;
  return agree && !may_be_lost && std::abs(step_s) >= least_s && passed <= kMostTurnsPassed
             ? std::optional(step_s)
             : std::nullopt;
}

ClockSteps::Verdict ClockSteps::look(Nanoseconds cloud_stamp_ns,
                                     Nanoseconds sweep_end_ns,
                                     Nanoseconds newest_imu_ns) {
  const Nanoseconds end_ns = sweep_end_ns - cloud_stamp_ns;
  const Nanoseconds stamp_ns = cloud_stamp_ns + offset_ns_;
  const double lag_s = to_seconds(newest_imu_ns - stamp_ns);
  const double interval_s = last_stamp_ns_ ? to_seconds(stamp_ns - *last_stamp_ns_) : 0.0;
  if (turns_s_.size() < kFewestTurns) {
    if (interval_s < 0.0) {
      turns_s_.clear();
      lags_s_.clear();
      last_stamp_ns_.reset();
    }
    remember(stamp_ns, end_ns, interval_s, lag_s);
    return Verdict::kSteady;
  }
  const Typical turn = typical(turns_s_);
  const Typical lag = typical(lags_s_);
  if (std::abs(lag.middle_s) > kSameClock_s || !(turn.middle_s > 0.0)) {
    *this = ClockSteps{};
    return Verdict::kSteady;
  }
  // After a pause, in which no rhythm is counted: a clock that is right as it is needs no
  // correction.
  const double tolerance_s = std::max(kLeastStep_s, kStepSigmas * lag.spread_s);
  if (offset_ns_ != 0 && interval_s > kMostTurnsPassed * turn.middle_s &&
      std::abs(lag_s - lag.middle_s) > tolerance_s &&
      std::abs(lag_s + to_seconds(offset_ns_) - lag.middle_s) < tolerance_s) {
    const Nanoseconds back_ns = -offset_ns_;
    *this = ClockSteps{};
    step_ns_ = back_ns;
    return Verdict::kStepped;
  }
  const bool regular = turn.middle_s > 0.0 && turn.spread_s < kRegularTurns * turn.middle_s;
  const auto found = regular ? step_s(interval_s, lag_s - lag.middle_s, turn.middle_s, lag.spread_s)
                             : std::nullopt;
  // Points may be timed by another clock than the message.
  const bool with_points =
      found && std::abs(to_seconds(end_ns - last_end_ns_)) < 0.5 * std::abs(*found);
  if (!with_points) {
    if (interval_s > 0.0) {
      remember(stamp_ns,
               end_ns,
               interval_s / std::max(1.0, std::round(interval_s / turn.middle_s)),
               lag_s);
    }
    return Verdict::kSteady;
  }
  step_ns_ = from_seconds(*found);
  const bool again =
      pending_ns_ && std::abs(to_seconds(step_ns_ - *pending_ns_)) <
                         std::max(kStepSigmas * turn.spread_s, kRegularTurns * turn.middle_s);
  if (!again) {
    pending_ns_ = step_ns_;
    return Verdict::kDoubtful;
  }
  offset_ns_ -= step_ns_;
  sigma_s_ = turn.spread_s;
  last_stamp_ns_ = stamp_ns - step_ns_;
  pending_ns_.reset();
  return Verdict::kStepped;
}

}  // namespace trigpoint::lio_mapper
