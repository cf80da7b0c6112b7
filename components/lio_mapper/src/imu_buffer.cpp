// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "imu_buffer.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

namespace {

/// Appends begin -> end in equal parts no longer than `longest_step_s`.
void append_divided(const InertialSample& begin,
                    const InertialSample& end,
                    double longest_step_s,
                    std::vector<InertialStep>& steps) {
  const Nanoseconds duration_ns = end.stamp_ns - begin.stamp_ns;
  if (duration_ns <= 0) {
    return;
  }
  const auto parts = static_cast<Nanoseconds>(std::ceil(to_seconds(duration_ns) / longest_step_s));
  InertialSample from = begin;
  for (Nanoseconds i = 1; i <= parts; ++i) {
    const InertialSample to =
        i == parts ? end : interpolate(begin, end, begin.stamp_ns + duration_ns * i / parts);
    steps.push_back({from, to});
    from = to;
  }
}

}  // namespace

void ImuBuffer::forget_before(Nanoseconds stamp_ns) {
  while (samples_.size() > 1 && samples_[1].stamp_ns <= stamp_ns) {
    samples_.pop_front();
  }
}

std::deque<InertialSample>::const_iterator ImuBuffer::first_after(Nanoseconds stamp_ns) const {
  return std::upper_bound(
      samples_.begin(), samples_.end(), stamp_ns, [](Nanoseconds stamp, const InertialSample& s) {
        return stamp < s.stamp_ns;
      });
}

InertialSample ImuBuffer::at(Nanoseconds stamp_ns) const {
  const auto after = first_after(stamp_ns);
  if (after == samples_.begin() || after == samples_.end()) {
    InertialSample held = after == samples_.begin() ? samples_.front() : samples_.back();
    held.stamp_ns = stamp_ns;
    return held;
  }
  return interpolate(*(after - 1), *after, stamp_ns);
}

std::vector<InertialStep> ImuBuffer::steps_between(Nanoseconds from_ns,
                                                   Nanoseconds to_ns,
                                                   double longest_step_s) const {
  std::vector<InertialStep> steps;
  if (samples_.empty() || to_ns <= from_ns) {
    return steps;
  }
  InertialSample from = at(from_ns);
  for (auto next = first_after(from_ns); next != samples_.end() && next->stamp_ns < to_ns; ++next) {
    append_divided(from, *next, longest_step_s, steps);
    from = *next;
  }
  append_divided(from, at(to_ns), longest_step_s, steps);
  return steps;
}

double ImuBuffer::longest_gap_s(Nanoseconds from_ns, Nanoseconds to_ns) const {
  if (samples_.empty()) {
    return to_seconds(to_ns - from_ns);
  }
  double longest_s = std::max(0.0, to_seconds(to_ns - newest_ns()));
  auto next = first_after(from_ns);
  if (next == samples_.begin()) {
    longest_s = std::max(longest_s, to_seconds(oldest_ns() - from_ns));
    ++next;
  }
  for (; next != samples_.end() && (next - 1)->stamp_ns < to_ns; ++next) {
    longest_s = std::max(longest_s, to_seconds(next->stamp_ns - (next - 1)->stamp_ns));
  }
  return longest_s;
}

}  // namespace trigpoint::lio_mapper
