// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace trigpoint::fusion_gate {

/// What became of every fix, and that each is judged once.
class Verdicts {
 public:
  /// True the first time: the fix is to be judged. The stamp is a fix's identity, whichever writer
  /// reports it.
  bool is_new(Nanoseconds fix_stamp_ns);

  /// A fix that gets no verdict here, now or later: it came before this gate began.
  void remember(Nanoseconds fix_stamp_ns);

  bool is_judged(Nanoseconds fix_stamp_ns) const;

  void record(Nanoseconds fix_stamp_ns,
              bool used,
              const std::string& code,
              const std::string& reason);

  bool is_known(const std::string& code) const { return counts_.contains(code); }

  /// One verdict fewer of this code: its fix is going to get another one.
  void take_back(const std::string& code);

  const FixVerdict& newest() const { return newest_; }

  /// Those that were recorded since this was asked last.
  std::vector<FixVerdict> take_new() { return std::exchange(new_, {}); }

  std::uint64_t used() const { return used_; }

  std::uint64_t total() const { return total_; }

  std::vector<NamedCount> counts() const;  ///< by code, sorted by name

 private:
  std::deque<Nanoseconds> judged_ns_;  // the newest ones; bounded
  FixVerdict newest_;
  std::vector<FixVerdict> new_;
  std::uint64_t used_{0};
  std::uint64_t total_{0};
  std::map<std::string, std::uint64_t> counts_;
};

}  // namespace trigpoint::fusion_gate
