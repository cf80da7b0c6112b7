// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "recorder.hpp"

#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/loop.hpp"

#include <chrono>
#include <map>
#include <memory>

namespace trigpoint::recording {

namespace {

std::vector<TopicSummary> summarize(const std::map<std::string, TopicSummary>& counts) {
  std::vector<TopicSummary> topics;
  for (const auto& [name, summary] : counts) {
    topics.push_back(summary);
  }
  return topics;
}

/// So that what was latched is latched again when the recording is played.
Durability durability_of(const bus::Qos& qos) {
  return qos.durability == bus::Durability::kTransientLocal ? Durability::kTransientLocal
                                                            : Durability::kVolatile;
}

}  // namespace

RecordResult record(const RecordOptions& options) {
  bus::Loop loop;
  // First: who cannot join the bus leaves no bag.
  bus::Participant participant(options.bus, "recorder", options.on_event);
  Rosbag2Writer writer(options.out, options.storage);
  std::map<std::string, TopicSummary> counts;
  std::vector<std::unique_ptr<bus::SerializedSubscription>> subscriptions;
  for (const KnownTopic& topic : options.topics) {
    subscriptions.push_back(std::make_unique<bus::SerializedSubscription>(
        participant,
        topic.name,
        topic.ros_type,
        topic.qos,
        [&loop, &writer, &counts, topic](bus::SerializedMessage& cdr,
                                         const bus::MessageInfo& info) {
          loop.post(
              [&writer,
               &counts,
               topic,
               bytes = std::move(cdr),
               received_ns = info.reception_stamp_ns] {
                TopicSummary& summary = counts[topic.name];
                if (summary.messages == 0) {
                  writer.declare_topic(topic.name, topic.ros_type, durability_of(topic.qos));
                }
                writer.write_cdr(topic.name, topic.ros_type, received_ns, bytes);
                summary.topic = topic.name;
                summary.type = topic.ros_type;
                ++summary.messages;
              },
              bus::WhenFull::kDropOldest);
        }));
  }
  if (options.duration_s > 0.0) {
    loop.every(std::chrono::nanoseconds(from_seconds(options.duration_s)),
               [&loop] { loop.stop(); });
  }
  if (options.progress) {
    loop.every(std::chrono::seconds(1), [&] { options.progress(summarize(counts)); });
  }
  loop.run();
  subscriptions.clear();
  writer.close();
  return {summarize(counts), loop.dropped()};
}

}  // namespace trigpoint::recording
