// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What ROS 1 bags and rosbag2 have in common: serialised messages of named topics, in order.
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/recording/log.hpp"

#include "topic_choice.hpp"

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::recording {

/// A message as it is in the bag.
struct RawMessage {
  Nanoseconds receive_ns{0};
  std::string topic;
  std::vector<std::uint8_t> bytes;
};

/// A bag that hands out the serialised messages of chosen topics in order of receive_ns.
class BagSource {
 public:
  virtual ~BagSource() = default;

  virtual const LogSummary& summary() const = 0;
  /// Must be called once, before next(); empty names are skipped.
  virtual void select(const std::vector<std::string>& topics) = 0;
  /// nullopt at the end; throws LogError where the bag breaks off.
  virtual std::optional<RawMessage> next() = 0;
  /// Decodes by the topic's kind; false when the bytes are not that message.
  virtual bool decode(const RawMessage& raw, ImuSample& imu) const = 0;
  virtual bool decode(const RawMessage& raw, GnssFix& fix) const = 0;
  virtual bool decode(const RawMessage& raw, PointCloudMessage& cloud) const = 0;
  virtual bool decode(const RawMessage& raw, TwistMeasurement& twist) const = 0;
  virtual bool decode(const RawMessage& raw, Odometry& odometry) const = 0;
  virtual bool decode(const RawMessage& raw, YawMeasurement& yaw) const = 0;
};

/// A reader over `source` with the topics that `robot` names. Throws LogError as choose_topics
/// does.
std::unique_ptr<LogReader> read_bag(std::unique_ptr<BagSource> source,
                                    const RobotConfig& robot,
                                    const LogOptions& options);

}  // namespace trigpoint::recording
