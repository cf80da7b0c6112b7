// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the backend promises of Cyclone DDS's own settings.
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "../unit/bus/samples.hpp"
#include "bus_fixture.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <stdexcept>

namespace trigpoint::bus {
namespace {

using testing::Collected;
using testing::own_domain;
using testing::Readers;

/// Settings of the user's own, which come after ours.
class CycloneSettings : public ::testing::Test {
 protected:
  static void set(const std::string& domain_settings) {
    const std::string xml =
        "<CycloneDDS><Domain Id=\"any\">" + domain_settings + "</Domain></CycloneDDS>";
    setenv("CYCLONEDDS_URI", xml.c_str(), 1);
  }

  ~CycloneSettings() override { unsetenv("CYCLONEDDS_URI"); }
};

TEST_F(CycloneSettings, of_the_environment_are_added_to_ours_and_large_samples_can_be_refused) {
  set("<Internal><MaxSampleSize>1000000B</MaxSampleSize></Internal>");
  Participant here(own_domain(), "here");
  Participant there(own_domain(), "there");  // not reached unless ours, the domain too, stay
  Collected<std::size_t> heard;
  Readers readers;
  Subscription<sensor_msgs::msg::PointCloud2> subscription(
      there, topics::points, [&](const auto& cloud, const MessageInfo&) {
        heard.add(cloud.data().size());
      });
  Publisher publisher(here, topics::points, readers.events());
  ASSERT_TRUE(readers.wait_for(1));
  PointCloudMessage cloud = samples::cloud();
  for (const std::size_t bytes : {2'000'000U, 500'000U}) {
    cloud.data.resize(bytes);
    publisher.publish(to_message(cloud));
  }
  ASSERT_TRUE(heard.wait_for(1));
  EXPECT_EQ(heard.items(), std::vector<std::size_t>{500'000U});
}

TEST_F(CycloneSettings, without_multicast_peers_are_found_by_address) {
  set("<General><AllowMulticast>false</AllowMulticast></General>");
  Config config = own_domain();
  config.initial_peers = {"127.0.0.1"};
  Participant here(config, "here");
  Participant there(config, "there");
  Readers readers;
  Subscription<sensor_msgs::msg::NavSatFix> subscription(
      there, topics::fix, [](const auto&, const MessageInfo&) {});
  Publisher publisher(here, topics::fix, readers.events());
  EXPECT_TRUE(readers.wait_for(1));
}

TEST_F(CycloneSettings, that_make_no_sense_are_told_with_the_domain) {
  set("<General><AllowMulticast>perhaps</AllowMulticast></General>");
  try {
    Participant participant(own_domain(), "wrong");
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("cannot join DDS domain"));
  }
}

TEST_F(CycloneSettings, know_no_shared_memory_and_say_so_at_the_door) {
  Config config = own_domain();
  config.shared_memory = true;
  try {
    Participant participant(config, "wrong");
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("bus.shared_memory"));
  }
}

std::ptrdiff_t threads_of_this_process() {
  const std::filesystem::directory_iterator all("/proc/self/task");
  return std::distance(begin(all), end(all));
}

TEST_F(CycloneSettings, of_security_that_cannot_be_read_leave_no_domain_behind) {
  const auto before = threads_of_this_process();
  Config config = own_domain();
  config.security_folder = "/nowhere/at/all";
  EXPECT_THROW(Participant(config, "wrong"), std::runtime_error);
  EXPECT_EQ(threads_of_this_process(), before);  // a domain has some
}

TEST(SmallDatagrams, carry_large_clouds) {
  Config config = own_domain();
  config.datagram_bytes = 1472;
  Participant here(config, "here");
  Participant there(config, "there");
  Collected<PointCloudMessage> heard;
  Readers readers;
  Subscription<sensor_msgs::msg::PointCloud2> subscription(
      there, topics::points, [&](auto& cloud, const MessageInfo&) {
        heard.add(from_message(std::move(cloud)));
      });
  Publisher publisher(here, topics::points, readers.events());
  ASSERT_TRUE(readers.wait_for(1));
  PointCloudMessage cloud = samples::cloud();
  cloud.data.assign(3'000'000, 7);
  publisher.publish(to_message(cloud));
  ASSERT_TRUE(heard.wait_for(1));
  samples::expect_equal(heard.items().front(), cloud);
}

}  // namespace
}  // namespace trigpoint::bus
