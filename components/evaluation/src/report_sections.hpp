// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The parts of report.md, each as Markdown from "##" on.
#pragma once

#include "session_data.hpp"
#include "session_map.hpp"

#include <string>
#include <vector>

namespace trigpoint::evaluation {

std::string print_run(const SessionData& data);
std::string print_alignment(const SessionData& data);
std::string print_gate(const SessionData& data);
std::string print_times(const SessionData& data);
std::string print_map(const SessionData& data, const SessionMap& map);

/// Sentences about messages that went missing, and about those that were refused with a reason.
struct Accounting {
  bool counted{false};  ///< somebody counted what was published
  std::vector<std::string> losses;
  std::vector<std::string> surplus;  ///< of the losses: more came than was published
  std::vector<std::string> refusals;
};

Accounting account(const SessionData& data);

/// What became of every message, ending in a sentence that says that all was used, or what was not.
std::string print_accounting(const SessionData& data, const Accounting& found);

}  // namespace trigpoint::evaluation
