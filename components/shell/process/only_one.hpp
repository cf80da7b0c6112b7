// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/shell/shell.hpp"

#include <chrono>
#include <optional>
#include <set>
#include <string>

namespace trigpoint::shell {

/// Of a mapper or a gate a domain may have one: what two publish would be mixed without a word.
/// Each says once a second on `diagnostics` for how long it has been running; who hears of one that
/// has been for longer says so and ends its loop. The one that was first says so and goes on.
/// A claim names the DDS participant that makes it: one that comes from another participant is a
/// recorded one that somebody plays, and ends nobody.
class OnlyOne {
 public:
  /// `role`: what there may be one of, e.g. "fusion_gate".
  OnlyOne(bus::Participant& participant,
          bus::Loop& loop,
          const std::string& role,
          const EventLog& log);

  /// Another one was first: the program should end with code 2.
  bool is_too_many() const { return is_too_many_; }

 private:
  struct Claim {
    std::string participant;  ///< that sent it
    std::string claimant;     ///< participant that it names as its own
    std::string process;
    double age_s{0.0};
  };

  double age_s() const;
  void claim();
  void hear(const Claim& other);
  static std::optional<Claim> claim_in(const diagnostic_msgs::msg::DiagnosticArray& message,
                                       const std::string& name,
                                       const std::string& writer);

  bus::Loop& loop_;
  std::string role_;
  std::string name_;
  EventLog log_;
  std::chrono::steady_clock::time_point started_{std::chrono::steady_clock::now()};
  std::string own_participant_;
  std::set<std::string> known_;
  bool is_too_many_{false};
  bool told_of_replay_{false};
  bus::Publisher<diagnostic_msgs::msg::DiagnosticArray> claims_;
  bus::Subscription<diagnostic_msgs::msg::DiagnosticArray> others_;
};

}  // namespace trigpoint::shell
