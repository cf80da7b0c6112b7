// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Where Cyclone DDS calls listeners from inside calls of ours, or one at a time.
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "../unit/bus/samples.hpp"
#include "bus_fixture.hpp"
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <memory>
#include <thread>

namespace trigpoint::bus {
namespace {

using testing::Collected;
using testing::kForever;
using testing::own_domain;
using testing::Readers;
using Fix = sensor_msgs::msg::NavSatFix;
using Cloud = sensor_msgs::msg::PointCloud2;

/// Bulk topics are paced.
Config small_buffers() {
  Config config = own_domain();
  config.socket_buffer_bytes = 212'992;  // of a stock kernel
  return config;
}

PointCloudMessage cloud_of(std::size_t bytes) {
  PointCloudMessage cloud = samples::cloud();
  cloud.data.assign(bytes, 7);
  return cloud;
}

/// Whether `work` ends; a thread that hangs is left behind.
template <class Work>
bool ends(Work work) {
  auto task = std::make_shared<std::packaged_task<void()>>(std::move(work));
  auto done = task->get_future();
  std::thread([task] { (*task)(); }).detach();
  return done.wait_for(kForever) == std::future_status::ready;
}

TEST(BestEffortWriter, known_before_the_reader_meets_one_reader_that_goes_with_its_subscription) {
  constexpr int kRepetitions = 100;
  Participant here(own_domain(), "here");
  Participant there(own_domain(), "there");
  Topic<Fix> sensor = topics::fix;
  sensor.qos = qos::kSensorData;
  Readers readers;
  Publisher publisher(there, sensor, readers.events());
  const Subscription<Fix> first(here, sensor, [](const auto&, const MessageInfo&) {});
  ASSERT_TRUE(readers.wait_for(1));
  for (int i = 0; i < kRepetitions; ++i) {
    const Subscription<Fix> reliable(here, topics::fix, [](const auto&, const MessageInfo&) {});
    ASSERT_TRUE(readers.wait_for(2)) << i;
  }
  EXPECT_TRUE(readers.wait_for(1));
}

TEST(PacedWriter, may_be_asked_for_its_readers_by_a_callback_of_its_own_participant) {
  Participant here(small_buffers(), "here");
  Readers readers;
  Publisher publisher(here, topics::points, readers.events());
  Collected<int> matched;
  Subscription<Cloud> subscription(here, topics::points, [&](const auto&, const MessageInfo&) {
    publisher.wait_for_acknowledgments(std::chrono::milliseconds(0));
    matched.add(publisher.matched());
  });
  ASSERT_TRUE(readers.wait_for(1));
  publisher.publish(to_message(cloud_of(1'000)));
  ASSERT_TRUE(matched.wait_for(1));
  EXPECT_EQ(matched.items().front(), 1);
}

TEST(PacedWriter, tells_its_readers_while_a_cloud_is_on_its_way) {
  Participant here(small_buffers(), "here");
  Participant there(small_buffers(), "there");
  Readers readers;
  Subscription<Cloud> subscription(there, topics::points, [](const auto&, const MessageInfo&) {});
  Publisher publisher(here, topics::points, readers.events());
  ASSERT_TRUE(readers.wait_for(1));
  publisher.publish(to_message(cloud_of(60'000'000)));  // takes 0.8 s
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(publisher.matched(), 1);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(200));
}

TEST(PacedWriter, that_goes_still_sends_what_it_was_given_within_the_linger) {
  Participant here(small_buffers(), "here");
  Participant there(small_buffers(), "there");
  Collected<int> heard;
  Subscription<Cloud> subscription(
      there, topics::points, [&](const auto&, const MessageInfo&) { heard.add(0); });
  constexpr std::size_t kClouds = 4;  // of 1 MB in all, which take 14 ms
  {
    Readers readers;
    Publisher publisher(here, topics::points, readers.events());
    ASSERT_TRUE(readers.wait_for(1));
    for (std::size_t i = 0; i < kClouds; ++i) {
      publisher.publish(to_message(cloud_of(250'000)));
    }
  }
  EXPECT_TRUE(heard.wait_for(kClouds));
}

TEST(Samples, that_are_too_large_are_refused_and_told) {
  Collected<Event> events;
  for (const Config& config : {small_buffers(), own_domain()}) {
    Participant here(config, "here", [&](const Event& event) { events.add(event); });
    Publisher publisher(here, topics::points);
    const std::size_t before = events.size();
    EXPECT_FALSE(publisher.publish(to_message(cloud_of(257'000'000))));
    ASSERT_EQ(events.size(), before + 1);
    EXPECT_EQ(events.items().back().code, "bus_sample_not_sent");
  }
}

TEST(Samples, that_cannot_be_sent_after_all_are_told) {
  setenv("CYCLONEDDS_URI",
         "<CycloneDDS><Domain Id=\"any\"><Internal><MaxSampleSize>1000000B</MaxSampleSize>"
         "</Internal></Domain></CycloneDDS>",
         1);
  Collected<Event> events;
  Participant here(small_buffers(), "here", [&](const Event& event) { events.add(event); });
  unsetenv("CYCLONEDDS_URI");
  Publisher publisher(here, topics::points);
  publisher.publish(to_message(cloud_of(2'000'000)));
  ASSERT_TRUE(events.wait_for(2));  // the first is of small buffers
  EXPECT_EQ(events.items().back().code, "bus_sample_not_sent");
}

// The loop of a shell: a callback waits for room in the queue while the loop publishes.
TEST(Callback, that_waits_for_the_loop_lets_the_loop_publish_on_its_topic) {
  Participant here(own_domain(), "here");
  Participant there(own_domain(), "there");
  std::promise<void> published;
  const std::shared_future<void> was_published = published.get_future().share();
  Collected<int> heard;
  Readers own_readers;
  Publisher own(here, topics::datum, own_readers.events());
  const Subscription<Fix> subscription(here, topics::datum, [&](const auto&, const MessageInfo&) {
    heard.add(0);
    was_published.wait();
  });
  Readers readers;
  Publisher other(there, topics::datum, readers.events());
  ASSERT_TRUE(own_readers.wait_for(1));
  ASSERT_TRUE(readers.wait_for(1));
  other.publish(Fix{});
  ASSERT_TRUE(heard.wait_for(1));
  EXPECT_TRUE(ends([&] { own.publish(Fix{}); }));
  published.set_value();
  EXPECT_TRUE(heard.wait_for(2));
}

TEST(Samples, whose_writer_went_unseen_are_dropped_and_told) {
  Collected<Event> events;
  Participant here(own_domain(), "here", [&](const Event& event) { events.add(event); });
  Participant there(own_domain(), "there");
  std::promise<void> unseen_has_gone;
  const std::shared_future<void> go_on = unseen_has_gone.get_future().share();
  Collected<std::string> guids;
  Readers own_readers;
  Publisher own(here, topics::fix, own_readers.events());
  const Subscription<Fix> subscription(
      here, topics::fix, [&](const auto&, const MessageInfo& info) {
        guids.add(info.writer_guid);
        go_on.wait();  // keeps the worker from asking who is there
      });
  ASSERT_TRUE(own_readers.wait_for(1));
  own.publish(Fix{});
  ASSERT_TRUE(guids.wait_for(1));
  {
    Readers readers;
    Publisher unseen(there, topics::fix, readers.events());
    ASSERT_TRUE(readers.wait_for(1));
    unseen.publish(Fix{});
    EXPECT_TRUE(unseen.wait_for_acknowledgments(kForever));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(300));  // until it is known to have gone
  own.publish(Fix{});
  unseen_has_gone.set_value();
  ASSERT_TRUE(guids.wait_for(2));
  EXPECT_EQ(guids.items(), std::vector<std::string>(2, own.guid()));
  ASSERT_TRUE(events.wait_for(1));
  EXPECT_EQ(events.items().back().code, "bus_unknown_writer");
}

}  // namespace
}  // namespace trigpoint::bus
