// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What every backend must do. The same source is linked with each backend.
#include "trigpoint/bus/bus.hpp"

#include "trigpoint/bus/cdr.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "../unit/bus/samples.hpp"
#include "bus_fixture.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace trigpoint::bus {
namespace {

using namespace std::chrono_literals;
using testing::Collected;
using testing::Heard;
using testing::kForever;
using testing::own_domain;
using testing::Readers;

constexpr auto kSoon = 2s;

/// Two participants, as if in two processes.
class Bus : public ::testing::TestWithParam<std::string> {
 protected:
  Collected<Event> events;
  Participant here{own_domain(), "here", [this](const Event& event) { events.add(event); }};
  Participant there{own_domain(), "there"};

  /// Publishes one message from `here` to `there` and returns what arrives.
  template <class T>
  Heard<T> carry(const Topic<T>& topic, const T& message) {
    Collected<Heard<T>> heard;
    Readers readers;
    Subscription<T> subscription(there, topic, [&](T& got, const MessageInfo& info) {
      heard.add({std::move(got), info});
    });
    Publisher<T> publisher(here, topic, readers.events());
    EXPECT_TRUE(readers.wait_for(1));
    EXPECT_TRUE(publisher.publish(message));
    EXPECT_TRUE(heard.wait_for(1));
    auto items = heard.items();
    return items.empty() ? Heard<T>{} : items.front();
  }

  template <class T, class Plain>
  void expect_round_trip(const Topic<T>& topic, const Plain& plain) {
    const Heard<T> heard = carry(topic, to_message(plain));
    samples::expect_equal(from_message(heard.message), plain);
  }
};

sensor_msgs::msg::NavSatFix numbered_fix(int number) {
  GnssFix fix = samples::fix();
  fix.service = static_cast<std::uint16_t>(number);
  return to_message(fix);
}

TEST_P(Bus, carries_imu_samples) {
  expect_round_trip(topics::imu, samples::imu());
}

TEST_P(Bus, carries_fixes) {
  expect_round_trip(topics::fix, samples::fix());
}

TEST_P(Bus, carries_clouds) {
  expect_round_trip(topics::points, samples::cloud());
}

TEST_P(Bus, carries_odometry) {
  expect_round_trip(topics::lio_odometry, samples::odometry());
}

TEST_P(Bus, carries_gps_status) {
  expect_round_trip(topics::gps_status, samples::gps_status());
}

TEST_P(Bus, carries_lio_status) {
  expect_round_trip(topics::lio_status, samples::lio_status());
}

TEST_P(Bus, carries_state_updates) {
  expect_round_trip(topics::state_update, samples::state_update());
}

TEST_P(Bus, carries_fusion_status) {
  expect_round_trip(topics::fusion_status, samples::fusion_status());
}

TEST_P(Bus, carries_transforms) {
  const StampedTransform transform{5, "map", "odom", samples::odometry().T_frame_child};
  const auto message = to_tf_message(std::vector{transform});
  EXPECT_EQ(carry(topics::tf, message).message, message);
}

TEST_P(Bus, carries_the_clock) {
  const auto message = to_clock_message(1'700'000'000'000'000'009);
  EXPECT_EQ(carry(topics::clock, message).message, message);
}

TEST_P(Bus, carries_diagnostics) {
  const Diagnostic diagnostic{DiagnosticLevel::kStale, "name", "message", "id", {{"key", "value"}}};
  const auto message = to_message(Nanoseconds{8}, std::vector{diagnostic});
  EXPECT_EQ(carry(topics::diagnostics, message).message, message);
}

TEST_P(Bus, carries_a_cloud_of_three_megabytes) {
  PointCloudMessage cloud = samples::cloud();
  cloud.data.resize(3'000'000);
  for (std::size_t i = 0; i < cloud.data.size(); ++i) {
    cloud.data[i] = static_cast<std::uint8_t>(i * 7 + i / 251);
  }
  expect_round_trip(topics::points, cloud);
}

TEST_P(Bus, stamps_messages_with_the_clocks_of_writer_and_reader) {
  const auto before = std::chrono::system_clock::now().time_since_epoch();
  const MessageInfo info = carry(topics::fix, numbered_fix(1)).info;
  const auto after = std::chrono::system_clock::now().time_since_epoch();
  constexpr Nanoseconds kRounding_ns = 1000;  // source stamps travel as fractions of 2^-32 s
  EXPECT_GE(info.source_stamp_ns, std::chrono::nanoseconds(before).count() - kRounding_ns);
  EXPECT_GE(info.reception_stamp_ns, info.source_stamp_ns - kRounding_ns);
  EXPECT_LE(info.reception_stamp_ns, std::chrono::nanoseconds(after).count());
}

TEST_P(Bus, tells_writers_apart_by_their_guid) {
  Collected<MessageInfo> heard;
  Readers first_readers;
  Readers second_readers;
  Subscription<sensor_msgs::msg::NavSatFix> subscription(
      there, topics::fix, [&](const auto&, const MessageInfo& info) { heard.add(info); });
  Publisher first(here, topics::fix, first_readers.events());
  Publisher second(here, topics::fix, second_readers.events());
  ASSERT_TRUE(first_readers.wait_for(1) && second_readers.wait_for(1));
  first.publish(numbered_fix(1));
  ASSERT_TRUE(heard.wait_for(1));
  second.publish(numbered_fix(2));
  ASSERT_TRUE(heard.wait_for(2));
  EXPECT_EQ(heard.items()[0].writer_guid, first.guid());
  EXPECT_EQ(heard.items()[1].writer_guid, second.guid());
  EXPECT_NE(first.guid(), second.guid());
  EXPECT_EQ(first.guid().size(), 32U);
}

TEST_P(Bus, tells_the_process_of_a_writer) {
  const std::string guid = carry(topics::fix, numbered_fix(1)).info.writer_guid;
  EXPECT_EQ(there.process_of(guid), static_cast<unsigned>(getpid()));
}

TEST_P(Bus, gives_a_late_joiner_the_newest_datum) {
  Publisher publisher(here, topics::datum);
  publisher.publish(to_message(Datum{1.0, 2.0, 3.0, 4}));
  publisher.publish(to_message(samples::datum()));
  Collected<Datum> heard;
  Subscription<sensor_msgs::msg::NavSatFix> late(
      there, topics::datum, [&](const auto& message, const MessageInfo&) {
        heard.add(datum_from_message(message));
      });
  ASSERT_TRUE(heard.wait_for(1));
  samples::expect_equal(heard.items().front(), samples::datum());
}

TEST_P(Bus, tells_when_a_writer_comes_and_goes) {
  Collected<std::string> matched;
  Collected<std::string> lost;
  Subscription<sensor_msgs::msg::NavSatFix> subscription(
      there,
      topics::fix,
      [](const auto&, const MessageInfo&) {},
      {[&](const std::string& guid) { matched.add(guid); },
       [&](const std::string& guid) { lost.add(guid); },
       {}});
  std::string guid;
  {
    Publisher publisher(here, topics::fix);
    ASSERT_TRUE(matched.wait_for(1));
    EXPECT_EQ(subscription.matched(), 1);
    guid = publisher.guid();
  }
  ASSERT_TRUE(lost.wait_for(1));
  EXPECT_EQ(matched.items(), std::vector{guid});
  EXPECT_EQ(lost.items(), std::vector{guid});
  EXPECT_EQ(subscription.matched(), 0);
}

TEST_P(Bus, tells_a_publisher_when_its_reader_goes) {
  Readers readers;
  Publisher publisher(here, topics::fix, readers.events());
  {
    Subscription<sensor_msgs::msg::NavSatFix> subscription(
        there, topics::fix, [](const auto&, const MessageInfo&) {});
    ASSERT_TRUE(readers.wait_for(1));
  }
  EXPECT_TRUE(readers.wait_for(0));
}

TEST_P(Bus, hears_a_writer_that_offers_only_best_effort_and_says_so) {
  Collected<std::string> policies;
  Collected<int> heard;
  Subscription<sensor_msgs::msg::NavSatFix> subscription(
      here,
      topics::fix,
      [&](const auto& fix, const MessageInfo&) { heard.add(fix.status().service()); },
      {{}, {}, [&](const std::string& policy) { policies.add(policy); }});
  Readers readers;
  Topic<sensor_msgs::msg::NavSatFix> sensor = topics::fix;
  sensor.qos = qos::kSensorData;
  Publisher publisher(there, sensor, readers.events());
  ASSERT_TRUE(readers.wait_for(1));
  publisher.publish(numbered_fix(5));
  ASSERT_TRUE(heard.wait_for(1));
  EXPECT_EQ(heard.items().front(), 5);
  EXPECT_EQ(policies.items(), std::vector<std::string>{"RELIABILITY"});
  ASSERT_TRUE(events.wait_for(1));
  EXPECT_EQ(events.items().back().code, "bus_reader_best_effort");
}

TEST_P(Bus, names_the_policy_that_keeps_a_writer_out) {
  Collected<std::string> policies;
  Subscription<sensor_msgs::msg::NavSatFix> subscription(
      here,
      topics::datum,
      [](const auto&, const MessageInfo&) {},
      {{}, {}, [&](const std::string& policy) { policies.add(policy); }});
  Topic<sensor_msgs::msg::NavSatFix> not_latched = topics::datum;
  not_latched.qos = qos::kDefault;
  Publisher publisher(there, not_latched);
  ASSERT_TRUE(policies.wait_for(1));
  EXPECT_EQ(policies.items().front(), "DURABILITY");
  EXPECT_EQ(publisher.matched(), 0);
}

TEST_P(Bus, waits_until_every_reader_has_everything) {
  constexpr int kMessages = 50;
  std::atomic<int> heard{0};
  Readers readers;
  Subscription<sensor_msgs::msg::NavSatFix> subscription(
      there, topics::fix, [&](const auto&, const MessageInfo&) { ++heard; });
  Publisher publisher(here, topics::fix, readers.events());
  EXPECT_TRUE(publisher.wait_for_acknowledgments(kSoon));
  ASSERT_TRUE(readers.wait_for(1));
  for (int i = 0; i < kMessages; ++i) {
    publisher.publish(numbered_fix(i));
  }
  EXPECT_TRUE(publisher.wait_for_acknowledgments(kForever));
  EXPECT_EQ(heard, kMessages);
}

TEST_P(Bus, takes_and_gives_serialised_messages) {
  Collected<SerializedMessage> raw;
  Collected<GnssFix> typed;
  Readers readers;
  SerializedSubscription recorder(
      there,
      "gps/fix",
      "sensor_msgs/msg/NavSatFix",
      qos::kDefault,
      [&](SerializedMessage& cdr, const MessageInfo&) { raw.add(cdr); });
  Subscription<sensor_msgs::msg::NavSatFix> subscription(
      there, topics::fix, [&](const auto& fix, const MessageInfo&) {
        typed.add(from_message(fix));
      });
  SerializedPublisher player(
      here, "gps/fix", "sensor_msgs/msg/NavSatFix", qos::kDefault, readers.events());
  ASSERT_TRUE(readers.wait_for(2));
  const SerializedMessage sent = encode_cdr(samples::fix());
  player.publish(sent);
  ASSERT_TRUE(raw.wait_for(1) && typed.wait_for(1));
  samples::expect_equal(typed.items().front(), samples::fix());
  // Middleware may pad to a multiple of four.
  SerializedMessage got = raw.items().front();
  ASSERT_GE(got.size(), sent.size());
  got.resize(sent.size());
  EXPECT_EQ(got, sent);
}

TEST_P(Bus, counts_and_tells_malformed_messages_and_goes_on) {
  Collected<int> heard;
  Readers readers;
  Subscription<sensor_msgs::msg::NavSatFix> subscription(
      here, topics::fix, [&](const auto& fix, const MessageInfo&) {
        heard.add(fix.status().service());
      });
  SerializedPublisher sender(
      there, "gps/fix", "sensor_msgs/msg/NavSatFix", qos::kDefault, readers.events());
  ASSERT_TRUE(readers.wait_for(1));
  SerializedMessage truncated = encode_cdr(samples::fix());
  truncated.resize(40);
  sender.publish(truncated);
  sender.publish(encode_cdr(from_message(numbered_fix(9))));
  ASSERT_TRUE(heard.wait_for(1));
  EXPECT_EQ(heard.items(), std::vector{9});
  EXPECT_EQ(subscription.malformed(), 1U);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events.items()[0].code, "bus_malformed_message");
  EXPECT_THAT(events.items()[0].text, ::testing::HasSubstr("rt/gps/fix"));
}

TEST_P(Bus, calls_nobody_back_after_the_subscription_is_gone) {
  Readers readers;
  Publisher publisher(here, topics::fix, readers.events());
  std::atomic<bool> ended{false};
  std::thread writer;
  for (int round = 0; round < 10; ++round) {
    Collected<int> heard;
    std::atomic<bool> in_scope{true};
    {
      Subscription<sensor_msgs::msg::NavSatFix> subscription(
          there, topics::fix, [&](const auto&, const MessageInfo&) {
            EXPECT_TRUE(in_scope);
            heard.add(1);
          });
      if (!writer.joinable()) {
        ASSERT_TRUE(readers.wait_for(1));
        writer = std::thread([&] {
          while (!ended) {
            publisher.publish(numbered_fix(1));
            std::this_thread::sleep_for(1ms);
          }
        });
      }
      EXPECT_TRUE(heard.wait_for(1));
    }
    in_scope = false;
  }
  ended = true;
  writer.join();
}

TEST_P(Bus, keeps_domains_apart) {
  Config elsewhere = own_domain();
  elsewhere.domain_id += 100;
  Participant stranger(elsewhere, "stranger");
  std::atomic<int> overheard{0};
  Subscription<sensor_msgs::msg::NavSatFix> spy(
      stranger, topics::fix, [&](const auto&, const MessageInfo&) { ++overheard; });
  carry(topics::fix, numbered_fix(1));
  EXPECT_EQ(spy.matched(), 0);
  EXPECT_EQ(overheard, 0);
}

// The parameter only names the backend that is linked, so that ctest tells the programs apart.
INSTANTIATE_TEST_SUITE_P(EveryBackend,
                         Bus,
                         ::testing::Values(std::string(backend::name())),
                         [](const auto& linked) { return linked.param; });

}  // namespace
}  // namespace trigpoint::bus
