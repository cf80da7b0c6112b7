// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "silent_programs.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::cli {
namespace {

using recording::TopicSurvey;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

const RobotConfig kRobot;

/// GUIDs of writers of three programs.
const std::string kMapper = "010f00000000000000000001";
const std::string kFilter = "010f00000000000000000002";
const std::string kSensors = "010f00000000000000000003";

/// A topic whose writer, of a program, was last heard so long before the end.
TopicSurvey topic(const std::string& name,
                  const std::string& program,
                  double silent_s,
                  std::uint64_t messages = 10) {
  TopicSurvey survey;
  survey.topic.name = name;
  survey.messages = messages;
  survey.silent_s[program + "00000003"] = silent_s;
  (messages > 0 ? survey.writers : survey.silent_writers).insert(program + "00000003");
  return survey;
}

std::vector<TopicSurvey> with_sensors(std::vector<TopicSurvey> surveys) {
  for (const std::string& name : {kRobot.points_topic, kRobot.imu_topic, kRobot.fix_topic}) {
    surveys.push_back(topic(name, kSensors, 0.05));
  }
  return surveys;
}

std::vector<TopicSurvey> mapper(double silent_s, std::uint64_t messages = 0) {
  return {topic("lio/status", kMapper, silent_s, messages),
          topic("lio/odometry", kMapper, silent_s, messages),
          topic("diagnostics", kMapper, silent_s, messages)};
}

template <typename Matcher>
auto one(const std::string& about, const Matcher& sentence) {
  return ElementsAre(AllOf(Field(&Finding::topic, about), Field(&Finding::sentence, sentence)));
}

TEST(SilentPrograms, are_those_of_ours_that_miss_two_words) {
  EXPECT_THAT(silent_on_the_bus(with_sensors(mapper(0.9)), {}, kRobot), IsEmpty());
  EXPECT_THAT(
      silent_on_the_bus(with_sensors(mapper(4.6)), {}, kRobot),
      one("lio/status",
          AllOf(HasSubstr("participant " + kMapper +
                          " is there and has said nothing for 4.6 s "
                          "(on diagnostics, lio/odometry, lio/status), while points and imu/data "
                          "come"),
                HasSubstr("it looks for its place in the map"),
                HasSubstr("--seconds 25"))));
  EXPECT_THAT(silent_on_the_bus(mapper(4.6), {}, kRobot),
              one("lio/status", Not(HasSubstr("while"))));
}

TEST(SilentPrograms, are_told_with_how_their_process_stands) {
  std::vector<TopicSurvey> surveys = mapper(4.6, 7);
  for (TopicSurvey& survey : surveys) {
    survey.processes[kMapper + "00000003"] = 123;
  }
  const std::vector<LocalProcess> stopped{{123, "trigpoint_lio_mapper", 'T', 60.0, "7"}};
  EXPECT_THAT(
      silent_on_the_bus(surveys, stopped, kRobot),
      one("lio/status", AllOf(HasSubstr("stopped by a signal"), HasSubstr("kill -CONT 123"))));
  // The lease of one that is stopped runs out: then it is here and no longer on the bus.
  for (TopicSurvey& survey : surveys) {
    survey.silent_before_leaving_s[kMapper + "00000003"] = 2.0;
  }
  EXPECT_THAT(silent_on_the_bus(surveys, stopped, kRobot),
              one("lio/status", HasSubstr("kill -CONT 123")));
  EXPECT_THAT(silent_on_the_bus(surveys, {}, kRobot),
              one("lio/status",
                  HasSubstr("left the bus: it has ended and wrote for long what it had, or it was "
                            "killed")));
  // One that is ended says so at once.
  for (TopicSurvey& survey : surveys) {
    survey.silent_before_leaving_s[kMapper + "00000003"] = 0.6;
  }
  EXPECT_THAT(silent_on_the_bus(surveys, {}, kRobot), IsEmpty());
}

/// A robot's own drivers write `diagnostics` when they please.
TEST(SilentPrograms, are_not_those_of_others) {
  EXPECT_THAT(silent_on_the_bus(with_sensors({topic("diagnostics", kFilter, 5.0, 0)}), {}, kRobot),
              IsEmpty());
}

TEST(SilentPrograms, are_filters_too_that_publish_no_odometry_while_their_inputs_come) {
  const std::vector<TopicSurvey> alive{topic("gps/odometry", kFilter, 3.0, 0),
                                       topic("diagnostics", kFilter, 0.3)};
  EXPECT_THAT(silent_on_the_bus(alive, {}, kRobot), IsEmpty());
  EXPECT_THAT(
      silent_on_the_bus(with_sensors(alive), {}, kRobot),
      one("gps/odometry", HasSubstr("published none for 3.0 s, while imu/data and gps/fix come")));
  EXPECT_THAT(silent_on_the_bus(with_sensors({topic("gps/odometry", kFilter, 0.1)}), {}, kRobot),
              IsEmpty());
  const std::vector<TopicSurvey> hangs{topic("gps/odometry", kFilter, 3.0),
                                       topic("diagnostics", kFilter, 3.0)};
  EXPECT_THAT(silent_on_the_bus(with_sensors(hangs), {}, kRobot),
              one("gps/odometry", HasSubstr("said nothing for 3.0 s")));
}

TEST(SilentPrograms, are_those_that_run_here_for_this_domain_and_were_not_found) {
  const std::vector<TopicSurvey> nobody{topic("lio/status", kMapper, 0.1)};
  const LocalProcess process{123, "trigpoint_lio_mapper", 'S', 60.0, "7"};
  EXPECT_THAT(not_on_the_bus(nobody, {process}, 7, 5.0),
              one("trigpoint_lio_mapper",
                  AllOf(HasSubstr("process 123 runs here with ROS_DOMAIN_ID 7"),
                        HasSubstr("not found on the bus in 5.0 s: it is for another bus"))));
  LocalProcess stopped = process;
  stopped.state = 'T';
  EXPECT_THAT(not_on_the_bus(nobody, {stopped}, 7, 5.0),
              one("trigpoint_lio_mapper", HasSubstr("kill -CONT 123")));
  EXPECT_THAT(not_on_the_bus(nobody, {process}, 8, 5.0), IsEmpty());
  LocalProcess new_one = process;
  new_one.age_s = 4.0;
  EXPECT_THAT(not_on_the_bus(nobody, {new_one}, 7, 5.0), IsEmpty());
  LocalProcess unset = process;
  unset.domain = "";
  EXPECT_THAT(not_on_the_bus(nobody, {unset}, 0, 5.0),
              one("trigpoint_lio_mapper", HasSubstr("runs here without ROS_DOMAIN_ID")));
  LocalProcess written_otherwise = process;
  written_otherwise.domain = "07";
  EXPECT_THAT(not_on_the_bus(nobody, {written_otherwise}, 7, 5.0), SizeIs(1));
  LocalProcess no_number = process;
  no_number.domain = "7a";
  EXPECT_THAT(not_on_the_bus(nobody, {no_number}, 7, 5.0), IsEmpty());
  LocalProcess of_another_user = process;
  of_another_user.domain.reset();
  EXPECT_THAT(not_on_the_bus(nobody, {of_another_user}, 7, 5.0), IsEmpty());
  std::vector<TopicSurvey> found = nobody;
  found[0].processes[kMapper + "00000003"] = 123;
  EXPECT_THAT(not_on_the_bus(found, {process}, 7, 5.0), IsEmpty());
}

/// Its YAML may have another domain, or it is in a container: it may be well.
TEST(SilentPrograms, that_were_not_found_are_wrong_only_where_they_are_stopped) {
  const LocalProcess runs{123, "trigpoint_lio_mapper", 'S', 60.0, ""};
  EXPECT_THAT(not_on_the_bus({}, {runs}, 0, 5.0), ElementsAre(Field(&Finding::is_wrong, false)));
  LocalProcess stopped = runs;
  for (const char state : {'T', 't'}) {
    stopped.state = state;
    EXPECT_THAT(not_on_the_bus({}, {stopped}, 0, 5.0),
                ElementsAre(Field(&Finding::is_wrong, true)));
  }
}

TEST(SilentPrograms, that_were_not_found_are_told_what_their_process_waits_for) {
  LocalProcess process{123, "trigpoint_lio_mapper", 't', 60.0, ""};
  EXPECT_THAT(not_on_the_bus({}, {process}, 0, 5.0),
              one("trigpoint_lio_mapper",
                  AllOf(HasSubstr("a debugger holds it"), Not(HasSubstr("kill -CONT")))));
  process.state = 'D';
  EXPECT_THAT(not_on_the_bus({}, {process}, 0, 5.0),
              one("trigpoint_lio_mapper",
                  AllOf(HasSubstr("it waits for its disk"), Not(HasSubstr("another bus")))));
  EXPECT_THAT(not_on_the_bus({}, {process}, 0, 5.0), ElementsAre(Field(&Finding::is_wrong, false)));
}

TEST(MapperWithoutTrack, is_told_with_what_it_does) {
  std::vector<TopicSurvey> surveys = with_sensors(mapper(0.2, 9));
  TopicSurvey& told = surveys.front();
  told.last_lio_status.emplace();
  told.last_lio_status->health = LioHealth::kLost;
  told.last_lio_status->scans_received = 120;
  told.last_lio_status->scans_used = 98;
  told.last_lio_status->scans_refused = {{"too_few_matches", 22}};
  told.without_track_s = 1.5;
  EXPECT_THAT(mapper_without_track(surveys, kRobot), IsEmpty());
  told.without_track_s = 4.7;
  EXPECT_THAT(
      mapper_without_track(surveys, kRobot),
      one("lio/status",
          AllOf(HasSubstr("no track for 4.7 s, while points and imu/data come"),
                HasSubstr("LOST: it is looking for its place in its map (120 clouds received so "
                          "far, 98 used; refused: too_few_matches 22)"))));
  told.last_lio_status->health = LioHealth::kInit;
  EXPECT_THAT(mapper_without_track(surveys, kRobot),
              one("lio/status", HasSubstr("in the map of the session that it goes on with")));
  told.last_lio_status->scans_used = 0;
  EXPECT_THAT(mapper_without_track(surveys, kRobot),
              one("lio/status", HasSubstr("INIT: it has not begun")));
  EXPECT_THAT(mapper_without_track(mapper(0.2, 9), kRobot), IsEmpty());
}

}  // namespace
}  // namespace trigpoint::cli
