// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/fusion_gate/config.hpp"

#include "checks/accepted_fix.hpp"
#include "checks/sighting.hpp"

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::fusion_gate {

/// What the tests said of one part of a fix.
struct Tests {
  std::optional<Refusal> contradiction;  ///< beyond leave_sigmas
  bool enters{true};                     ///< all within enter_sigmas
  std::string lack;                      ///< why it does not enter
};

/// Whether GPS is believed in one part of the position. Trusted until a fix contradicts; then
/// doubted until fixes agree with each other and with what was trusted for as long as they were in
/// doubt.
class Trust {
 public:
  enum class Change { kNone, kDoubted, kReadmitted };

  Trust(const Config& config, Part part) : config_(config), part_(part) {}

  Change judge(const Sighting& sighting, const Tests& tests, const LioStatus& lio);

  bool trusted() const { return !doubt_; }

  /// Only while in doubt.
  Nanoseconds since_ns() const { return doubt_.value_or(0); }

  /// Why it is doubted; empty code when it is trusted.
  const Refusal& reason() const { return reason_; }

  /// Fixes that agree with each other, the newest last; only while in doubt.
  const std::vector<Sighting>& stretch() const { return stretch_; }

  /// Time and way over which they agreed; a silence is none of it.
  double agreed_s() const { return agreed_s_; }

  double agreed_m() const { return agreed_m_; }

  /// True when the newest fix began the stretch.
  bool stretch_began() const { return began_; }

  /// The doubt, and its stretch, began with an earlier fix that nobody judged here.
  void begin_earlier(const Sighting& first);

  void begin_anew();

 private:
  void begin_stretch();
  void add_agreement(const Sighting& from, const Sighting& to);
  void prolong_stretch(const Sighting& sighting, const LioStatus& lio);
  bool may_be_readmitted(const Sighting& sighting) const;

  Config config_;
  Part part_;
  std::optional<Nanoseconds> doubt_;  // since
  Refusal reason_;
  std::vector<Sighting> stretch_;  // the first, and the newest ones
  bool began_{false};
  double agreed_s_{0.0};
  double agreed_m_{0.0};
};

}  // namespace trigpoint::fusion_gate
