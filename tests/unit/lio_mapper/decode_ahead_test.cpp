// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The threads of the mapper's process around the core, without a bus: arrival, decoding, matching,
// writing.
#include "decode_ahead.hpp"

#include "trigpoint/base/bounded_queue.hpp"
#include "trigpoint/base/serial_worker.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"

#include "room_drive.hpp"
#include <gtest/gtest.h>

#include <functional>
#include <future>
#include <thread>
#include <tuple>
#include <variant>
#include <vector>

namespace trigpoint::lio_mapper {
namespace {

using testing_support::RoomDrive;
using Input = std::variant<ImuSample, PointCloudMessage>;

/// Three seconds, the third cloud of the drive not a cloud at all.
const std::vector<Input>& inputs() {
  static const std::vector<Input> made = [] {
    constexpr Nanoseconds kImuPeriod_ns = 5'000'000;
    constexpr int kImuPerSweep = 20;
    const RoomDrive room;
    std::vector<Input> all;
    for (int sweep = 0; sweep < 30; ++sweep) {
      const Nanoseconds begin_ns = RoomDrive::kEpoch_ns + sweep * kImuPerSweep * kImuPeriod_ns;
      for (int i = 0; i < kImuPerSweep; ++i) {
        all.emplace_back(room.imu_at(begin_ns + i * kImuPeriod_ns));
      }
      PointCloudMessage cloud = room.sweep_at(begin_ns, 300);
      if (sweep == 2) {
        cloud.fields.clear();
      }
      all.emplace_back(std::move(cloud));
    }
    return all;
  }();
  return made;
}

struct Said {
  void take(Output output) {
    for (const Event& event : output.events) {
      events.push_back(event.code);
    }
    for (ScanResult& scan : output.scans) {
      on_scan(scan);
      scans.push_back(std::move(scan));
    }
  }

  std::vector<ScanResult> scans;
  std::vector<std::string> events;
  std::function<void(const ScanResult&)> on_scan{[](const ScanResult&) {}};
};

Said on_one_thread() {
  Said said;
  LioMapper mapper({}, RobotConfig{});
  for (const Input& input : inputs()) {
    if (const auto* imu = std::get_if<ImuSample>(&input)) {
      said.take(mapper.on_imu(*imu));
    } else {
      said.take(mapper.on_cloud(std::get<PointCloudMessage>(input)));
    }
  }
  said.take(mapper.finish());
  return said;
}

/// As process/main.cpp does it, with a bounded queue for its loop.
void on_threads(std::size_t most, MapperIs mapper_is, Said& said) {
  LioMapper mapper({}, RobotConfig{});
  DecodeAhead decoding({}, most);
  BoundedQueue<std::function<void()>> loop(1000);
  std::thread arrival([&] {
    for (const Input& input : inputs()) {
      if (const auto* imu = std::get_if<ImuSample>(&input)) {
        loop.push([&said, &mapper, imu] { said.take(mapper.on_imu(*imu)); });
      } else if (decoding.add(std::get<PointCloudMessage>(input), mapper_is)) {
        loop.push([&] { said.take(mapper.on_decoded_cloud(std::move(*decoding.take()))); });
      }
    }
    loop.close();
  });
  while (const auto task = loop.pop()) {
    (*task)();
  }
  arrival.join();
  said.take(mapper.finish());
}

void expect_same(const Said& a, const Said& b) {
  EXPECT_EQ(a.events, b.events);
  ASSERT_EQ(a.scans.size(), b.scans.size());
  for (std::size_t i = 0; i < a.scans.size(); ++i) {
    const Odometry& x = a.scans[i].odometry;
    const Odometry& y = b.scans[i].odometry;
    EXPECT_EQ(x.stamp_ns, y.stamp_ns);
    EXPECT_EQ(x.T_frame_child.p, y.T_frame_child.p);
    EXPECT_EQ(x.T_frame_child.q.coeffs(), y.T_frame_child.q.coeffs());
    EXPECT_EQ(x.pose_covariance, y.pose_covariance);
    EXPECT_EQ(a.scans[i].checkpoint.covariance, b.scans[i].checkpoint.covariance);
    EXPECT_EQ(a.scans[i].status.scans_received, b.scans[i].status.scans_received);
  }
}

class DecodingAhead : public ::testing::TestWithParam<std::tuple<std::size_t, MapperIs>> {};

TEST_P(DecodingAhead, gives_the_same_bits_events_and_counts_as_one_thread) {
  const Said expected = on_one_thread();
  ASSERT_GE(expected.scans.size(), 25U);
  ASSERT_FALSE(expected.events.empty());
  Said threaded;
  on_threads(std::get<0>(GetParam()), std::get<1>(GetParam()), threaded);
  expect_same(expected, threaded);
}

INSTANTIATE_TEST_SUITE_P(ByRoom,
                         DecodingAhead,
                         ::testing::Combine(::testing::Values(1, 4, 60),
                                            ::testing::Values(MapperIs::kWaiting,
                                                              MapperIs::kBusy)));

TEST(DecodeAheadThread, leaves_a_cloud_to_a_mapper_that_waits) {
  DecodeAhead decoding({}, 1);
  ASSERT_TRUE(decoding.add(RoomDrive().sweep_at(RoomDrive::kEpoch_ns, 10), MapperIs::kWaiting));
  std::this_thread::sleep_for(std::chrono::milliseconds(30));  // many times what decoding takes
  EXPECT_EQ(decoding.take_spare_bytes().capacity(), 0U);
  EXPECT_TRUE(decoding.take().has_value());
  EXPECT_GT(decoding.take_spare_bytes().capacity(), 0U);
}

TEST(DecodeAheadThread, lets_go_of_who_waits_to_hand_a_cloud_over_when_it_is_stopped) {
  DecodeAhead decoding({}, 1);
  const PointCloudMessage cloud = RoomDrive().sweep_at(RoomDrive::kEpoch_ns, 10);
  auto waiting = std::async(std::launch::async, [&] {
    while (decoding.add(cloud, MapperIs::kBusy)) {
    }
  });
  decoding.stop();
  waiting.get();
}

TEST(DecodeAheadThread, decodes_by_itself_while_the_mapper_is_busy) {
  DecodeAhead decoding({}, 1);
  PointCloudMessage cloud = RoomDrive().sweep_at(RoomDrive::kEpoch_ns, 10);
  ASSERT_TRUE(decoding.add(cloud, MapperIs::kBusy));
  std::vector<std::uint8_t> spare;  // there once it is decoded, and nobody has asked for it
  while ((spare = decoding.take_spare_bytes()).capacity() == 0) {
    std::this_thread::yield();
  }
  EXPECT_TRUE(decoding.take().has_value());
}

TEST(DecodeAheadThread, gives_the_memory_of_a_decoded_cloud_back_unless_it_is_large) {
  DecodeAhead decoding({}, 1);
  const PointCloudMessage cloud = RoomDrive().sweep_at(RoomDrive::kEpoch_ns, 10);
  for (const std::size_t bytes : {std::size_t{1'000'000}, std::size_t{20'000'000}}) {
    PointCloudMessage given = cloud;
    given.data.reserve(bytes);
    const std::uint8_t* memory = given.data.data();
    ASSERT_TRUE(decoding.add(std::move(given), MapperIs::kWaiting));
    ASSERT_TRUE(decoding.take().has_value());
    const std::vector<std::uint8_t> spare = decoding.take_spare_bytes();
    EXPECT_EQ(spare.data() == memory, bytes < 16'000'000U);
    EXPECT_EQ(decoding.take_spare_bytes().capacity(), 0U);
  }
}

TEST(DecodedCloud, says_in_its_scans_status_how_long_its_decoding_took) {
  LioMapper mapper({}, RobotConfig{});
  CloudDecoder decoder({});
  double decoding_ms = 0.0;
  std::vector<double> told_ms;
  const auto note = [&](const Output& output) {
    for (const ScanResult& scan : output.scans) {
      told_ms.push_back(scan.status.scan_ms);
    }
  };
  for (const Input& input : inputs()) {
    if (const auto* imu = std::get_if<ImuSample>(&input)) {
      note(mapper.on_imu(*imu));
    } else {
      DecodedCloud cloud = decoder.decode(std::get<PointCloudMessage>(input));
      cloud.set_decoding_ms(decoding_ms += 1.0);
      note(mapper.on_decoded_cloud(std::move(cloud)));
    }
  }
  ASSERT_GE(told_ms.size(), 25U);
  // The third cloud is none; the others come out in their order.
  EXPECT_EQ(told_ms[0], 1.0);
  EXPECT_EQ(told_ms[1], 2.0);
  for (std::size_t i = 2; i < told_ms.size(); ++i) {
    EXPECT_EQ(told_ms[i], static_cast<double>(i) + 2.0);
  }
}

TEST(WritingBeside, a_disk_that_does_not_answer_delays_no_scan_and_loses_none) {
  std::promise<void> answer;
  std::vector<Nanoseconds> written;
  Said said;
  SerialWorker disk(100);
  said.on_scan = [&, answered = answer.get_future().share()](const ScanResult& scan) {
    disk.give([&written, answered, stamp_ns = scan.odometry.stamp_ns] {
      answered.wait();
      written.push_back(stamp_ns);
    });
  };
  on_threads(60, MapperIs::kBusy, said);  // returns although nothing is written yet
  answer.set_value();
  disk.finish();
  expect_same(on_one_thread(), said);
  ASSERT_EQ(written.size(), said.scans.size());
  for (std::size_t i = 0; i < written.size(); ++i) {
    EXPECT_EQ(written[i], said.scans[i].odometry.stamp_ns);
  }
}

}  // namespace
}  // namespace trigpoint::lio_mapper
