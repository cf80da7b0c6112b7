// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "sweep.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>

namespace trigpoint::lio_mapper {
namespace {

using ::testing::HasSubstr;

constexpr Nanoseconds kStamp_ns = 1'700'000'000'250'000'000;
constexpr double kSweep_s = 0.1;
constexpr int kPoints = 1000;

/// Doubles hold seconds since 1970 to 0.24 us, nanoseconds to 256 ns.
constexpr Nanoseconds kDouble_ns = 500;
/// Single precision holds 0.1 s to 7 ns.
constexpr double kSingle_s = 1e-8;

enum Type : std::uint8_t { kI8 = 1, kU8, kI16, kU16, kI32, kU32, kF32, kF64 };

std::uint32_t size_of(std::uint8_t type) {
  constexpr std::array<std::uint32_t, 9> kSizes{0, 1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes.at(type);
}

template <typename T>
void store(std::uint8_t* at, double value) {
  const T typed = static_cast<T>(value);
  std::memcpy(at, &typed, sizeof typed);
}

void write(std::uint8_t* at, std::uint8_t type, double value) {
  switch (type) {
    case kI8:
      return store<std::int8_t>(at, value);
    case kU8:
      return store<std::uint8_t>(at, value);
    case kI16:
      return store<std::int16_t>(at, value);
    case kU16:
      return store<std::uint16_t>(at, value);
    case kI32:
      return store<std::int32_t>(at, value);
    case kU32:
      return store<std::uint32_t>(at, value);
    case kF32:
      return store<float>(at, value);
    default:
      return store<double>(at, value);
  }
}

/// Value of field `name` of point `i`.
using Values = std::function<double(const std::string& name, int i)>;

double fraction(int i) {
  return i / (kPoints - 1.0);
}

/// Points on a spiral of 5 to 15 m; `time(f)` is the raw value at the fraction f of the sweep.
Values spiral(const std::function<double(double)>& time) {
  return [time](const std::string& name, int i) {
    const double angle_rad = 2.0 * M_PI * fraction(i);
    const double range_m = 5.0 + 10.0 * fraction(i);
    if (name == "x") {
      return range_m * std::cos(angle_rad);
    }
    if (name == "y") {
      return range_m * std::sin(angle_rad);
    }
    if (name == "z") {
      return 1.0;
    }
    if (name == "intensity" || name == "reflectivity") {
      return static_cast<double>(i % 200);
    }
    return name == "t" || name.find("time") != std::string::npos ? time(fraction(i)) : 77.0;
  };
}

PointCloudMessage cloud_of(const std::vector<PointField>& fields,
                           std::uint32_t point_step,
                           const Values& values,
                           std::uint32_t height = 1) {
  PointCloudMessage cloud;
  cloud.stamp_ns = kStamp_ns;
  cloud.fields = fields;
  cloud.height = height;
  cloud.width = kPoints / height;
  cloud.point_step = point_step;
  cloud.row_step = point_step * cloud.width;
  cloud.data.assign(std::size_t{point_step} * kPoints, 0xAB);
  for (int i = 0; i < kPoints; ++i) {
    for (const PointField& field : fields) {
      if (field.datatype >= 1 && field.datatype <= 8 &&
          field.offset + size_of(field.datatype) <= point_step) {
        write(&cloud.data[static_cast<std::size_t>(i) * point_step + field.offset],
              field.datatype,
              values(field.name, i));
      }
    }
  }
  return cloud;
}

std::vector<PointField> xyzi(std::vector<PointField> more = {}, std::uint32_t intensity_at = 12) {
  std::vector<PointField> fields{{"x", 0, kF32, 1},
                                 {"y", 4, kF32, 1},
                                 {"z", 8, kF32, 1},
                                 {"intensity", intensity_at, kF32, 1}};
  fields.insert(fields.end(), more.begin(), more.end());
  return fields;
}

double stamp_s() {
  return static_cast<double>(kStamp_ns) * 1e-9;
}

PointCloudMessage velodyne(double first_s = 0.0) {
  return cloud_of(xyzi({{"ring", 16, kU16, 1}, {"time", 18, kF32, 1}}),
                  22,
                  spiral([first_s](double f) { return first_s + kSweep_s * f; }));
}

PointCloudMessage ouster() {
  return cloud_of(xyzi({{"t", 20, kU32, 1},
                        {"reflectivity", 24, kU16, 1},
                        {"ring", 26, kU16, 1},
                        {"ambient", 28, kU16, 1},
                        {"range", 32, kU32, 1}},
                       16),
                  48,
                  spiral([](double f) { return kSweep_s * 1e9 * f; }),
                  10);
}

PointCloudMessage livox() {
  return cloud_of(xyzi({{"tag", 16, kU8, 1}, {"line", 17, kU8, 1}, {"timestamp", 18, kF64, 1}}),
                  26,
                  spiral([](double f) { return stamp_s() * 1e9 + kSweep_s * 1e9 * f; }));
}

PointCloudMessage hesai(double clock_offset_s = 0.0) {
  return cloud_of(
      xyzi({{"ring", 16, kU16, 1}, {"timestamp", 18, kF64, 1}}),
      26,
      spiral([clock_offset_s](double f) { return stamp_s() + clock_offset_s + kSweep_s * f; }));
}

PointCloudMessage kitti() {
  return cloud_of(xyzi({{"time", 16, kF32, 1}}), 20, spiral([](double f) { return kSweep_s * f; }));
}

Sweep decoded(const PointCloudMessage& cloud, const SweepTimingConfig& config = {}) {
  SweepDecoder decoder(config);
  Events events;
  auto result = decoder.decode(cloud, events);
  if (const auto* refusal = std::get_if<SweepRefusal>(&result)) {
    ADD_FAILURE() << refusal->code << ": " << refusal->text;
    return {};
  }
  return std::get<Sweep>(result);
}

SweepRefusal refused(const PointCloudMessage& cloud, const SweepTimingConfig& config = {}) {
  SweepDecoder decoder(config);
  Events events;
  auto result = decoder.decode(cloud, events);
  if (std::holds_alternative<Sweep>(result)) {
    ADD_FAILURE() << "expected a refusal";
    return {};
  }
  EXPECT_TRUE(events.empty());
  return std::get<SweepRefusal>(result);
}

std::string announcement(const PointCloudMessage& cloud) {
  SweepDecoder decoder({});
  Events events;
  decoder.decode(cloud, events);
  return events.size() == 1 ? events[0].text : "not exactly one event";
}

void expect_spiral(const Sweep& sweep, Nanoseconds begin_ns, Nanoseconds tolerance_ns) {
  ASSERT_EQ(sweep.points.size(), static_cast<std::size_t>(kPoints));
  EXPECT_EQ(sweep.points_received, static_cast<std::size_t>(kPoints));
  EXPECT_EQ(sweep.points_refused, 0U);
  EXPECT_NEAR(
      static_cast<double>(sweep.begin_ns - begin_ns), 0.0, static_cast<double>(tolerance_ns));
  EXPECT_NEAR(static_cast<double>(sweep.end_ns - sweep.begin_ns),
              kSweep_s * 1e9,
              static_cast<double>(2 * tolerance_ns));
  const auto point = spiral([](double f) { return f; });
  for (int i = 0; i < kPoints; i += 37) {
    const TimedPoint& p = sweep.points[static_cast<std::size_t>(i)];
    EXPECT_FLOAT_EQ(p.x, static_cast<float>(point("x", i)));
    EXPECT_FLOAT_EQ(p.y, static_cast<float>(point("y", i)));
    EXPECT_FLOAT_EQ(p.z, 1.0F);
    EXPECT_FLOAT_EQ(p.intensity, static_cast<float>(i % 200));
    EXPECT_NEAR(
        p.time_s, kSweep_s * fraction(i), 1e-9 * static_cast<double>(tolerance_ns) + kSingle_s);
  }
}

TEST(SweepDecoder, reads_velodyne_clouds) {
  expect_spiral(decoded(velodyne()), kStamp_ns, 10);
}

TEST(SweepDecoder, reads_ouster_clouds) {
  expect_spiral(decoded(ouster()), kStamp_ns, 10);
}

TEST(SweepDecoder, reads_livox_clouds) {
  expect_spiral(decoded(livox()), kStamp_ns, kDouble_ns);
}

TEST(SweepDecoder, reads_hesai_and_robosense_clouds) {
  expect_spiral(decoded(hesai()), kStamp_ns, kDouble_ns);
}

TEST(SweepDecoder, reads_kitti_clouds) {
  expect_spiral(decoded(kitti()), kStamp_ns, 10);
}

TEST(SweepDecoder, says_once_what_it_detected) {
  EXPECT_THAT(announcement(velodyne()), HasSubstr("'time' (float32) in s, counted from"));
  EXPECT_THAT(announcement(velodyne(-0.1)), HasSubstr("the stamp is the end"));
  EXPECT_THAT(announcement(ouster()), HasSubstr("'t' (uint32) in ns, counted from"));
  EXPECT_THAT(announcement(livox()), HasSubstr("'timestamp' (float64) in ns, absolute"));
  EXPECT_THAT(announcement(hesai()), HasSubstr("'timestamp' (float64) in s, absolute"));
  EXPECT_THAT(announcement(hesai(-5e8)), HasSubstr("not the stamp's"));

  SweepDecoder decoder({});
  Events events;
  decoder.decode(velodyne(), events);
  decoder.decode(velodyne(0.001), events);
  EXPECT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].code, "point_times_detected");
  decoder.decode(ouster(), events);
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[1].code, "point_times_changed");
}

TEST(SweepDecoder, negative_times_lie_before_the_stamp) {
  expect_spiral(decoded(velodyne(-kSweep_s)), kStamp_ns - 100'000'000, 20);
}

TEST(SweepDecoder, times_of_a_foreign_clock_begin_at_the_stamp) {
  expect_spiral(decoded(hesai(-5e8)), kStamp_ns, kDouble_ns);
}

TEST(SweepDecoder, reads_every_time_unit) {
  for (const double unit_s : {1.0, 1e-3, 1e-6, 1e-9}) {
    for (const bool absolute : {false, true}) {
      SCOPED_TRACE(std::to_string(unit_s) + (absolute ? " absolute" : " relative"));
      const double origin_s = absolute ? stamp_s() : 0.0;
      expect_spiral(decoded(cloud_of(xyzi({{"time", 16, kF64, 1}}), 24, spiral([&](double f) {
                                       return (origin_s + kSweep_s * f) / unit_s;
                                     }))),
                    kStamp_ns,
                    kDouble_ns);
    }
  }
}

TEST(SweepDecoder, the_stamp_may_be_configured_as_begin_middle_or_end) {
  SweepTimingConfig config;
  for (const auto& cloud : {velodyne(), velodyne(-kSweep_s), hesai(), hesai(3.0), ouster()}) {
    config.stamp_is = "begin";
    expect_spiral(decoded(cloud, config), kStamp_ns, kDouble_ns);
    config.stamp_is = "middle";
    expect_spiral(decoded(cloud, config), kStamp_ns - 50'000'000, kDouble_ns);
    config.stamp_is = "end";
    expect_spiral(decoded(cloud, config), kStamp_ns - 100'000'000, kDouble_ns);
  }
}

TEST(SweepDecoder, the_begin_does_not_move_when_the_first_points_are_out_of_range) {
  SweepTimingConfig config;
  config.min_range_m = 6.0;  // the first tenth of the spiral
  for (const char* stamp_is : {"auto", "begin"}) {
    config.stamp_is = stamp_is;
    const Sweep sweep = decoded(velodyne(), config);
    EXPECT_NEAR(static_cast<double>(sweep.begin_ns - kStamp_ns), 0.1 * kSweep_s * 1e9, 1.5e6);
    EXPECT_NEAR(static_cast<double>(sweep.end_ns - kStamp_ns), kSweep_s * 1e9, 100.0);
    EXPECT_EQ(sweep.points.front().time_s, 0.0F);
  }
}

TEST(SweepDecoder, the_time_field_and_its_unit_may_be_configured) {
  const auto cloud = cloud_of(xyzi({{"time", 16, kF32, 1}, {"my_time", 20, kF64, 1}}),
                              28,
                              spiral([](double f) { return kSweep_s * 1e3 * f; }));
  SweepTimingConfig config;
  config.time_field = "my_time";
  config.time_unit = "ms";
  expect_spiral(decoded(cloud, config), kStamp_ns, 10);
  config.time_unit = "s";
  const SweepRefusal wrong = refused(cloud, config);
  EXPECT_EQ(wrong.code, "implausible_point_times");
  EXPECT_THAT(wrong.text, HasSubstr("'my_time' ranges from 0 to 100"));
  config.time_field = "their_time";
  EXPECT_EQ(refused(cloud, config).code, "points_without_time");
}

TEST(SweepDecoder, works_from_the_zero_of_a_simulated_clock_on) {
  for (const Nanoseconds stamp_ns :
       {Nanoseconds{0}, Nanoseconds{50'000'000}, Nanoseconds{3'000'000'000}}) {
    PointCloudMessage cloud = velodyne();
    cloud.stamp_ns = stamp_ns;
    expect_spiral(decoded(cloud), stamp_ns, 10);
    const double from_s = static_cast<double>(stamp_ns) * 1e-9;
    PointCloudMessage absolute = cloud_of(xyzi({{"timestamp", 16, kF64, 1}}),
                                          24,
                                          spiral([&](double f) { return from_s + kSweep_s * f; }));
    absolute.stamp_ns = stamp_ns;
    expect_spiral(decoded(absolute), stamp_ns, 10);
  }
}

TEST(SweepDecoder, the_time_offset_moves_the_sweep) {
  SweepTimingConfig config;
  config.time_offset_s = -0.025;
  expect_spiral(decoded(velodyne(), config), kStamp_ns - 25'000'000, 10);
}

TEST(SweepDecoder, reads_coordinates_of_every_type) {
  for (std::uint8_t type = kI8; type <= kF64; ++type) {
    const auto values = [](const std::string& name, int i) {
      return name == "x"      ? 3.0
             : name == "y"    ? 4.0
             : name == "z"    ? 5.0
             : name == "time" ? 1e-4 * i
                              : 9.0;
    };
    const Sweep sweep = decoded(cloud_of({{"z", 3, type, 1},
                                          {"junk", 11, kU8, 5},
                                          {"y", 17, type, 1},
                                          {"x", 25, type, 1},
                                          {"intensity", 33, type, 1},
                                          {"time", 41, kF32, 1}},
                                         53,
                                         values));
    ASSERT_EQ(sweep.points.size(), static_cast<std::size_t>(kPoints)) << int{type};
    EXPECT_EQ(sweep.points[7].x, 3.0F) << int{type};
    EXPECT_EQ(sweep.points[7].y, 4.0F) << int{type};
    EXPECT_EQ(sweep.points[7].z, 5.0F) << int{type};
    EXPECT_EQ(sweep.points[7].intensity, 9.0F) << int{type};
  }
}

TEST(SweepDecoder, reads_times_of_every_wide_type) {
  for (const std::uint8_t type : {std::uint8_t{kU16},
                                  std::uint8_t{kI32},
                                  std::uint8_t{kU32},
                                  std::uint8_t{kF32},
                                  std::uint8_t{kF64}}) {
    const Sweep sweep = decoded(cloud_of(xyzi({{"time", 16, type, 1}}), 24, spiral([](double f) {
                                           return std::round(60000.0 * f);  // us
                                         })));
    EXPECT_NEAR(static_cast<double>(sweep.end_ns - sweep.begin_ns), 6e7, 10.0) << int{type};
  }
}

TEST(SweepDecoder, a_cloud_without_intensity_has_zero_intensity) {
  const Sweep sweep = decoded(
      cloud_of({{"x", 0, kF32, 1}, {"y", 4, kF32, 1}, {"z", 8, kF32, 1}, {"time", 12, kF32, 1}},
               16,
               spiral([](double f) { return kSweep_s * f; })));
  EXPECT_EQ(sweep.points.at(5).intensity, 0.0F);
}

TEST(SweepDecoder, drops_and_counts_points_that_are_not_finite_or_out_of_range) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const auto good = spiral([](double f) { return kSweep_s * f; });
  const auto values = [&](const std::string& name, int i) {
    const std::array<std::pair<const char*, double>, 6> bad{
        {{"x", kNaN}, {"y", kInf}, {"z", -kInf}, {"time", kNaN}, {"x", 130.0}, {"time", kInf}}};
    if (i % 10 == 3) {
      const auto& [field, value] = bad.at(static_cast<std::size_t>(i / 10 % 6));
      return name == field ? value : good(name, i);
    }
    if (i % 10 == 5) {
      return name == "time" ? good(name, i) : 0.1;  // nearer than 0.5 m
    }
    return name == "intensity" && i % 10 == 7 ? kNaN : good(name, i);
  };
  const Sweep sweep = decoded(cloud_of(xyzi({{"time", 16, kF32, 1}}), 20, values));
  EXPECT_EQ(sweep.points_received, 1000U);
  EXPECT_EQ(sweep.points_refused, 200U);
  ASSERT_EQ(sweep.points.size(), 800U);
  for (const TimedPoint& p : sweep.points) {
    EXPECT_TRUE(std::isfinite(p.x + p.y + p.z + p.intensity + p.time_s));
    EXPECT_GE(p.time_s, 0.0F);
  }
}

TEST(SweepDecoder, zero_times_of_missing_returns_do_not_spoil_absolute_times) {
  const auto good = spiral([](double f) { return stamp_s() + kSweep_s * f; });
  const auto values = [&](const std::string& name, int i) {
    return i % 3 == 1 ? 0.0 : good(name, i);
  };
  const Sweep sweep = decoded(cloud_of(xyzi({{"timestamp", 16, kF64, 1}}), 24, values));
  EXPECT_NEAR(static_cast<double>(sweep.begin_ns - kStamp_ns), 0.0, kDouble_ns);
  EXPECT_NEAR(static_cast<double>(sweep.end_ns - sweep.begin_ns), 1e8, 2.0 * kDouble_ns);
}

TEST(SweepDecoder, refuses_clouds_without_point_times) {
  const auto cloud =
      cloud_of(xyzi({{"ring", 16, kU16, 1}}), 18, spiral([](double f) { return f; }));
  const SweepRefusal refusal = refused(cloud);
  EXPECT_EQ(refusal.code, "points_without_time");
  EXPECT_THAT(refusal.text, HasSubstr("the cloud has: x y z intensity ring"));
}

TEST(SweepDecoder, refuses_times_that_are_all_the_same) {
  const SweepRefusal refusal =
      refused(cloud_of(xyzi({{"time", 16, kF32, 1}}), 20, spiral([](double) { return 0.0; })));
  EXPECT_EQ(refusal.code, "points_without_time");
  EXPECT_THAT(refusal.text, HasSubstr("all points have the same time"));
}

TEST(SweepDecoder, refuses_times_that_are_no_sweep_in_any_unit) {
  for (const double span : {5.0e-4, 1e10, 1e300}) {
    const SweepRefusal refusal = refused(
        cloud_of(xyzi({{"time", 16, kF64, 1}}), 24, spiral([span](double f) { return span * f; })));
    EXPECT_EQ(refusal.code, "implausible_point_times") << span;
  }
}

TEST(SweepDecoder, a_snapshot_has_all_points_at_the_stamp) {
  SweepTimingConfig config;
  config.point_time = "snapshot";
  const Sweep sweep = decoded(cloud_of(xyzi(), 16, spiral([](double f) { return f; })), config);
  EXPECT_EQ(sweep.begin_ns, kStamp_ns);
  EXPECT_EQ(sweep.end_ns, kStamp_ns);
  for (const TimedPoint& p : sweep.points) {
    EXPECT_EQ(p.time_s, 0.0F);
  }
}

TEST(SweepDecoder, azimuth_gives_the_time_of_a_spinning_lidar) {
  SweepTimingConfig config;
  config.point_time = "azimuth";
  // Four points: forward, left, backward, right; a little off the axes.
  const auto values = [](const std::string& name, int i) {
    const double azimuth_rad = M_PI / 2.0 * (i % 4) + 0.01;
    return name == "x"   ? 9.0 * std::cos(azimuth_rad)
           : name == "y" ? 9.0 * std::sin(azimuth_rad)
                         : 0.0;
  };
  const auto cloud = cloud_of(xyzi(), 16, values);

  struct Case {
    bool clockwise;
    double first_rad;
    std::array<double, 4> turn;  // of forward, left, backward, right
  };

  constexpr double kOff = 0.01 / (2.0 * M_PI);
  for (const Case& c : {Case{false, 0.0, {kOff, 0.25 + kOff, 0.5 + kOff, 0.75 + kOff}},
                        Case{true, M_PI, {0.5 - kOff, 0.25 - kOff, 1.0 - kOff, 0.75 - kOff}},
                        Case{false, -M_PI / 2, {0.25 + kOff, 0.5 + kOff, 0.75 + kOff, kOff}}}) {
    config.clockwise = c.clockwise;
    config.first_azimuth_rad = c.first_rad;
    const Sweep sweep = decoded(cloud, config);
    for (std::size_t i = 0; i < 8; ++i) {
      EXPECT_NEAR(sweep.points[i].time_s, kSweep_s * c.turn[i % 4], 1e-6);
    }
    EXPECT_EQ(sweep.begin_ns, kStamp_ns);
  }
  config.stamp_is = "end";
  EXPECT_EQ(decoded(cloud, config).begin_ns, kStamp_ns - 100'000'000);
  config.stamp_is = "middle";
  EXPECT_EQ(decoded(cloud, config).begin_ns, kStamp_ns - 50'000'000);
}

// ---- Descriptions that contradict themselves or the data ------------------------------------

struct Hostile {
  const char* code;
  const char* text;
  std::function<void(PointCloudMessage&)> change;
};

TEST(SweepDecoder, refuses_hostile_descriptions_and_says_why) {
  const std::vector<Hostile> cases{
      {"big_endian", "is_bigendian is true", [](auto& c) { c.is_bigendian = true; }},
      {"field_missing", "'y' is missing", [](auto& c) { c.fields[1].name = "why"; }},
      {"field_outside_point",
       "'z' (float32 at offset 19) ends at byte 23, expected at most point_step = 22",
       [](auto& c) { c.fields[2].offset = 19; }},
      {"field_outside_point",
       "'time' (float32 at offset 4294967295)",
       [](auto& c) { c.fields[5].offset = 0xFFFFFFFFU; }},
      {"field_outside_point", "'intensity'", [](auto& c) { c.fields[3].offset = 1000; }},
      {"field_outside_point", "point_step = 0", [](auto& c) { c.point_step = 0; }},
      {"bad_field_type", "'x' has datatype 9", [](auto& c) { c.fields[0].datatype = 9; }},
      {"bad_field_type", "'time' has datatype 0", [](auto& c) { c.fields[5].datatype = 0; }},
      {"truncated_data",
       "data has 21999 bytes, expected row_step x height = 22000",
       [](auto& c) { c.data.pop_back(); }},
      {"truncated_data", "data has 0 bytes", [](auto& c) { c.data.clear(); }},
      {"truncated_data", "expected row_step x height = 22000000", [](auto& c) { c.height = 1000; }},
      {"truncated_data", "expected row_step x height", [](auto& c) { c.row_step = 0xFFFFFFFFU; }},
      {"bad_row_step",
       "row_step is 21, expected at least width x point_step = 22000",
       [](auto& c) { c.row_step = 21; }},
      {"bad_row_step",
       "row_step is 0",
       [](auto& c) {
         c.row_step = 0;
         c.height = 2;
       }},
      {"cloud_too_large", "65536 x 65536", [](auto& c) { c.width = c.height = 65536; }},
      {"cloud_too_large",
       "4294967295 x 4294967295",
       [](auto& c) { c.width = c.height = 0xFFFFFFFFU; }},
      {"cloud_without_points",
       "0 x 4294967295",
       [](auto& c) {
         c.width = 0;
         c.height = 0xFFFFFFFFU;
       }},
      {"implausible_stamp", "stamp is -1 ns", [](auto& c) { c.stamp_ns = -1; }},
      {"implausible_stamp",
       "9223372036854775807",
       [](auto& c) { c.stamp_ns = std::numeric_limits<Nanoseconds>::max(); }},
      {"field_missing", "the cloud has: none", [](auto& c) { c.fields.clear(); }},
  };
  for (const Hostile& hostile : cases) {
    PointCloudMessage cloud = velodyne();
    hostile.change(cloud);
    const SweepRefusal refusal = refused(cloud);
    EXPECT_EQ(refusal.code, hostile.code) << hostile.text;
    EXPECT_THAT(refusal.text, HasSubstr(hostile.text));
  }
}

TEST(SweepDecoder, refuses_a_cloud_of_which_no_point_is_usable) {
  SweepTimingConfig config;
  config.min_range_m = 50.0;
  const SweepRefusal refusal = refused(velodyne(), config);
  EXPECT_EQ(refusal.code, "no_usable_points");
  EXPECT_THAT(refusal.text, HasSubstr("None of 1000 points"));
}

TEST(SweepDecoder, ignores_fields_that_it_does_not_know) {
  PointCloudMessage cloud = velodyne();
  cloud.fields[4].offset = 0xFFFFFFF0U;  // ring
  cloud.fields[4].datatype = 99;
  cloud.fields[4].count = 0xFFFFFFFFU;
  expect_spiral(decoded(cloud), kStamp_ns, 10);
}

TEST(SweepDecoder, accepts_padding_behind_points_and_rows) {
  PointCloudMessage cloud = velodyne();
  cloud.row_step = 0;  // one row needs none
  expect_spiral(decoded(cloud), kStamp_ns, 10);
  PointCloudMessage rows = ouster();
  constexpr std::uint32_t kPadding = 13;
  std::vector<std::uint8_t> padded;
  for (std::uint32_t r = 0; r < rows.height; ++r) {
    const auto begin = rows.data.begin() + r * rows.row_step;
    padded.insert(padded.end(), begin, begin + rows.row_step);
    padded.insert(padded.end(), kPadding, 0xCD);
  }
  rows.data = padded;
  rows.row_step += kPadding;
  expect_spiral(decoded(rows), kStamp_ns, 10);
}

TEST(SweepDecoder, survives_random_descriptions) {
  // Under the address sanitizer this finds reads outside the data.
  std::mt19937 random(1);
  const PointCloudMessage sane = velodyne();
  int good = 0;
  for (int i = 0; i < 20000; ++i) {
    PointCloudMessage cloud = sane;
    cloud.data.resize(random() % 2 == 0 ? cloud.data.size() : random() % 500);
    cloud.width = static_cast<std::uint32_t>(random() % 30);
    cloud.height = static_cast<std::uint32_t>(random() % 3);
    cloud.point_step = random() % 3 == 0 ? 22U : static_cast<std::uint32_t>(random() % 40);
    cloud.row_step = static_cast<std::uint32_t>(random() % 2 == 0 ? cloud.width * cloud.point_step
                                                                  : random() % 1000);
    for (PointField& field : cloud.fields) {
      field.offset = random() % 4 == 0 ? static_cast<std::uint32_t>(random() % 45) : field.offset;
      field.datatype =
          random() % 8 == 0 ? static_cast<std::uint8_t>(random() % 12) : field.datatype;
    }
    SweepDecoder decoder({});
    Events events;
    const auto result = decoder.decode(cloud, events);
    if (const auto* sweep = std::get_if<Sweep>(&result)) {
      ++good;
      EXPECT_LE(sweep->begin_ns, sweep->end_ns);
      EXPECT_EQ(sweep->points_received, sweep->points.size() + sweep->points_refused);
    } else {
      EXPECT_FALSE(std::get<SweepRefusal>(result).text.empty());
    }
  }
  EXPECT_GT(good, 100);
}

TEST(SweepDecoder, refuses_words_that_are_no_choice) {
  SweepTimingConfig config;
  config.stamp_is = "start";
  try {
    SweepDecoder decoder(config);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "stamp_is is 'start', expected one of auto, begin, middle, end");
  }
}

}  // namespace
}  // namespace trigpoint::lio_mapper
