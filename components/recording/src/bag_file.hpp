// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One file of a bag, whatever its storage.
#pragma once

#include "bag_source.hpp"

#include <optional>
#include <set>
#include <string>
#include <vector>

namespace trigpoint::recording {

class BagFile {
 public:
  virtual ~BagFile() = default;

  virtual std::vector<TopicSummary> topics() const = 0;
  /// nullopt when there are no messages.
  virtual std::optional<Nanoseconds> first_ns() const = 0;
  virtual Nanoseconds last_ns() const = 0;
  /// What is known to be wrong, in sentences.
  virtual std::vector<std::string> faults() const = 0;

  /// Those whose messages are in ROS 1's serialisation; all others are CDR.
  virtual std::set<std::string> ros1_topics() const { return {}; }

  /// Once, before next().
  virtual void select(const std::set<std::string>& topics) = 0;
  /// In order of time. nullopt at the end; throws LogError there when messages were out of reach.
  virtual std::optional<RawMessage> next() = 0;
};

}  // namespace trigpoint::recording
