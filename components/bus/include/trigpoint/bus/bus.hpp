// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Typed publish and subscribe over the generated message types (topics.hpp has them all).
//
//   bus::Participant participant(config, "fusion_gate", log_event);
//   bus::Publisher odometry(participant, bus::topics::fusion_odometry);
//   bus::Subscription fixes(participant, bus::topics::fix,
//                           [&](const auto& fix, const bus::MessageInfo& info) { ... });
//   odometry.publish(bus::to_message(core_odometry));
//
// Threads: callbacks come on a middleware thread, one at a time per subscription, and should only
// convert and post to a Loop. When a destructor returns, no callback of that object runs any more;
// so an endpoint must not be destroyed from its own callback. Publishers may be used by any thread.
// A participant must outlive its endpoints. Constructors throw std::runtime_error with the remedy.
#pragma once

#include "trigpoint/bus/backend.hpp"

#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace trigpoint::bus {

/// One per process. `sink` hears warnings (small socket buffers, readers made anew) on any thread.
class Participant {
 public:
  explicit Participant(const Config& config, const std::string& name, EventSink sink = {})
      : node_(backend::make_node(config, name, std::move(sink))) {}

  backend::Node& node() { return *node_; }

  /// The number of the process that a matched writer belongs to, where it tells and is not numbered
  /// by another container; it may run on another computer.
  std::optional<unsigned> process_of(const std::string& writer_guid) {
    return node_->process_of(writer_guid);
  }

  /// Writers and readers of others, also on topics that nobody here uses.
  std::vector<DiscoveredEndpoint> discovered() { return node_->discovered(); }

 private:
  std::unique_ptr<backend::Node> node_;
};

template <class T>
class Publisher {
 public:
  Publisher(Participant& participant, const Topic<T>& topic, PublisherEvents events = {})
      : writer_(participant.node().make_writer(backend::type_ops<T>(),
                                               topic.dds_name(),
                                               topic.qos,
                                               std::move(events))) {}

  /// False when the middleware refused the sample (no memory, or its queue stayed full).
  bool publish(const T& message) { return writer_->write(&message); }

  /// True when every matched reliable reader has everything (at once when there is none).
  bool wait_for_acknowledgments(std::chrono::nanoseconds timeout) {
    return writer_->wait_for_acknowledgments(timeout);
  }

  int matched() const { return writer_->matched(); }

  std::string guid() const { return writer_->guid(); }

 private:
  std::unique_ptr<backend::Writer> writer_;
};

template <class T>
class Subscription {
 public:
  /// `callback(T&, const MessageInfo&)` may take the message as const T& too, or move out of it.
  template <class Callback>
  Subscription(Participant& participant,
               const Topic<T>& topic,
               Callback callback,
               SubscriptionEvents events = {})
      : reader_(participant.node().make_reader(
            backend::type_ops<T>(),
            topic.dds_name(),
            topic.qos,
            [callback = std::move(callback)](void* value, const MessageInfo& info) mutable {
              callback(*static_cast<T*>(value), info);
            },
            std::move(events))) {}

  int matched() const { return reader_->matched(); }

  /// Samples that could not be decoded and were not delivered.
  std::uint64_t malformed() const { return reader_->malformed(); }

 private:
  std::unique_ptr<backend::Reader> reader_;
};

using SerializedMessage = std::vector<std::uint8_t>;

/// Publishes bytes that are already CDR with encapsulation, as rosbag2 stores them.
class SerializedPublisher {
 public:
  /// `ros_type` as in "sensor_msgs/msg/Imu", `topic` without "rt/".
  SerializedPublisher(Participant& participant,
                      const std::string& topic,
                      const std::string& ros_type,
                      const Qos& qos,
                      PublisherEvents events = {})
      : writer_(participant.node().make_writer(backend::serialized_ops(ros_type),
                                               Topic<SerializedMessage>{topic}.dds_name(),
                                               qos,
                                               std::move(events))) {}

  bool publish(const SerializedMessage& cdr) { return writer_->write(&cdr); }

  bool wait_for_acknowledgments(std::chrono::nanoseconds timeout) {
    return writer_->wait_for_acknowledgments(timeout);
  }

  int matched() const { return writer_->matched(); }

 private:
  std::unique_ptr<backend::Writer> writer_;
};

/// Receives bytes as they are on the wire: for recorders.
class SerializedSubscription {
 public:
  using Callback = std::function<void(SerializedMessage& cdr, const MessageInfo& info)>;

  SerializedSubscription(Participant& participant,
                         const std::string& topic,
                         const std::string& ros_type,
                         const Qos& qos,
                         Callback callback,
                         SubscriptionEvents events = {})
      : reader_(participant.node().make_reader(
            backend::serialized_ops(ros_type),
            Topic<SerializedMessage>{topic}.dds_name(),
            qos,
            [callback = std::move(callback)](void* value, const MessageInfo& info) {
              callback(*static_cast<SerializedMessage*>(value), info);
            },
            std::move(events))) {}

  int matched() const { return reader_->matched(); }

 private:
  std::unique_ptr<backend::Reader> reader_;
};

}  // namespace trigpoint::bus
