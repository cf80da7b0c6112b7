// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/recording/log.hpp"

#include <string>
#include <vector>

namespace trigpoint::recording {

/// Counts the messages that a reader passes over and tells of each topic's first one.
class SkippedMessages {
 public:
  /// `number` counts the topic's messages from 1; `detail` says what was found.
  void add(const Undecodable& message,
           std::uint64_t number,
           Nanoseconds receive_ns,
           const std::string& detail);

  const std::vector<Undecodable>& counts() const { return counts_; }

  Events take_events();

 private:
  std::vector<Undecodable> counts_;
  Events events_;
};

}  // namespace trigpoint::recording
