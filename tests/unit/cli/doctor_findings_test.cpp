// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "doctor_findings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::cli {
namespace {

using bus::DiscoveredEndpoint;
using recording::TopicSurvey;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kImu = "sensor_msgs/msg/Imu";
constexpr const char* kDdsImu = "sensor_msgs::msg::dds_::Imu_";

TopicSurvey survey(const std::string& name, const std::string& type = kImu) {
  TopicSurvey result;
  result.topic.name = name;
  result.topic.ros_type = type;
  result.topic.from_sensor = true;
  return result;
}

TopicSurvey fixes_at(const std::string& name, double latitude_deg, double longitude_deg) {
  TopicSurvey result = survey(name, "sensor_msgs/msg/NavSatFix");
  result.topic.from_sensor = name != "datum";
  result.last_fix.emplace();
  result.last_fix->latitude_deg = latitude_deg;
  result.last_fix->longitude_deg = longitude_deg;
  return result;
}

DiscoveredEndpoint writer(const std::string& dds_topic, const std::string& dds_type = kDdsImu) {
  return {"010f00000000000000000000000000" + std::string("03"), true, dds_topic, dds_type};
}

DiscoveredEndpoint reader_of(DiscoveredEndpoint endpoint) {
  endpoint.guid = "01100000000000000000000000000004";
  endpoint.writes = false;
  return endpoint;
}

auto one(const std::string& topic, const std::string& part) {
  return ElementsAre(
      AllOf(Field(&Finding::topic, topic), Field(&Finding::sentence, HasSubstr(part))));
}

TEST(DoctorFindings, name_a_writer_of_another_type_and_one_without_the_prefix_of_ros) {
  const std::vector<TopicSurvey> surveys{survey("imu/data")};
  EXPECT_THAT(wrong_types(surveys, {writer("rt/imu/data")}), IsEmpty());
  EXPECT_THAT(wrong_types(surveys, {writer("rt/imu/data", "std_msgs::msg::dds_::String_")}),
              one("imu/data", "as std_msgs/msg/String, sensor_msgs/msg/Imu is expected"));
  EXPECT_THAT(wrong_types(surveys, {writer("imu/data")}), one("imu/data", "'rt/imu/data'"));
  EXPECT_THAT(
      wrong_types(surveys, {reader_of(writer("rt/imu/data", "std_msgs::msg::dds_::String_"))}),
      IsEmpty());
}

TEST(DoctorFindings, name_the_topic_on_which_a_missing_input_may_be_written) {
  TopicSurvey imu = survey("imu/data");
  EXPECT_THAT(inputs_under_other_names({imu}, {writer("rt/xsens/imu")}),
              one("imu/data", "written on xsens/imu"));
  EXPECT_THAT(inputs_under_other_names({imu}, {reader_of(writer("rt/xsens/imu"))}), IsEmpty());
  EXPECT_THAT(inputs_under_other_names({imu, survey("yaw")}, {writer("rt/yaw")}), IsEmpty());
  imu.writers = {"a"};
  EXPECT_THAT(inputs_under_other_names({imu}, {writer("rt/xsens/imu")}), IsEmpty());
}

TEST(DoctorFindings, name_readers_that_ask_for_more_than_is_offered) {
  DiscoveredEndpoint offer = writer("rt/map");
  DiscoveredEndpoint wish = reader_of(offer);
  EXPECT_THAT(readers_in_vain({offer, wish}), IsEmpty());
  wish.durability = bus::Durability::kTransientLocal;
  EXPECT_THAT(readers_in_vain({offer, wish}), one("map", "set the reader to volatile"));
  offer.durability = bus::Durability::kTransientLocal;
  EXPECT_THAT(readers_in_vain({offer, wish}), IsEmpty());
  offer.reliability = bus::Reliability::kBestEffort;
  EXPECT_THAT(readers_in_vain({offer, wish}), one("map", "set the reader to best effort"));
  wish.dds_topic = "rt/other";
  EXPECT_THAT(readers_in_vain({offer, wish}), IsEmpty());
}

TEST(DoctorFindings, name_topics_with_several_writers_but_for_gps_filters) {
  TopicSurvey gate = survey("fusion/odometry");
  TopicSurvey filters = survey("gps/odometry");
  gate.writers = filters.writers = {"a"};
  EXPECT_THAT(several_writers({gate, filters}), IsEmpty());
  gate.silent_writers = filters.silent_writers = {"b"};
  EXPECT_THAT(several_writers({gate, filters}), one("fusion/odometry", "2 writers"));
  // One that was killed while doctor listened, and its successor, were never there together.
  gate.predecessors = {*gate.writers.begin()};
  EXPECT_THAT(several_writers({gate, filters}), IsEmpty());
}

TEST(DoctorFindings, tell_swapped_coordinates_and_another_site_by_the_datum) {
  const TopicSurvey datum = fixes_at("datum", 48.78, 9.18);
  EXPECT_THAT(swapped_positions({datum, fixes_at("gps/fix", 48.79, 9.17)}), IsEmpty());
  EXPECT_THAT(swapped_positions({datum, fixes_at("gps/fix", 9.17, 48.79)}),
              one("gps/fix", "are swapped"));
  // Stuttgart to Munich, 190 km, is one site for this purpose; to Berlin it is 511 km.
  EXPECT_THAT(swapped_positions({datum, fixes_at("gps/fix", 48.137, 11.575)}), IsEmpty());
  EXPECT_THAT(swapped_positions({datum, fixes_at("gps/fix", 52.52, 13.405)}),
              one("gps/fix", "another site"));
  EXPECT_THAT(swapped_positions({datum, fixes_at("gps/fix", 52.52, 13.405)}), one("gps/fix", "51"));
  EXPECT_THAT(swapped_positions({fixes_at("gps/fix", 9.17, 48.79)}), IsEmpty());
}

TEST(DoctorFindings, tell_low_rates_on_real_time_only) {
  TopicSurvey imu = survey("imu/data");
  imu.writers = {"a"};
  imu.messages = 101;
  imu.heard_s = 5.0;
  imu.rate_hz = 20.0;
  EXPECT_THAT(findings_of({imu}, {}, RobotConfig{}), one("imu/data", "20.0 Hz; at least 50.0"));
  TopicSurvey clock = survey("clock", "rosgraph_msgs/msg/Clock");
  clock.writers = {"b"};
  EXPECT_THAT(findings_of({imu, clock}, {}, RobotConfig{}), IsEmpty());
  imu.messages = 501;
  imu.rate_hz = 100.0;
  EXPECT_THAT(findings_of({imu}, {}, RobotConfig{}), IsEmpty());
}

TEST(DoctorFindings, call_no_input_slow_that_was_first_heard_a_moment_ago) {
  TopicSurvey fixes = survey("gps/fix", "sensor_msgs/msg/NavSatFix");
  fixes.writers = {"a"};
  fixes.messages = 1;
  fixes.heard_s = 1.9;
  EXPECT_THAT(findings_of({fixes}, {}, RobotConfig{}), IsEmpty());
  fixes.heard_s = 2.1;
  EXPECT_THAT(findings_of({fixes}, {}, RobotConfig{}), one("gps/fix", "0.0 Hz; at least 0.5"));
}

TEST(DoctorFindings, give_the_command_that_enlarges_socket_buffers) {
  EXPECT_THAT(buffer_advice(212'992, 4'194'304),
              AllOf(HasSubstr("212992"), HasSubstr("sysctl -w net.core.rmem_max=4194304")));
  EXPECT_EQ(buffer_advice(4'194'304, 4'194'304), "");
}

TEST(DoctorFindings, list_participants_with_vendor_and_topics) {
  EXPECT_THAT(who_is_there({writer("rt/b"), writer("rt/a"), reader_of(writer("rt/a"))}),
              ElementsAre("participant 010f00000000000000000000, Fast DDS; writes a, b",
                          "participant 011000000000000000000000, Cyclone DDS; reads a"));
}

}  // namespace
}  // namespace trigpoint::cli
