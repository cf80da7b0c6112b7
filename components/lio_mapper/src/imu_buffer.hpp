// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/time.hpp"

#include "propagation.hpp"

#include <deque>
#include <vector>

namespace trigpoint::lio_mapper {

/// Samples in order of time, as far back as somebody needs them.
class ImuBuffer {
 public:
  /// `sample` must be newer than the newest one.
  void push(const InertialSample& sample) { samples_.push_back(sample); }

  bool empty() const { return samples_.empty(); }

  Nanoseconds oldest_ns() const { return samples_.front().stamp_ns; }

  Nanoseconds newest_ns() const { return samples_.back().stamp_ns; }

  const std::deque<InertialSample>& samples() const { return samples_; }

  /// Keeps one sample at or before `stamp_ns`, so that the interval there stays whole.
  void forget_before(Nanoseconds stamp_ns);

  /// The steps that lead from one stamp to another: ends interpolated, intervals longer than
  /// `longest_step_s` divided, the outermost samples held where none are.
  std::vector<InertialStep> steps_between(Nanoseconds from_ns,
                                          Nanoseconds to_ns,
                                          double longest_step_s) const;

  /// The longest interval between two samples that touches [from, to], or between `to` and the
  /// newest sample when that is earlier.
  double longest_gap_s(Nanoseconds from_ns, Nanoseconds to_ns) const;

 private:
  std::deque<InertialSample>::const_iterator first_after(Nanoseconds stamp_ns) const;
  InertialSample at(Nanoseconds stamp_ns) const;

  std::deque<InertialSample> samples_;
};

}  // namespace trigpoint::lio_mapper
