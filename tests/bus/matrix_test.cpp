// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Vendors against each other on the wire: this program is the reader, linked once with each vendor,
// and starts a writing process of each vendor. tests/bus/matrix prints it all as a table.
#include "trigpoint/bus/cdr.hpp"

#include "bus_fixture.hpp"
#include "matrix_messages.hpp"
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>

namespace trigpoint::bus::matrix {
namespace {

using testing::Collected;
using ::testing::Combine;
using testing::own_domain;
using ::testing::Values;
using ::testing::ValuesIn;
using tests::Command;
using tests::CommandResult;

std::vector<std::string> topic_names() {
  std::vector<std::string> names;
  visit_topics([&](const char* name, const auto&, const auto&) { names.emplace_back(name); });
  return names;
}

std::vector<std::string> writer_command(const std::string& vendor, std::vector<std::string> what) {
  std::vector<std::string> command{std::string(TRIGPOINT_BIN_DIR) + "/bus_peer_" + vendor,
                                   std::to_string(own_domain().domain_id)};
  std::move(what.begin(), what.end(), std::back_inserter(command));
  return command;
}

std::vector<std::uint8_t> bytes_of(const backend::TypeOps& ops, const void* message) {
  std::vector<std::uint8_t> bytes(ops.size_bound(message));
  bytes.resize(ops.serialize(message, bytes));
  return bytes;
}

// Field by field, so that a failure names the field; then everything, also what has no plain
// struct.
template <class Plain>
void expect_equal_fields(const Plain& got, const Plain& sent) {
  samples::expect_equal(got, sent);
}

template <class T>
void expect_equal_message(const T& got, const T& sent) {
  if constexpr (requires { samples::expect_equal(from_message(got), from_message(sent)); }) {
    samples::expect_equal(from_message(got), from_message(sent));
  }
  EXPECT_EQ(bytes_of(backend::type_ops<T>(), &got), bytes_of(backend::type_ops<T>(), &sent));
}

// ---- every topic --------------------------------------------------------------------------------

/// Writing vendor and topic.
class Topics : public ::testing::TestWithParam<std::tuple<std::string, std::string>> {};

TEST_P(Topics, arrive_with_every_field) {
  const auto& [vendor, wanted] = GetParam();
  Participant participant(own_domain(), "matrix_reader");
  visit_topics([&, &topic_name = wanted, &writer_vendor = vendor]<class T>(
                   const char* name, const Topic<T>& topic, const T& sent) {
    if (topic_name != name) {
      return;
    }
    Collected<std::pair<T, std::string>> heard;
    Collected<std::string> writers;
    Subscription<T> subscription(participant,
                                 topic,
                                 [&](const T& message, const MessageInfo& info) {
                                   heard.add({message, info.writer_guid});
                                 },
                                 {[&](const std::string& guid) { writers.add(guid); }, {}, {}});
    const Command writer(writer_command(writer_vendor, {topic_name}));
    ASSERT_TRUE(heard.wait_for(1)) << writer.output_so_far();
    ASSERT_TRUE(writers.wait_for(1));
    expect_equal_message(heard.items().front().first, sent);
    EXPECT_EQ(heard.items().front().second, writers.items().front());
    EXPECT_EQ(participant.process_of(writers.items().front()), static_cast<unsigned>(writer.pid()));
    EXPECT_EQ(subscription.malformed(), 0U);
  });
}

INSTANTIATE_TEST_SUITE_P(Matrix,
                         Topics,
                         Combine(Values("fastdds", "cyclonedds"), ValuesIn(topic_names())),
                         [](const auto& cell) {
                           return std::get<0>(cell.param) + "_to_" + backend::name() + "_" +
                                  std::get<1>(cell.param);
                         });

TEST(MatrixTopics, are_all_those_of_the_header) {
  std::ifstream stream(TRIGPOINT_SOURCE_DIR "/components/bus/include/trigpoint/bus/topics.hpp");
  const std::string header{std::istreambuf_iterator<char>(stream), {}};
  const std::regex topic(R"(inline constexpr Topic<[\w:]+>\s+(\w+)\{)");
  std::set<std::string> in_header;
  for (std::sregex_iterator found(header.begin(), header.end(), topic), end; found != end;
       ++found) {
    in_header.insert((*found)[1]);
  }
  const auto names = topic_names();
  EXPECT_EQ(in_header, std::set<std::string>(names.begin(), names.end()));
}

// ---- streams ------------------------------------------------------------------------------------

template <class T>
class Stream {
 public:
  /// Number 0 may come often, every other must come once, in order and as it was sent.
  void add(std::uint32_t number, Nanoseconds latency_ns, bool intact) {
    damaged_ += intact ? 0 : 1;
    if (number == 0) {
      warm_.add(number);
      return;
    }
    latencies_ns_.add(latency_ns);
    out_of_order_ += number == last_ + 1 ? 0 : 1;
    last_ = number;
  }

  bool wait_until_warm() { return warm_.wait_for(1); }

  void expect_all(std::uint32_t count, const std::string& name) {
    EXPECT_TRUE(latencies_ns_.wait_for(count));
    auto sorted_ns = latencies_ns_.items();
    EXPECT_EQ(sorted_ns.size(), count) << name;
    EXPECT_EQ(damaged_, 0U) << name;
    EXPECT_EQ(out_of_order_, 0U) << name;
    ASSERT_FALSE(sorted_ns.empty());
    std::sort(sorted_ns.begin(), sorted_ns.end());
    const auto quantile_us = [&](std::size_t percent) {
      return static_cast<int>(sorted_ns[(sorted_ns.size() - 1) * percent / 100] / 1000);
    };
    ::testing::Test::RecordProperty(name + "_received", static_cast<int>(sorted_ns.size()));
    ::testing::Test::RecordProperty(name + "_p50_us", quantile_us(50));
    ::testing::Test::RecordProperty(name + "_p99_us", quantile_us(99));
  }

 private:
  Collected<std::uint32_t> warm_;
  Collected<Nanoseconds> latencies_ns_;
  std::atomic<std::uint32_t> damaged_{0};
  std::atomic<std::uint32_t> out_of_order_{0};
  std::uint32_t last_{0};
};

/// Another size than that of the issue: TRIGPOINT_MATRIX_CLOUD_BYTES.
std::size_t cloud_bytes() {
  const char* variable = std::getenv("TRIGPOINT_MATRIX_CLOUD_BYTES");
  return variable == nullptr ? kCloudBytes : std::strtoul(variable, nullptr, 10);
}

class Streams : public ::testing::TestWithParam<std::string> {};

TEST_P(Streams, of_clouds_at_10_hz_and_imu_at_400_hz_arrive_whole_and_in_order) {
  const std::size_t bytes = cloud_bytes();
  const auto pattern = numbered_cloud(0, bytes).data;
  Stream<PointCloudMessage> clouds;
  Stream<ImuSample> samples;
  Participant participant(own_domain(), "matrix_reader");
  Subscription<sensor_msgs::msg::PointCloud2> points(
      participant, topics::points, [&](const auto& message, const MessageInfo& info) {
        const std::uint32_t number = message.height();
        const auto& data = message.data();
        bool intact = data.size() == pattern.size();
        for (std::size_t i = 0; intact && i < data.size(); ++i) {
          intact = data[i] == static_cast<std::uint8_t>(pattern[i] ^ number);
        }
        clouds.add(
            number, info.reception_stamp_ns - from_message(message.header().stamp()), intact);
      });
  Subscription<sensor_msgs::msg::Imu> imu(
      participant, topics::imu, [&](const auto& message, const MessageInfo& info) {
        ImuSample sample = from_message(message);
        const Nanoseconds latency_ns = info.reception_stamp_ns - sample.stamp_ns;
        sample.stamp_ns = 0;
        const std::uint32_t number = number_of(sample);
        samples.add(number, latency_ns, to_message(sample) == to_message(numbered_imu(number)));
      });
  Command writer(writer_command(GetParam(), {"stream", std::to_string(bytes)}));
  ASSERT_TRUE(clouds.wait_until_warm() && samples.wait_until_warm()) << writer.output_so_far();
  const Subscription<diagnostic_msgs::msg::DiagnosticArray> begin(
      participant, kBegin, [](const auto&, const MessageInfo&) {});
  const CommandResult result = writer.wait(std::chrono::seconds(60));
  EXPECT_EQ(result.exit_code, 0) << result.output;
  clouds.expect_all(kClouds, "clouds");
  samples.expect_all(kImuSamples, "imu");
}

INSTANTIATE_TEST_SUITE_P(Matrix, Streams, Values("fastdds", "cyclonedds"), [](const auto& cell) {
  return cell.param + "_to_" + backend::name();
});

}  // namespace
}  // namespace trigpoint::bus::matrix
