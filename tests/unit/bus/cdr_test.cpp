// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/cdr.hpp"

#include "allocation_probe.hpp"
#include "samples.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>

namespace trigpoint::bus {
namespace {

using Bytes = std::vector<std::uint8_t>;

void append(Bytes& bytes, double value) {
  std::uint8_t raw[8];
  std::memcpy(raw, &value, sizeof raw);  // the machines we build for are little-endian
  bytes.insert(bytes.end(), raw, raw + sizeof raw);
}

TEST(Cdr, lays_a_fix_out_as_the_xcdr1_rules_say) {
  Bytes expected{0,    1,    0,    0,      // CDR little-endian
                 0xFF, 0xFF, 0xFF, 0xFF,   // sec -1: the stamp is half a second before 1970
                 0x00, 0x65, 0xCD, 0x1D,   // nanosec 500000000
                 4,    0,    0,    0,      // length with the terminating zero
                 'g',  'p',  's',  0,      //
                 0xFF, 0,    0x02, 0x01};  // status -1, one byte of padding, service 0x0102
  expected.insert(expected.end(), 4, 0);   // padding: doubles lie at multiples of 8
  for (const double value : {49.5, -8.25, 112.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0}) {
    append(expected, value);
  }
  expected.push_back(2);

  GnssFix fix = samples::fix();
  fix.stamp_ns = -500'000'000;
  fix.status = FixStatus::kNoFix;
  fix.latitude_deg = 49.5;
  fix.longitude_deg = -8.25;
  fix.altitude_m = 112.0;
  fix.covariance_enu_m2 << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  fix.covariance_type = CovarianceType::kDiagonalKnown;
  EXPECT_EQ(encode_cdr(fix), expected);
}

TEST(Cdr, lays_a_cloud_out_as_the_xcdr1_rules_say) {
  const Bytes expected{0, 1, 0, 0,                            // CDR little-endian
                       2, 0, 0, 0, 3,   0, 0, 0,              // stamp 2 s 3 ns
                       2, 0, 0, 0, 'a', 0, 0, 0,              // frame "a", padded to 4
                       1, 0, 0, 0, 2,   0, 0, 0,              // height, width
                       1, 0, 0, 0,                            // one field:
                       2, 0, 0, 0, 'x', 0, 0, 0,              // its name,
                       4, 0, 0, 0, 7,   0, 0, 0, 1, 0, 0, 0,  // offset, datatype, count
                       0, 0, 0, 0,                            // is_bigendian
                       1, 0, 0, 0, 2,   0, 0, 0,              // point_step, row_step
                       2, 0, 0, 0, 8,   9,                    // data
                       1};                                    // is_dense
  PointCloudMessage cloud;
  cloud.stamp_ns = 2'000'000'003;
  cloud.frame_id = "a";
  cloud.width = 2;
  cloud.fields = {{"x", 4, 7, 1}};
  cloud.point_step = 1;
  cloud.row_step = 2;
  cloud.data = {8, 9};
  EXPECT_EQ(encode_cdr(cloud), expected);
}

TEST(Cdr, reads_big_endian_messages) {
  const Bytes bytes{0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 2, 'a', 0, 0, 0, 0, 0, 0, 1, 0, 0,
                    0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0,   2, 0, 0, 0, 2, 8, 9, 1};
  PointCloudMessage cloud;
  ASSERT_TRUE(decode_cdr(bytes, cloud));
  EXPECT_EQ(cloud.stamp_ns, 2'000'000'003);
  EXPECT_EQ(cloud.width, 2U);
  EXPECT_EQ(cloud.row_step, 2U);
  EXPECT_EQ(cloud.data, (Bytes{8, 9}));
}

TEST(Cdr, names_the_types_as_ros_does) {
  EXPECT_STREQ(ros_type_name<ImuSample>(), "sensor_msgs/msg/Imu");
  EXPECT_STREQ(ros_type_name<GnssFix>(), "sensor_msgs/msg/NavSatFix");
  EXPECT_STREQ(ros_type_name<PointCloudMessage>(), "sensor_msgs/msg/PointCloud2");
  EXPECT_STREQ(ros_type_name<TwistMeasurement>(), "geometry_msgs/msg/TwistWithCovarianceStamped");
  EXPECT_STREQ(ros_type_name<YawMeasurement>(), "sensor_msgs/msg/Imu");
  EXPECT_STREQ(ros_type_name<Odometry>(), "nav_msgs/msg/Odometry");
  EXPECT_STREQ(ros_type_name<Datum>(), "sensor_msgs/msg/NavSatFix");
  EXPECT_STREQ(ros_type_name<GpsStatus>(), "trigpoint_msgs/msg/GpsStatus");
  EXPECT_STREQ(ros_type_name<LioStatus>(), "trigpoint_msgs/msg/LioStatus");
  EXPECT_STREQ(ros_type_name<StateUpdate>(), "trigpoint_msgs/msg/StateUpdate");
  EXPECT_STREQ(ros_type_name<FusionStatus>(), "trigpoint_msgs/msg/FusionStatus");
}

template <class Plain>
class EveryMessage : public ::testing::Test {};

struct Samples {
  ImuSample imu = samples::imu();
  GnssFix fix = samples::fix();
  PointCloudMessage cloud = samples::cloud();
  TwistMeasurement twist = samples::twist();
  YawMeasurement yaw = samples::yaw();
  Odometry odometry = samples::odometry();
  Datum datum = samples::datum();
  GpsStatus gps = samples::gps_status();
  LioStatus lio = samples::lio_status();
  StateUpdate update = samples::state_update();
  FusionStatus fusion = samples::fusion_status();

  const ImuSample& get(const ImuSample*) const { return imu; }

  const GnssFix& get(const GnssFix*) const { return fix; }

  const PointCloudMessage& get(const PointCloudMessage*) const { return cloud; }

  const TwistMeasurement& get(const TwistMeasurement*) const { return twist; }

  const YawMeasurement& get(const YawMeasurement*) const { return yaw; }

  const Odometry& get(const Odometry*) const { return odometry; }

  const Datum& get(const Datum*) const { return datum; }

  const GpsStatus& get(const GpsStatus*) const { return gps; }

  const LioStatus& get(const LioStatus*) const { return lio; }

  const StateUpdate& get(const StateUpdate*) const { return update; }

  const FusionStatus& get(const FusionStatus*) const { return fusion; }
};

template <class Plain>
Plain sample() {
  return Samples().get(static_cast<const Plain*>(nullptr));
}

using Plains = ::testing::Types<ImuSample,
                                GnssFix,
                                PointCloudMessage,
                                TwistMeasurement,
                                YawMeasurement,
                                Odometry,
                                Datum,
                                GpsStatus,
                                LioStatus,
                                StateUpdate,
                                FusionStatus>;
TYPED_TEST_SUITE(EveryMessage, Plains);

TYPED_TEST(EveryMessage, comes_back_field_by_field) {
  TypeParam back;
  ASSERT_TRUE(decode_cdr(encode_cdr(sample<TypeParam>()), back));
  samples::expect_equal(back, sample<TypeParam>());
}

TYPED_TEST(EveryMessage, is_refused_at_every_truncation_and_leaves_the_output_alone) {
  const Bytes whole = encode_cdr(sample<TypeParam>());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    TypeParam back = sample<TypeParam>();
    ASSERT_FALSE(decode_cdr(std::span(whole).first(size), back)) << size << " bytes";
    samples::expect_equal(back, sample<TypeParam>());
  }
}

TYPED_TEST(EveryMessage, is_refused_in_an_unknown_encapsulation) {
  Bytes bytes = encode_cdr(sample<TypeParam>());
  TypeParam back;
  for (const int identifier : {2, 3, 6, 7, 8, 9, 255}) {
    bytes[1] = static_cast<std::uint8_t>(identifier);
    EXPECT_FALSE(decode_cdr(bytes, back)) << identifier;
  }
}

// The largest element of a sequence on the wire (a string and numbers) takes 8 bytes there and
// about 90 in memory, and a vector may double while it grows.
constexpr std::size_t kAmplification = 32;
constexpr std::size_t kSmallAllocations = 4096;

TYPED_TEST(EveryMessage, does_not_allocate_what_a_hostile_length_asks_for) {
  const Bytes whole = encode_cdr(sample<TypeParam>());
  for (std::size_t word = 4; word + 4 <= whole.size(); word += 4) {
    for (const std::uint32_t length : {0xFFFFFFFFU, 0x7FFFFFFFU, 0x10000000U, 0x00010000U}) {
      Bytes hostile = whole;
      std::memcpy(hostile.data() + word, &length, sizeof length);
      reset_largest_allocation();
      TypeParam back;
      decode_cdr(hostile, back);
      ASSERT_LE(largest_allocation(), kSmallAllocations + kAmplification * hostile.size())
          << "length " << length << " at byte " << word;
    }
  }
}

TEST(Cdr, refuses_a_cloud_of_nothing_but_fields_before_it_takes_memory) {
  constexpr std::uint32_t kFields = 200'000;
  Bytes bytes{0, 1, 0, 0};
  const auto append_words = [&bytes](std::initializer_list<std::uint32_t> words) {
    for (const std::uint32_t word : words) {
      for (unsigned shift = 0; shift < 32; shift += 8) {
        bytes.push_back(static_cast<std::uint8_t>(word >> shift));
      }
    }
  };
  append_words({1, 0, 1, 0, 1, 1, kFields});  // stamp, no frame, height, width
  for (std::uint32_t i = 0; i < kFields; ++i) {
    append_words({1, 0, 0, 7, 1});  // no name, offset, datatype, count
  }
  append_words({0, 0, 0, 0, 0});
  reset_largest_allocation();
  PointCloudMessage cloud;
  EXPECT_FALSE(decode_cdr(bytes, cloud));
  EXPECT_LE(largest_allocation(), kSmallAllocations);
}

TYPED_TEST(EveryMessage, survives_random_bytes) {
  std::mt19937 random(20240607);
  const Bytes whole = encode_cdr(sample<TypeParam>());
  for (int round = 0; round < 2000; ++round) {
    Bytes hostile = whole;
    for (int change = 0; change < 8; ++change) {
      hostile[4 + random() % (hostile.size() - 4)] = static_cast<std::uint8_t>(random());
    }
    TypeParam back;
    decode_cdr(hostile, back);
    encode_cdr(back);
  }
}

}  // namespace
}  // namespace trigpoint::bus
