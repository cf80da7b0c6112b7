// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Processes beside each other: two of a kind, of different users, two GPS filters, a datum that
// must outlive each of them.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/participant_of.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/evaluation/continuity.hpp"
#include "trigpoint/export/session.hpp"

#include "run_command.hpp"
#include "wait_until.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <thread>

namespace trigpoint {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::Command;
using tests::CommandResult;
using tests::TemporaryFolder;
using Clock = std::chrono::steady_clock;
namespace topics = bus::topics;

std::string program(const std::string& name) {
  return std::string(TRIGPOINT_BIN_DIR) + "/" + name;
}

void take_domain(int offset) {
  setenv("ROS_DOMAIN_ID", tests::own_domain(offset).c_str(), 1);
}

template <typename Condition>
bool wait_until(Condition condition, std::chrono::seconds limit = 20s) {
  return tests::wait_until(condition, limit);
}

bool says(const Command& command, const std::string& text) {
  return command.output_so_far().find(text) != std::string::npos;
}

// ---- two of a kind ------------------------------------------------------------------------------

class TwoOf : public ::testing::TestWithParam<const char*> {};

TEST_P(TwoOf, a_kind_say_so_and_the_later_one_ends_with_code_2) {
  take_domain(110);
  const std::string name = std::string("trigpoint_") + GetParam();
  Command first({program(name)});
  ASSERT_TRUE(wait_until([&] { return says(first, "ready"); })) << first.output_so_far();
  std::this_thread::sleep_for(1s);
  Command second({program(name)});
  const CommandResult ended = second.wait(20s);
  EXPECT_EQ(ended.exit_code, 2) << ended.output;
  EXPECT_THAT(ended.output,
              AllOf(HasSubstr(std::string("another ") + GetParam()),
                    HasSubstr("process " + std::to_string(first.pid())),
                    HasSubstr("ROS_DOMAIN_ID")));
  EXPECT_TRUE(wait_until([&] { return says(first, "it should end itself"); }, 5s));
  EXPECT_TRUE(first.running());
  EXPECT_THAT(first.output_so_far(), Not(HasSubstr("was first")));
}

/// What one of them says of itself, once it has been running for a while.
class Claims {
 public:
  Claims(bus::Participant& participant, const std::string& role)
      : words_(
            participant,
            topics::diagnostics,
            [this, role](const diagnostic_msgs::msg::DiagnosticArray& m, const bus::MessageInfo&) {
              const auto lines = bus::from_message(m);
              const bool is_claim = lines.size() == 1 && lines[0].name == role + ": only one";
              const std::scoped_lock lock(mutex_);
              if (is_claim && std::stod(lines[0].values.at(0).second) > kLongerThanItsPlay_s) {
                recorded_ = m;
              }
            }) {}

  std::optional<diagnostic_msgs::msg::DiagnosticArray> recorded() {
    const std::scoped_lock lock(mutex_);
    return recorded_;
  }

 private:
  static constexpr double kLongerThanItsPlay_s = 4.0;
  std::mutex mutex_;
  std::optional<diagnostic_msgs::msg::DiagnosticArray> recorded_;
  bus::Subscription<diagnostic_msgs::msg::DiagnosticArray> words_;
};

TEST_P(TwoOf, a_kind_are_not_taken_from_a_recording_that_is_played) {
  take_domain(116);
  const std::string name = std::string("trigpoint_") + GetParam();
  bus::Participant recorder(bus::Config{}, "recorder");
  Claims claims(recorder, GetParam());
  {
    Command recorded({program(name)});
    ASSERT_TRUE(wait_until([&] { return claims.recorded().has_value(); }))
        << recorded.output_so_far();
    recorded.signal(SIGKILL);
    recorded.wait(5s);
  }
  // As a player has them that plays all topics of a recording.
  bus::Participant player(bus::Config{}, "player");
  const bus::Publisher mapper_status(player, topics::lio_status);
  const bus::Publisher gate_status(player, topics::fusion_status);
  bus::Publisher words(player, topics::diagnostics);
  Command live({program(name)});
  ASSERT_TRUE(wait_until([&] { return says(live, "ready"); })) << live.output_so_far();
  EXPECT_TRUE(wait_until([&] {
    words.publish(*claims.recorded());
    return says(live, "is not counted") || !live.running();
  })) << live.output_so_far();
  EXPECT_TRUE(live.running()) << live.output_so_far();
  EXPECT_THAT(live.output_so_far(), Not(HasSubstr("was first")));
}

INSTANTIATE_TEST_SUITE_P(Bus,
                         TwoOf,
                         ::testing::Values("lio_mapper", "fusion_gate"),
                         [](const auto& parameter) { return std::string(parameter.param); });

TEST(TwoOf, a_kind_stay_where_the_first_has_died) {
  take_domain(111);
  Command first({program("trigpoint_fusion_gate")});
  ASSERT_TRUE(wait_until([&] { return says(first, "ready"); }));
  first.signal(SIGKILL);
  first.wait(5s);
  Command second({program("trigpoint_fusion_gate")});
  std::this_thread::sleep_for(3s);
  EXPECT_TRUE(second.running()) << second.output_so_far();
}

// ---- clocks of other computers ------------------------------------------------------------------

TEST(ClockWatch, refuses_names_and_times_that_no_computer_has_and_goes_on) {
  take_domain(119);
  const TemporaryFolder folder;
  bus::Participant participant(bus::Config{}, "clock_test");
  bus::Publisher answers(participant, topics::clock_probe);
  const auto answer = [&](const std::string& to,
                          const std::string& computer,
                          const std::string& asked_ns,
                          const std::string& there_ns) {
    const bus::Diagnostic line{
        bus::DiagnosticLevel::kOk,
        "clock: answer",
        computer,
        to,
        {{"asked_ns", asked_ns}, {"heard_there_ns", there_ns}, {"answered_there_ns", there_ns}}};
    answers.publish(bus::to_message(0, {&line, 1}));
  };
  const bus::Subscription<diagnostic_msgs::msg::DiagnosticArray> questions(
      participant,
      topics::clock_probe,
      [&](const diagnostic_msgs::msg::DiagnosticArray& m, const bus::MessageInfo& info) {
        const auto lines = bus::from_message(m);
        if (lines.size() != 1 || lines[0].name != "clock: question") {
          return;
        }
        const std::string& now_ns = lines[0].values.at(0).second;
        answer(info.writer_guid, "evil\n0,evil", now_ns, now_ns);
        answer(info.writer_guid, std::string(65, 'e') + "vil", now_ns, now_ns);
        answer(info.writer_guid, "evil-late", now_ns, "9223372036854775807");
        answer(info.writer_guid, "evil-huge", now_ns, "92233720368547758070");
        answer(info.writer_guid, "good", now_ns, now_ns);
      });
  Command watch({program("trigpoint_clock_watch"), "--session", folder.path()});
  const auto file = [&] {
    return std::filesystem::exists(folder.path("clock.csv"))
               ? tests::read_file(folder.path("clock.csv"))
               : std::string();
  };
  EXPECT_TRUE(wait_until([&] { return file().find(",good,") != std::string::npos; }))
      << watch.output_so_far();
  EXPECT_THAT(file(), Not(HasSubstr("evil")));
  EXPECT_TRUE(says(watch, "1 to 64 of A-Z a-z 0-9 . - _ are expected")) << watch.output_so_far();
  EXPECT_TRUE(watch.running());
}

// ---- users --------------------------------------------------------------------------------------

TEST(Users, that_differ_find_each_other_on_the_bus_in_both_directions) {
  if (geteuid() != 0) {
    GTEST_SKIP() << "not root: no process of another user can be started";
  }
  const std::vector<std::string> as_nobody{
      "setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"};
  std::vector<std::string> probe = as_nobody;
  probe.insert(probe.end(), {program("trigpoint_lio_mapper"), "--help"});
  if (tests::run_command(probe).exit_code != 0) {
    GTEST_SKIP() << "the build folder cannot be read by another user, or setpriv is missing";
  }
  take_domain(112);
  std::vector<std::string> command = as_nobody;
  command.push_back(program("trigpoint_lio_mapper"));
  const Command mapper(command);
  bus::Participant participant(bus::Config{}, "users_test");
  bus::Publisher imu(participant, topics::imu);
  std::mutex mutex;
  std::uint64_t received = 0;
  const bus::Subscription<trigpoint_msgs::msg::LioStatus> statuses(
      participant,
      topics::lio_status,
      [&](const trigpoint_msgs::msg::LioStatus& m, const bus::MessageInfo&) {
        const std::scoped_lock lock(mutex);
        received = std::max(received, bus::from_message(m).imu_received);
      });
  ImuSample sample;
  sample.frame_id = "base_link";
  sample.accel_mps2 = {0.0, 0.0, 9.81};
  EXPECT_TRUE(wait_until([&] {
    sample.stamp_ns += 10'000'000;
    imu.publish(bus::to_message(sample));
    const std::scoped_lock lock(mutex);
    return received > 100;
  })) << mapper.output_so_far();
}

// ---- the datum ----------------------------------------------------------------------------------

/// Hears, as somebody who has just come, what datum is on the bus.
std::string datum_on_the_bus() {
  bus::Participant participant(bus::Config{}, "datum_test");
  std::mutex mutex;
  std::string heard;
  const bus::Subscription<sensor_msgs::msg::NavSatFix> datums(
      participant,
      topics::datum,
      [&](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo&) {
        const std::scoped_lock lock(mutex);
        heard = bus::datum_from_message(m).id();
      });
  wait_until(
      [&] {
        const std::scoped_lock lock(mutex);
        return !heard.empty();
      },
      5s);
  const std::scoped_lock lock(mutex);
  return heard;
}

class DatumTest : public ::testing::Test {
 protected:
  void SetUp() override {
    tests::write_file(folder_.path("datum.yaml"),
                      "gps_odometry:\n  use_configured_datum: true\n  datum_latitude_deg: 49.0\n"
                      "  datum_longitude_deg: 8.0\n  datum_height_m: 110.0\n");
    std::filesystem::create_directory(folder_.path("session"));
  }

  TemporaryFolder folder_;
};

TEST_F(DatumTest, outlives_the_filter_and_then_the_gate) {
  take_domain(113);
  const std::vector<std::string> gate_command{program("trigpoint_fusion_gate")};
  Command gate(gate_command);
  Command filter({program("trigpoint_gps_eskf18"), "--config", folder_.path("datum.yaml")});
  ASSERT_TRUE(wait_until([&] { return says(gate, "info datum "); })) << filter.output_so_far();
  const std::string datum = datum_on_the_bus();
  ASSERT_FALSE(datum.empty());
  filter.signal(SIGKILL);
  filter.wait(5s);
  EXPECT_EQ(datum_on_the_bus(), datum);
  Command other({program("trigpoint_gps_ekf15")});  // knows nothing of its own
  ASSERT_TRUE(wait_until([&] { return says(other, "info datum "); })) << other.output_so_far();
  gate.signal(SIGKILL);
  gate.wait(5s);
  EXPECT_EQ(datum_on_the_bus(), datum);
}

TEST_F(DatumTest, outlives_all_of_them_in_the_session) {
  take_domain(114);
  const std::string session = folder_.path("session");
  std::string datum;
  {
    Command filter({program("trigpoint_gps_eskf18"),
                    "--config",
                    folder_.path("datum.yaml"),
                    "--session",
                    session});
    datum = datum_on_the_bus();
    ASSERT_FALSE(datum.empty()) << filter.output_so_far();
    filter.signal(SIGKILL);
    filter.wait(5s);
  }
  for (const char* name : {"trigpoint_gps_eskf18", "trigpoint_fusion_gate"}) {
    Command next({program(name), "--session", session});
    EXPECT_EQ(datum_on_the_bus(), datum) << name << ": " << next.output_so_far();
    next.signal(SIGKILL);
    next.wait(5s);
    std::this_thread::sleep_for(100ms);
  }
}

// ---- the hot standby ----------------------------------------------------------------------------

constexpr double kHandOver_s = 0.5;  // issue
constexpr double kNoStep_m = 0.05;   // issue 5's bound of a step
constexpr double kDrive_s = 32.0;
constexpr double kDies_s = 14.0;
constexpr double kHangs_s = 24.0;

/// Which filter the gate follows, and when it changed.
class Watch {
 public:
  Watch()
      : participant_(bus::Config{}, "standby_test"),
        selected_(participant_,
                  topics::gps_selected,
                  [this](const nav_msgs::msg::Odometry& m, const bus::MessageInfo&) {
                    const std::scoped_lock lock(mutex_);
                    selected_stamps_ns_.push_back(bus::from_message(m).stamp_ns);
                    selected_at_.push_back(Clock::now());
                  }),
        filters_(participant_,
                 topics::gps_odometry,
                 [this](const nav_msgs::msg::Odometry&, const bus::MessageInfo& info) {
                   const std::scoped_lock lock(mutex_);
                   writers_[bus::participant_of(info.writer_guid)] = info.writer_guid;
                 }),
        status_(participant_,
                topics::fusion_status,
                [this](const trigpoint_msgs::msg::FusionStatus& m, const bus::MessageInfo&) {
                  const std::scoped_lock lock(mutex_);
                  const FusionStatus status = bus::from_message(m);
                  if (status.gps_source != followed_) {
                    followed_ = status.gps_source;
                    changed_at_ = Clock::now();
                  }
                }) {}

  bool begun() {
    const std::scoped_lock lock(mutex_);
    return !selected_at_.empty() && writers_.size() >= 2;
  }

  /// The number of the process that is followed; 0 when it is not known.
  pid_t followed_process() {
    const std::scoped_lock lock(mutex_);
    const auto writer = writers_.find(followed_);
    if (writer == writers_.end()) {
      return 0;
    }
    return static_cast<pid_t>(participant_.process_of(writer->second).value_or(0));
  }

  std::string followed() {
    const std::scoped_lock lock(mutex_);
    return followed_;
  }

  /// s from `since` until the gate said that it follows another one than `before`.
  double changed_after_s(const std::string& before, Clock::time_point since) {
    wait_until([&] { return followed() != before && !followed().empty(); }, 5s);
    const std::scoped_lock lock(mutex_);
    return followed_ == before ? 1e9 : std::chrono::duration<double>(changed_at_ - since).count();
  }

 private:
  std::mutex mutex_;
  std::map<std::string, std::string> writers_;
  std::vector<Nanoseconds> selected_stamps_ns_;
  std::vector<Clock::time_point> selected_at_;
  std::string followed_;
  Clock::time_point changed_at_;
  bus::Participant participant_;
  bus::Subscription<nav_msgs::msg::Odometry> selected_;
  bus::Subscription<nav_msgs::msg::Odometry> filters_;
  bus::Subscription<trigpoint_msgs::msg::FusionStatus> status_;
};

TEST(HotStandby, takes_over_within_half_a_second_from_a_filter_that_dies_or_hangs_without_a_step) {
  take_domain(115);
  const TemporaryFolder folder;
  const std::string session = folder.path("session");
  Watch watch;
  Command job({std::string(TRIGPOINT_SOURCE_DIR) + "/bringup/run",
               "campus",
               "--no-build",
               "--rate",
               "1",
               "--duration",
               std::to_string(kDrive_s),
               "--standby",
               "ekf15",
               "--out",
               session},
              {{"TRIGPOINT_BIN", TRIGPOINT_BIN_DIR}});
  ASSERT_TRUE(wait_until([&] { return watch.begun(); }, 60s)) << job.output_so_far();
  const Clock::time_point began = Clock::now();
  for (const auto& [at_s, signal] : {std::pair{kDies_s, SIGKILL}, std::pair{kHangs_s, SIGSTOP}}) {
    std::this_thread::sleep_until(began + std::chrono::milliseconds(static_cast<int>(1e3 * at_s)));
    const std::string before = watch.followed();
    const pid_t process = watch.followed_process();
    ASSERT_GT(process, 1) << job.output_so_far();
    const Clock::time_point since = Clock::now();
    kill(process, signal);
    const double after_s = watch.changed_after_s(before, since);
    std::printf("%s: handed over after %.2f s\n", signal == SIGKILL ? "dies" : "hangs", after_s);
    EXPECT_LT(after_s, kHandOver_s);
  }
  const CommandResult ended = job.wait(120s);
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  const evaluation::Step step =
      evaluation::largest_step(exporter::read_trajectory(session + "/fused.tum"),
                               exporter::read_trajectory(session + "/lio.tum"));
  std::printf("largest step of fusion/odometry: %.3f m\n", step.distance_m);
  EXPECT_LT(step.distance_m, kNoStep_m);
  EXPECT_TRUE(std::filesystem::exists(session + "/standby/gps.tum"));
}

}  // namespace
}  // namespace trigpoint
