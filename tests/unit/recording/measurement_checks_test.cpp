// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "measurement_checks.hpp"

#include "trigpoint/base/point_cloud.hpp"

#include "samples.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace trigpoint::recording {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(MeasurementChecks, counts_imu_samples_that_are_not_finite) {
  MeasurementChecks checks;
  for (int i = 0; i < 200; ++i) {
    ImuSample imu = sample_imu(i);
    imu.gyro_radps = {0.1, 0.2, 0.3};
    imu.accel_mps2.x() = i % 50 == 0 ? kNan : 0.0;
    checks.take(imu);
  }
  EXPECT_THAT(checks.remarks(),
              testing::ElementsAre(AllOf(HasSubstr("NaN"), HasSubstr("4 times"))));
}

TEST(MeasurementChecks, counts_fixes_whose_position_or_covariance_is_not_finite) {
  MeasurementChecks checks;
  GnssFix fix = sample_fix(0);
  fix.latitude_deg = kNan;
  checks.take(fix);
  fix = sample_fix(1);
  fix.covariance_enu_m2.setConstant(kNan);
  checks.take(fix);
  EXPECT_THAT(checks.remarks(), Contains(HasSubstr("a position that is not finite")));
  EXPECT_THAT(checks.remarks(), Contains(HasSubstr("a covariance that is not finite")));
}

TEST(MeasurementChecks, let_fixes_come_out_of_order_as_far_as_filters_take_them) {
  MeasurementChecks checks;
  GnssFix fix = sample_fix(0);
  const Nanoseconds newest_ns = fix.stamp_ns + 10 * kNanosecondsPerSecond;
  for (const double back_s : {0.0, 0.4, 2.4}) {
    fix.stamp_ns = newest_ns - from_seconds(back_s);
    checks.take(fix);
  }
  EXPECT_THAT(checks.remarks(), testing::IsEmpty());
  fix.stamp_ns = newest_ns - from_seconds(2.6);
  checks.take(fix);
  EXPECT_THAT(checks.remarks(), testing::ElementsAre(HasSubstr("goes back")));
  MeasurementChecks of_imu;
  ImuSample imu;
  imu.frame_id = "imu";
  imu.accel_mps2.z() = 9.81;
  for (const Nanoseconds stamp_ns : {newest_ns, newest_ns - 1}) {
    imu.stamp_ns = stamp_ns;
    of_imu.take(imu);
  }
  EXPECT_THAT(of_imu.remarks(), testing::ElementsAre(HasSubstr("goes back")));
}

TEST(MeasurementChecks, tells_swapped_coordinates_from_those_out_of_range) {
  MeasurementChecks swapped;
  GnssFix fix = sample_fix(0);
  fix.latitude_deg = 139.7;
  fix.longitude_deg = 35.7;
  swapped.take(fix);
  EXPECT_THAT(swapped.remarks(), testing::ElementsAre(HasSubstr("are swapped")));
  MeasurementChecks out_of_range;
  fix.longitude_deg = 139.7;
  out_of_range.take(fix);
  EXPECT_THAT(out_of_range.remarks(), testing::ElementsAre(HasSubstr("out of range")));
}

TEST(MeasurementChecks, tell_an_odometry_without_child_frame_or_with_a_broken_pose) {
  Odometry odometry;
  odometry.stamp_ns = 1;
  odometry.frame_id = "odom";
  odometry.child_frame_id = "base_link";
  MeasurementChecks good;
  good.take(odometry);
  EXPECT_THAT(good.remarks(), IsEmpty());
  odometry.frame_id = "/odom";
  odometry.child_frame_id.clear();
  odometry.T_frame_child.q.coeffs().setZero();
  MeasurementChecks bad;
  bad.take(odometry);
  EXPECT_THAT(bad.remarks(),
              testing::UnorderedElementsAre(HasSubstr("begins with a slash"),
                                            HasSubstr("an empty child_frame_id"),
                                            HasSubstr("no unit quaternion")));
}

TEST(MeasurementChecks, does_not_ask_of_our_own_topics_what_only_sensors_have) {
  PointCloudMessage map = sample_cloud(0);
  map.data.assign(map.data.size(), 0);
  map.fields.pop_back();
  GnssFix datum = sample_fix(0);
  datum.stamp_ns = 0;
  datum.covariance_type = CovarianceType::kUnknown;
  datum.covariance_enu_m2.setZero();
  MeasurementChecks our_map(MeasurementChecks::Origin::kOurs);
  our_map.take(map);
  EXPECT_THAT(our_map.remarks(), IsEmpty());
  MeasurementChecks our_datum(MeasurementChecks::Origin::kOurs);
  our_datum.take(datum);
  EXPECT_THAT(our_datum.remarks(), IsEmpty());
  MeasurementChecks of_a_lidar;
  of_a_lidar.take(map);
  EXPECT_THAT(of_a_lidar.remarks(), testing::ElementsAre(HasSubstr("carry no time")));
  MeasurementChecks of_a_receiver;
  of_a_receiver.take(datum);
  EXPECT_THAT(of_a_receiver.remarks(), Contains(HasSubstr("a stamp of 0")));
  EXPECT_THAT(of_a_receiver.remarks(), Contains(HasSubstr("nothing of its covariance")));
}

/// A wall at this range on the left, with a point without a return and one that is none.
PointCloudMessage cloud_at(float range) {
  PointCloud points;
  for (int i = 0; i < 2000; ++i) {
    points.push_back({0.01F * range * static_cast<float>(i % 10), range, 0.0F, 1.0F});
  }
  points[0] = {0.0F, 0.0F, 0.0F, 0.0F};
  points[1] = {std::numeric_limits<float>::quiet_NaN(), 0.0F, 0.0F, 0.0F};
  PointCloudMessage cloud = to_cloud_message(points, 1, "lidar");
  cloud.fields.back().name = "time";
  return cloud;
}

TEST(MeasurementChecks, tell_points_in_millimetres_from_those_far_away) {
  MeasurementChecks far;
  far.take(cloud_at(150.0F));
  EXPECT_THAT(far.remarks(), IsEmpty());
  MeasurementChecks millimetres;
  millimetres.take(cloud_at(8000.0F));
  EXPECT_THAT(millimetres.remarks(),
              testing::ElementsAre(AllOf(HasSubstr("farther than 8"), HasSubstr("millimetres"))));
  MeasurementChecks map(MeasurementChecks::Origin::kOurs);
  map.take(cloud_at(8000.0F));
  EXPECT_THAT(map.remarks(), IsEmpty());
}

TEST(MeasurementChecks, look_at_no_points_that_a_cloud_does_not_hold) {
  PointCloudMessage cloud = cloud_at(8000.0F);
  cloud.point_step = 8;  // z would lie beyond
  MeasurementChecks checks;
  checks.take(cloud);
  cloud = cloud_at(8000.0F);
  cloud.data.resize(7);
  checks.take(cloud);
  EXPECT_THAT(checks.remarks(), IsEmpty());
}
}  // namespace
}  // namespace trigpoint::recording
