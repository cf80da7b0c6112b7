// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

namespace trigpoint::fusion_gate {

/// What became of every fix, and that each is judged once.
class Verdicts {
 public:
  /// True the first time: the fix is to be judged. The stamp is a fix's identity, whichever writer
  /// reports it.
  bool is_new(Nanoseconds fix_stamp_ns);

  void record(Nanoseconds fix_stamp_ns,
              bool used,
              const std::string& code,
              const std::string& reason);

  const FixVerdict& newest() const { return newest_; }

  std::uint64_t used() const { return used_; }

  std::vector<NamedCount> counts() const;  ///< by code, sorted by name

 private:
  std::deque<Nanoseconds> judged_ns_;  // the newest ones; bounded
  FixVerdict newest_;
  std::uint64_t used_{0};
  std::map<std::string, std::uint64_t> counts_;
};

}  // namespace trigpoint::fusion_gate
