// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "live_view.hpp"

#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/topics.hpp"

#include "known_topics.hpp"
#include "wish_list.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <vector>

namespace trigpoint::live {

namespace {

using namespace std::chrono_literals;

constexpr std::size_t kBulkDepth = 2;  // clouds that may wait for a slow browser
constexpr auto kTimePeriod = 100ms;    // how often browsers are told the time

Nanoseconds wall_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

Channel channel_of(const recording::KnownTopic& topic) {
  Channel channel;
  channel.topic = "/" + topic.name;
  channel.schema_name = topic.ros_type;
  channel.latched = topic.qos.durability == bus::Durability::kTransientLocal;
  channel.depth = topic.qos.bulk ? kBulkDepth : Channel{}.depth;
  return channel;
}

/// A looker-on asks no writer to repeat or to wait: best effort, but for what a latched topic keeps
/// for latecomers and for the small messages of our own processes.
bus::Qos reading_qos(const recording::KnownTopic& topic) {
  bus::Qos qos = topic.qos;
  const bool latched = qos.durability == bus::Durability::kTransientLocal;
  if (!latched && (qos.bulk || topic.from_sensor)) {
    qos.reliability = bus::Reliability::kBestEffort;
  }
  return qos;
}

class LiveView {
 public:
  LiveView(const LiveViewOptions& options, bus::Loop& loop)
      : topics_(recording::known_topics(options.robot)),
        participant_(options.bus, "live", options.on_event),
        server_(
            options.server,
            channels(),
            [this, &loop](std::size_t channel, bool wanted) {
              if (wishes_.add(channel, wanted)) {
                loop.post([this] { fulfil(); });
              }
            },
            options.on_event),
        clock_(participant_,
               bus::topics::clock,
               [this](const rosgraph_msgs::msg::Clock& message, const bus::MessageInfo&) {
                 clock_ns_ = bus::from_message(message);
               }) {
    loop.every(kTimePeriod, [this] { server_.publish_time(now_ns()); });
  }

  std::uint16_t port() const { return server_.port(); }

  Counters counters() const { return server_.counters(); }

 private:
  std::vector<Channel> channels() const {
    std::vector<Channel> all;
    std::transform(topics_.begin(), topics_.end(), std::back_inserter(all), channel_of);
    return all;
  }

  /// The time of the data: that of the topic `clock` as long as somebody writes it, else the
  /// wall's.
  Nanoseconds now_ns() const {
    const Nanoseconds clock = clock_ns_;
    return clock > 0 && clock_.matched() > 0 ? clock : wall_ns();
  }

  void fulfil() {
    for (const auto& [channel, wanted] : wishes_.take()) {
      want(channel, wanted);
    }
  }

  void want(std::size_t channel, bool wanted) {
    if (!wanted) {
      subscriptions_.erase(channel);
      return;
    }
    const recording::KnownTopic& topic = topics_[channel];
    subscriptions_[channel] = std::make_unique<bus::SerializedSubscription>(
        participant_,
        topic.name,
        topic.ros_type,
        reading_qos(topic),
        [this, channel](bus::SerializedMessage& cdr, const bus::MessageInfo&) {
          server_.publish(channel, now_ns(), std::move(cdr));
        });
  }

  const std::vector<recording::KnownTopic> topics_;
  std::atomic<Nanoseconds> clock_ns_{0};
  WishList wishes_;
  bus::Participant participant_;
  LiveServer server_;
  bus::Subscription<rosgraph_msgs::msg::Clock> clock_;
  std::map<std::size_t, std::unique_ptr<bus::SerializedSubscription>> subscriptions_;
};

}  // namespace

Counters run_live_view(const LiveViewOptions& options) {
  bus::Loop loop;
  LiveView view(options, loop);
  if (options.on_listening) {
    options.on_listening(view.port());
  }
  loop.run();
  return view.counters();
}

}  // namespace trigpoint::live
