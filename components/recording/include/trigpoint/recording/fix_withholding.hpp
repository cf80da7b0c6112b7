// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/time.hpp"

#include <optional>

namespace trigpoint::recording {

/// Which fixes are kept from the filters so that their result can be held against them: the last
/// `for_s` of every `every_s`, counted from the first fix. Whole stretches, because the error of a
/// fix is much like that of its neighbours: a filter that was given those knows it already. By the
/// stamps alone, so the same fixes whatever is done with them and in whichever order they come
/// (but for the first).
class FixWithholding {
 public:
  /// Withholds nothing.
  FixWithholding() = default;

  FixWithholding(double every_s, double for_s)
      : every_ns_(from_seconds(every_s)), for_ns_(from_seconds(for_s)) {}

  bool withholds(Nanoseconds stamp_ns) {
    if (every_ns_ <= 0 || for_ns_ <= 0) {
      return false;
    }
    if (!first_ns_) {
      first_ns_ = stamp_ns;
    }
    // Fixes that come late may be older than the first.
    const Nanoseconds into_ns = ((stamp_ns - *first_ns_) % every_ns_ + every_ns_) % every_ns_;
    return into_ns >= every_ns_ - for_ns_;
  }

 private:
  Nanoseconds every_ns_{0};
  Nanoseconds for_ns_{0};
  std::optional<Nanoseconds> first_ns_;
};

}  // namespace trigpoint::recording
