// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "only_one.hpp"

#include "trigpoint/bus/participant_of.hpp"

#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>

namespace trigpoint::shell {

namespace {

constexpr const char* kAge = "running_s";
constexpr const char* kProcess = "process";
constexpr const char* kClaimant = "participant";
/// Ages that differ by less say nothing about who was first.
constexpr double kSameAge_s = 0.5;
/// So long one that is too many stays, for the first one to hear of it.
constexpr std::chrono::milliseconds kLastWord{300};
/// Participants that are told of one by one.
constexpr std::size_t kMostKnown = 64;

/// Only digits of what the network says are printed.
std::string number_of_process(const std::string& text) {
  const long number = std::strtol(text.c_str(), nullptr, 10);
  return number > 0 ? std::to_string(number) : "?";
}

}  // namespace

OnlyOne::OnlyOne(bus::Participant& participant,
                 bus::Loop& loop,
                 const std::string& role,
                 const EventLog& log)
    : loop_(loop),
      role_(role),
      name_(role + ": only one"),
      log_(log),
      claims_(participant,
              bus::topics::diagnostics,
              {[this](int) { loop_.post([this] { claim(); }, bus::WhenFull::kDropOldest); }, {}}),
      others_(participant,
              bus::topics::diagnostics,
              [this](const diagnostic_msgs::msg::DiagnosticArray& m, const bus::MessageInfo& info) {
                if (auto other = claim_in(m, name_, info.writer_guid)) {
                  loop_.post([this, other = std::move(*other)] { hear(other); });
                }
              }) {
  own_participant_ = bus::participant_of(claims_.guid());
  loop.every(std::chrono::seconds(1), [this] { claim(); });
}

double OnlyOne::age_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
}

void OnlyOne::claim() {
  const bus::Diagnostic line{bus::DiagnosticLevel::kOk,
                             name_,
                             "there may be one on a domain: who was first stays",
                             "",
                             {{kAge, std::to_string(age_s())},
                              {kProcess, std::to_string(getpid())},
                              {kClaimant, own_participant_}}};
  claims_.publish(bus::to_message(0, {&line, 1}));
}

std::optional<OnlyOne::Claim> OnlyOne::claim_in(
    const diagnostic_msgs::msg::DiagnosticArray& message,
    const std::string& name,
    const std::string& writer) {
  for (const bus::Diagnostic& line : bus::from_message(message)) {
    if (line.name != name) {
      continue;
    }
    Claim claim{bus::participant_of(writer), "", "?", 0.0};
    for (const auto& [key, value] : line.values) {
      if (key == kAge) {
        claim.age_s = std::strtod(value.c_str(), nullptr);
      } else if (key == kProcess) {
        claim.process = number_of_process(value);
      } else if (key == kClaimant) {
        claim.claimant = value;
      }
    }
    return claim;
  }
  return std::nullopt;
}

void OnlyOne::hear(const Claim& other) {
  if (other.participant == own_participant_ || other.participant.empty() || is_too_many_) {
    return;
  }
  if (other.claimant != other.participant) {
    if (!std::exchange(told_of_replay_, true)) {
      log_.warning("a word of another " + role_ + " on `diagnostics` is not counted: DDS " +
                   "participant " + other.participant + " sent it, which it does not name as " +
                   "its own (a recording that is played?); said once");
    }
    return;
  }
  const double older_s = other.age_s - age_s();
  const bool other_was_first =
      std::abs(older_s) > kSameAge_s ? older_s > 0.0 : other.participant < own_participant_;
  const std::string who = "another " + role_ + " (process " + other.process + ", DDS participant " +
                          other.participant + ")";
  if (other_was_first) {
    is_too_many_ = true;
    log_.error(who +
               " was first on this DDS domain and what both publish would be mixed: ending. " +
               "End the other one, or take another domain (ROS_DOMAIN_ID=N)");
    claim();
    loop_.every(kLastWord, [this] { loop_.stop(); });
  } else if (known_.size() < kMostKnown && known_.insert(other.participant).second) {
    log_.warning(who +
                 " has come to this DDS domain, where there may be one: it should end itself");
    claim();
  }
}

}  // namespace trigpoint::shell
