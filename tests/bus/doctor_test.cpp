// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// `trigpoint doctor` on a live bus on which much is wrong, and on one on which nothing is.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/cdr.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "bus_fixture.hpp"
#include "bus_survey.hpp"
#include "wait_until.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <thread>

namespace trigpoint::bus {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// Publishes at 100 Hz on a thread of its own until it is destroyed.
class Publishing {
 public:
  explicit Publishing(std::function<void(Nanoseconds)> publish)
      : thread_([this, publish = std::move(publish)] {
          for (Nanoseconds now_ns = 1'700'000'000'000'000'000; !ended_; now_ns += 10'000'000) {
            publish(now_ns);
            std::this_thread::sleep_for(10ms);
          }
        }) {}

  ~Publishing() {
    ended_ = true;
    thread_.join();
  }

  Publishing(const Publishing&) = delete;
  Publishing& operator=(const Publishing&) = delete;

 private:
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

tests::CommandResult doctor(const Config& config, const std::string& seconds = "3") {
  return tests::run_command(
      {std::string(TRIGPOINT_BIN_DIR) + "/trigpoint", "doctor", "--seconds", seconds},
      60s,
      {{"ROS_DOMAIN_ID", std::to_string(config.domain_id)}});
}

ImuSample imu_at_rest(Nanoseconds now_ns, double gravity, double turning) {
  ImuSample imu;
  imu.stamp_ns = now_ns;
  imu.frame_id = "imu_link";
  imu.accel_mps2 = {0.0, 0.0, gravity};
  imu.gyro_radps = {0.0, 0.0, turning};
  return imu;
}

GnssFix fix_at(Nanoseconds now_ns, double latitude_deg, double longitude_deg) {
  GnssFix fix;
  fix.stamp_ns = now_ns;
  fix.frame_id = "gps";
  fix.status = FixStatus::kFix;
  fix.latitude_deg = latitude_deg;
  fix.longitude_deg = longitude_deg;
  fix.altitude_m = 300.0;
  fix.covariance_enu_m2.setIdentity();
  fix.covariance_type = CovarianceType::kKnown;
  return fix;
}

TEST(Doctor, names_what_is_wrong_on_a_live_bus_and_says_what_to_do) {
  Config config = testing::own_domain();
  config.network_interface.clear();
  Participant others(config, "others");
  Topic<sensor_msgs::msg::Imu> best_effort = topics::imu;
  best_effort.qos.reliability = Reliability::kBestEffort;
  Publisher imu(others, best_effort);
  Publisher fixes(others, topics::fix);
  Publisher datum(others, topics::datum);
  const Publisher clouds(others, topics::points.renamed("velodyne_points"));
  const Publisher wrong_type(others, Topic<nav_msgs::msg::Odometry>{"fusion/status"});
  Publisher odometry(others, topics::fusion_odometry);
  Topic<nav_msgs::msg::Odometry> latched = topics::fusion_odometry;
  latched.qos.durability = Durability::kTransientLocal;
  const Subscription<nav_msgs::msg::Odometry> in_vain(
      others, latched, [](const nav_msgs::msg::Odometry&, const MessageInfo&) {});
  datum.publish(to_message(Datum{48.78, 9.18, 300.0, 1}));
  const Publishing publishing([&](Nanoseconds now_ns) {
    imu.publish(to_message(imu_at_rest(now_ns, 1.0, 40.0)));
    fixes.publish(to_message(fix_at(now_ns, 9.18, 48.78)));
    Odometry pose;
    pose.stamp_ns = now_ns;
    pose.frame_id = "/odom";
    pose.child_frame_id = "base_link";
    odometry.publish(to_message(pose));
  });
  const auto result = doctor(config);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(
      result.output,
      AllOf(HasSubstr("! imu/data: acceleration has a mean of 1: it is in g"),
            HasSubstr("! imu/data: angular rate peaks at 40: is it in degrees per second?"),
            HasSubstr("! imu/data: a writer offers less than we ask for (RELIABILITY)"),
            HasSubstr("! gps/fix: 5"),
            HasSubstr("latitude and longitude are swapped"),
            HasSubstr("! points: nobody writes it, but its type is written on velodyne_points"),
            HasSubstr("as nav_msgs/msg/Odometry, trigpoint_msgs/msg/FusionStatus is expected")));
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("! fusion/odometry: frame_id '/odom' begins with a slash"),
                    HasSubstr("! fusion/odometry: frame_id is '/odom', expected is 'map'"),
                    HasSubstr("set the reader to volatile"),
                    HasSubstr("on the bus:"),
                    HasSubstr("; writes datum, fusion/odometry, fusion/status, gps/fix, imu/data, "
                              "velodyne_points; reads fusion/odometry")));
}

TEST(Doctor, finds_nothing_wrong_where_nothing_is) {
  Config config = testing::own_domain();
  config.network_interface.clear();
  Participant others(config, "others");
  Publisher imu(others, topics::imu);
  Publisher fixes(others, topics::fix);
  Publisher datum(others, topics::datum);
  datum.publish(to_message(Datum{48.78, 9.18, 300.0, 1}));
  const Publishing publishing([&](Nanoseconds now_ns) {
    imu.publish(to_message(imu_at_rest(now_ns, 9.81, 0.5)));
    fixes.publish(to_message(fix_at(now_ns, 48.78, 9.18)));
  });
  const auto result = doctor(config);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("writes datum, gps/fix, imu/data"),
                    Not(HasSubstr("! imu")),
                    Not(HasSubstr("trigpoint (process"))));
}

TEST(Doctor, takes_two_gps_filters_of_which_one_lags_for_no_fault) {
  Config config = testing::own_domain();
  config.network_interface.clear();
  Participant first(config, "first");
  Participant second(config, "second");
  Publisher one(first, topics::gps_odometry);
  Publisher other(second, topics::gps_odometry);
  const Publishing publishing([&](Nanoseconds now_ns) {
    Odometry odometry;
    odometry.stamp_ns = now_ns;
    odometry.frame_id = "map";
    odometry.child_frame_id = "base_link";
    odometry.pose_covariance = PoseCovariance::Identity() * 0.01;
    one.publish(to_message(odometry));
    odometry.stamp_ns = now_ns - 50'000'000;
    other.publish(to_message(odometry));
  });
  const auto result = doctor(config);
  EXPECT_THAT(result.output, AllOf(HasSubstr("writes gps/odometry"), Not(HasSubstr("goes back"))));
}

/// The rate is the sensor's, not that of a window in which nobody was heard for half of the time.
TEST(BusSurvey, measures_the_rate_since_the_first_message) {
  constexpr double kSurvey_s = 5.0;
  constexpr auto kSilent = 2500ms;
  constexpr double kAtLeast = 0.75;  // of the rate of publishing; over the whole window it is 0.5
  Config config = testing::own_domain();
  Participant others(config, "others");
  recording::SurveyOptions options;
  options.bus = config;
  options.topics = {
      {std::string(topics::imu.name), ros_type_name<ImuSample>(), topics::imu.qos, true}};
  options.duration_s = kSurvey_s;
  std::vector<recording::TopicSurvey> surveys;
  std::thread listening([&] { surveys = recording::survey_bus(options); });
  const bool listens = tests::wait_until(
      [&] {
        const auto there = others.discovered();
        return std::any_of(there.begin(), there.end(), [](const DiscoveredEndpoint& endpoint) {
          return !endpoint.writes && endpoint.dds_topic == "rt/imu/data";
        });
      },
      testing::kForever);
  std::this_thread::sleep_for(kSilent);
  std::atomic<int> published{0};
  const auto began = std::chrono::steady_clock::now();
  std::chrono::duration<double> spoken{};
  {
    Publisher imu(others, topics::imu);
    const Publishing publishing([&](Nanoseconds now_ns) {
      imu.publish(to_message(imu_at_rest(now_ns, 9.81, 0.5)));
      ++published;
    });
    listening.join();
    spoken = std::chrono::steady_clock::now() - began;
  }
  ASSERT_TRUE(listens);
  ASSERT_EQ(surveys.size(), 1U);
  ASSERT_GT(surveys.front().messages, 1U);
  EXPECT_GT(surveys.front().rate_hz, kAtLeast * published / spoken.count());
}

TEST(BusSurvey, tells_a_successor_from_a_second_writer) {
  const Config config = testing::own_domain();
  recording::SurveyOptions options;
  options.bus = config;
  options.topics = {
      {std::string(topics::imu.name), ros_type_name<ImuSample>(), topics::imu.qos, true}};
  Participant others(config, "others");
  const auto speak = [](Publisher<sensor_msgs::msg::Imu>& imu, Nanoseconds now_ns) {
    imu.publish(to_message(imu_at_rest(now_ns, 9.81, 0.5)));
  };
  {
    Publisher one(others, topics::imu);
    Publisher two(others, topics::imu);
    const Publishing both([&](Nanoseconds now_ns) {
      speak(one, now_ns);
      speak(two, now_ns);
    });
    const auto together = recording::survey_bus(options).front();
    EXPECT_EQ(together.writers.size(), 2U);
    EXPECT_TRUE(together.predecessors.empty());
  }
  options.duration_s = 8.0;
  std::vector<recording::TopicSurvey> surveys;
  std::thread listening([&] { surveys = recording::survey_bus(options); });
  const auto speak_for = [&](auto until) {
    Publisher imu(others, topics::imu);
    const Publishing publishing([&](Nanoseconds now_ns) { speak(imu, now_ns); });
    until();
  };
  speak_for([] { std::this_thread::sleep_for(4s); });
  speak_for([&] { listening.join(); });
  EXPECT_EQ(surveys.front().writers.size(), 2U);
  EXPECT_EQ(surveys.front().predecessors.size(), 1U);
}

// ---- programs that say nothing ------------------------------------------------------------------

/// As a mapper that is busy with one long piece of work: found, and silent on all its topics.
TEST(Doctor, names_a_mapper_that_is_there_and_says_nothing_while_its_inputs_come) {
  Config config = testing::own_domain();
  config.network_interface.clear();
  Participant sensors(config, "sensors");
  Publisher imu(sensors, topics::imu);
  Publisher clouds(sensors, topics::points);
  Participant mapper(config, "mapper");
  const Publisher odometry(mapper, topics::lio_odometry);
  const Publisher word(mapper, topics::diagnostics);
  Publisher status(mapper, topics::lio_status);
  std::atomic<bool> tells{false};
  const Publishing publishing([&](Nanoseconds now_ns) {
    imu.publish(to_message(imu_at_rest(now_ns, 9.81, 0.5)));
    clouds.publish(to_message(to_cloud_message({{5.0F, 0.0F, 0.0F, 1.0F}}, now_ns, "lidar")));
    if (tells) {
      LioStatus lost;
      lost.health = LioHealth::kLost;
      status.publish(to_message(lost));
    }
  });
  const auto silent = doctor(config, "5");
  EXPECT_EQ(silent.exit_code, 1);
  EXPECT_THAT(silent.output,
              AllOf(HasSubstr("! lio/status: "),
                    HasSubstr("is there and has said nothing for "),
                    HasSubstr("(on diagnostics, lio/odometry, lio/status), while points and "
                              "imu/data come: it looks for its place in the map")));
  tells = true;
  const auto lost = doctor(config, "5");
  EXPECT_EQ(lost.exit_code, 1);
  EXPECT_THAT(lost.output,
              AllOf(Not(HasSubstr("has said nothing")),
                    HasSubstr("has told of no track for "),
                    HasSubstr("LOST: it is looking for its place in its map")));
}

bool is_ready(const tests::Command& program) {
  return tests::wait_until(
      [&] { return program.output_so_far().find("ready") != std::string::npos; },
      testing::kForever);
}

tests::CommandResult health_of(const std::string& program,
                               const std::string& domain,
                               const std::string& seconds = "4") {
  return tests::run_command({std::string(TRIGPOINT_BIN_DIR) + "/trigpoint",
                             "doctor",
                             "--alive",
                             program,
                             "--seconds",
                             seconds},
                            60s,
                            {{"ROS_DOMAIN_ID", domain}});
}

constexpr const char* kLong = "30";  // enough on any machine; they end as soon as they know

/// Of a doctor that listens for `whole`, while the gate is stopped after `lives`.
tests::CommandResult doctor_while_stopped(const tests::Command& gate,
                                          const std::string& domain,
                                          std::chrono::seconds lives,
                                          std::chrono::seconds whole) {
  tests::Command listening({std::string(TRIGPOINT_BIN_DIR) + "/trigpoint",
                            "doctor",
                            "--seconds",
                            std::to_string(whole.count())},
                           {{"ROS_DOMAIN_ID", domain}});
  std::this_thread::sleep_for(lives);
  gate.signal(SIGSTOP);
  return listening.wait(whole + 60s);
}

TEST(Doctor, names_a_program_that_is_stopped_before_or_while_it_listens) {
  const std::string domain = tests::own_domain();
  const std::string program = "trigpoint_fusion_gate";
  const tests::Command gate({std::string(TRIGPOINT_BIN_DIR) + "/" + program},
                            {{"ROS_DOMAIN_ID", domain}});
  ASSERT_TRUE(is_ready(gate));
  const std::string process = std::to_string(gate.pid());
  tests::CommandResult meanwhile;
  // Nobody outside knows when the doctor has found it: where it was stopped before, it lives for
  // longer the next time.
  for (const auto lives : {3s, 8s, 20s}) {
    gate.signal(SIGCONT);
    const auto heard = health_of(program, domain, kLong);
    ASSERT_EQ(heard.exit_code, 0) << heard.output;
    meanwhile = doctor_while_stopped(gate, domain, lives, lives + 4s);
    if (meanwhile.output.find("was not found on the bus") == std::string::npos) {
      break;
    }
  }
  EXPECT_EQ(meanwhile.exit_code, 1);
  EXPECT_THAT(meanwhile.output,
              AllOf(HasSubstr("! fusion/status: trigpoint_fusion_gate (process " + process +
                              ") is there and has said nothing for "),
                    HasSubstr("it is stopped by a signal"),
                    HasSubstr("kill -CONT " + process)));
  Config config;
  config.domain_id = std::stoi(domain);
  const auto before = doctor(config);
  EXPECT_EQ(before.exit_code, 1);
  EXPECT_THAT(before.output,
              AllOf(HasSubstr("! trigpoint_fusion_gate: process " + process +
                              " runs here with ROS_DOMAIN_ID " + domain +
                              " and was not found on the bus in 3.0 s"),
                    HasSubstr("kill -CONT " + process)));
  gate.signal(SIGCONT);
  const auto heard = health_of(program, domain, kLong);
  ASSERT_EQ(heard.exit_code, 0) << heard.output;
  const auto goes_on = doctor(config, "6");
  EXPECT_EQ(goes_on.exit_code, 0) << goes_on.output;
}

// ---- health checks ------------------------------------------------------------------------------

TEST(Doctor, tells_a_program_that_hangs_or_is_deaf_from_one_that_lives) {
  const std::string program = "trigpoint_fusion_gate";
  const std::string domain = tests::own_domain();
  const tests::Command gate({std::string(TRIGPOINT_BIN_DIR) + "/" + program},
                            {{"ROS_DOMAIN_ID", domain}});
  ASSERT_TRUE(is_ready(gate));
  const auto lives = health_of(program, domain, kLong);
  EXPECT_EQ(lives.exit_code, 0) << lives.output;
  EXPECT_THAT(lives.output,
              HasSubstr(std::to_string(gate.pid()) + ") was heard on DDS domain " + domain));

  const auto elsewhere = health_of(program, tests::own_domain(1));
  EXPECT_EQ(elsewhere.exit_code, 1);
  EXPECT_THAT(elsewhere.output, HasSubstr("runs, but said nothing on DDS domain"));

  gate.signal(SIGSTOP);
  const auto hangs = health_of(program, domain);
  gate.signal(SIGCONT);
  EXPECT_EQ(hangs.exit_code, 1);
  EXPECT_THAT(hangs.output, HasSubstr("runs, but said nothing on DDS domain " + domain));

  const auto absent = health_of("trigpoint_no_such_program", domain);
  EXPECT_EQ(absent.exit_code, 1);
  EXPECT_THAT(absent.output, HasSubstr("no trigpoint_no_such_program runs here"));
}

}  // namespace
}  // namespace trigpoint::bus
