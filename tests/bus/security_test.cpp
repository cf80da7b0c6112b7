// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// DDS-Security with the credentials of bringup/make-credentials: who has them reads and writes,
// across vendors too; who has none, or those of somebody else, does neither.
#include "trigpoint/base/config.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/topics.hpp"

#include "../unit/bus/samples.hpp"
#include "bus_fixture.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <thread>

namespace trigpoint::bus {
namespace {

using ::testing::AnyOf;
using testing::Collected;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::own_domain;
using testing::Readers;
using tests::Command;

/// So many messages of a peer with credentials, 20 ms apart, are given to one without: it matches
/// within a few milliseconds where nobody forbids it.
constexpr std::size_t kObserved = 150;

constexpr std::chrono::milliseconds kAgain{20};

/// The longest name that the script takes, since it makes handshakes longer.
constexpr char kBase[] = "base_station_with_a_longest_name";

/// As between computers: what belongs to a handshake is larger.
constexpr std::int64_t kLanDatagram_bytes = 1'472;

std::string peer_program(const std::string& vendor) {
  return std::string(TRIGPOINT_BIN_DIR) + "/bus_peer_" + vendor;
}

tests::CommandResult make_credentials(const std::string& folder,
                                      std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {TRIGPOINT_SOURCE_DIR "/bringup/make-credentials", folder});
  return tests::run_command(arguments);
}

/// The parameter is the vendor of the other process.
class Security : public ::testing::TestWithParam<std::string> {
 protected:
  explicit Security(std::string protection = "encrypt") : protection_(std::move(protection)) {}

  void SetUp() override {
    if (!std::filesystem::exists(peer_program(GetParam()))) {
      GTEST_SKIP() << "there is no " << GetParam() << " in this build";
    }
    add_hosts("ours", {"robot", kBase});
    add_hosts("theirs", {"robot", kBase});
  }

  std::string credentials(const std::string& authority, const std::string& host) const {
    return folder_.path(authority + "/" + host);
  }

  void add_hosts(const std::string& authority, std::vector<std::string> hosts) const {
    hosts.insert(hosts.end(), {"--protection", protection_});
    const auto made = make_credentials(folder_.path(authority), hosts);
    ASSERT_EQ(made.exit_code, 0) << made.output;
  }

  static Config secured(const std::string& credentials) {
    Config config = own_domain();
    config.security_folder = credentials;
    config.datagram_bytes = kLanDatagram_bytes;
    return config;
  }

  /// Without credentials when `credentials` is empty.
  static std::unique_ptr<Command> peer(const std::string& vendor,
                                       std::vector<std::string> what,
                                       const std::string& credentials) {
    what.insert(what.begin(), {peer_program(vendor), std::to_string(own_domain().domain_id)});
    std::map<std::string, std::string> environment;
    if (!credentials.empty()) {
      environment["BUS_PEER_SECURITY"] = credentials;
    }
    return std::make_unique<Command>(what, environment);
  }

  /// A fix from the other process comes here, and a sample of the IMU from here is taken there.
  void expect_hear_each_other(const std::string& other_host) const {
    Participant robot(secured(credentials("ours", "robot")), "robot");
    Collected<GnssFix> heard;
    Subscription<sensor_msgs::msg::NavSatFix> fixes(
        robot, topics::fix, [&](const auto& fix, const MessageInfo&) {
          heard.add(from_message(fix));
        });
    Readers readers;
    Publisher imu(robot, topics::imu, readers.events());
    const auto writer = peer(GetParam(), {"fix"}, credentials("ours", other_host));
    const auto reader = peer(GetParam(), {"hear", "imu"}, credentials("ours", other_host));
    ASSERT_TRUE(heard.wait_for(1)) << writer->output_so_far();
    samples::expect_equal(heard.items().front(), samples::fix());
    ASSERT_TRUE(readers.wait_for(1)) << reader->output_so_far();
    imu.publish(to_message(samples::imu()));
    EXPECT_TRUE(imu.wait_for_acknowledgments(testing::kForever));
  }

  /// Nobody with these credentials, here or in a process of the other vendor, hears us or is heard.
  void expect_is_kept_out(const std::string& credentials_of_stranger) const {
    Participant robot(secured(credentials("ours", "robot")), "robot");
    Collected<std::string> heard;
    Collected<std::string> writers;
    Subscription<sensor_msgs::msg::NavSatFix> fixes(
        robot,
        topics::fix,
        [&](const auto&, const MessageInfo& info) { heard.add(info.writer_guid); },
        {[&](const std::string& guid) { writers.add(guid); }, {}, {}});
    Publisher imu(robot, topics::imu);

    Participant stranger(secured(credentials_of_stranger), "stranger");
    Collected<std::string>
        overheard;  // the forger's fixes among them, which is none of our business
    const auto overhear = [&](const auto&, const MessageInfo& info) {
      overheard.add(info.writer_guid);
    };
    Subscription<sensor_msgs::msg::NavSatFix> stolen_fixes(stranger, topics::fix, overhear);
    Subscription<sensor_msgs::msg::Imu> stolen_imu(stranger, topics::imu, overhear);
    const auto forger = peer(GetParam(), {"fix"}, credentials_of_stranger);
    const auto listener = peer(GetParam(), {"hear", "imu"}, credentials_of_stranger);

    const auto friendly = peer(backend::name(), {"fix"}, credentials("ours", kBase));
    ASSERT_TRUE(heard.wait_for(1)) << friendly->output_so_far();
    while (heard.size() < kObserved) {
      imu.publish(to_message(samples::imu()));
      std::this_thread::sleep_for(kAgain);
    }
    EXPECT_TRUE(forger->running() && listener->running()) << "no longer there to be kept out";
    EXPECT_EQ(writers.size(), 1U);
    EXPECT_EQ(fixes.matched(), 1);
    EXPECT_EQ(imu.matched(), 0);
    EXPECT_THAT(heard.items(), Each(writers.items().front()));
    EXPECT_THAT(overheard.items(),
                Not(AnyOf(Contains(writers.items().front()), Contains(imu.guid()))));
  }

 private:
  const std::string protection_;
  const tests::TemporaryFolder folder_;
};

class SignedSecurity : public Security {
 protected:
  SignedSecurity() : Security("sign") {}
};

TEST_P(Security, lets_those_with_credentials_hear_each_other) {
  expect_hear_each_other(kBase);
}

TEST_P(SignedSecurity, lets_those_with_credentials_hear_each_other) {
  expect_hear_each_other(kBase);
}

TEST_P(Security, lets_a_host_in_that_was_added_later) {
  add_hosts("ours", {"later"});
  expect_hear_each_other("later");
}

TEST_P(SignedSecurity, lets_nobody_without_credentials_read_or_write) {
  expect_is_kept_out("");
}

TEST_P(Security, lets_nobody_without_credentials_read_or_write) {
  expect_is_kept_out("");
}

TEST_P(Security, lets_nobody_with_credentials_of_another_authority_read_or_write) {
  expect_is_kept_out(credentials("theirs", "robot"));
}

TEST_P(Security, names_a_file_that_is_missing) {
  const std::string folder = credentials("ours", "robot");
  std::filesystem::remove(folder + "/permissions.p7s");
  try {
    Participant participant(secured(folder), "incomplete");
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("permissions.p7s"));
  }
}

TEST_P(Security, is_refused_with_a_discovery_server) {
  Config config = secured(credentials("ours", "robot"));
  config.discovery_server = "127.0.0.1:11811";
  try {
    Participant participant(config, "client");
    FAIL() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_THAT(
        error.what(),
        ::testing::AllOf(HasSubstr("bus.discovery_server"), HasSubstr("bus.initial_peers")));
  }
}

const auto kVendors = ::testing::Values("fastdds", "cyclonedds");

std::string name_of_pair(const ::testing::TestParamInfo<std::string>& vendor) {
  return std::string("of_") + backend::name() + "_with_" + vendor.param;
}

INSTANTIATE_TEST_SUITE_P(Vendors, Security, kVendors, name_of_pair);
INSTANTIATE_TEST_SUITE_P(Vendors, SignedSecurity, kVendors, name_of_pair);

// ---- bringup/make-credentials by itself ---------------------------------------------------------

std::map<std::string, std::string> files_below(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[entry.path().string()] = tests::read_file(entry.path().string());
    }
  }
  return files;
}

/// The parameter is the protection.
class MakeCredentials : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override { ASSERT_EQ(make({"robot"}, GetParam()).exit_code, 0); }

  tests::CommandResult make(std::vector<std::string> hosts, const std::string& protection) const {
    hosts.insert(hosts.end(), {"--protection", protection});
    return make_credentials(folder_.path(), hosts);
  }

  const tests::TemporaryFolder folder_;
};

TEST_P(MakeCredentials, protects_all_that_is_told_by_the_kind_that_is_asked_for) {
  const std::string governance = tests::read_file(folder_.path("robot/governance.p7s"));
  const std::string kind = GetParam() == "sign" ? "SIGN" : "ENCRYPT";
  for (const std::string what : {"discovery", "liveliness", "metadata"}) {
    EXPECT_THAT(governance, HasSubstr("<" + what + "_protection_kind>" + kind + "<"));
  }
  EXPECT_THAT(governance, Not(HasSubstr(GetParam() == "sign" ? ">ENCRYPT<" : ">SIGN<")));
}

TEST_P(MakeCredentials, adds_a_host_and_leaves_the_others_and_the_authority_as_they_are) {
  const auto before = files_below(folder_.path());
  const auto added = make({"base"}, GetParam());
  ASSERT_EQ(added.exit_code, 0) << added.output;
  auto after = files_below(folder_.path());
  EXPECT_EQ(
      std::erase_if(after,
                    [](const auto& file) { return file.first.find("/base/") != file.first.npos; }),
      std::distance(std::filesystem::directory_iterator(folder_.path("robot")), {}));
  EXPECT_EQ(after, before);
}

TEST_P(MakeCredentials, refuses_another_protection_for_a_host_that_is_added) {
  const auto before = files_below(folder_.path());
  const auto refused = make({"base"}, GetParam() == "sign" ? "encrypt" : "sign");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.output, HasSubstr("another --protection"));
  EXPECT_EQ(files_below(folder_.path()), before);
  EXPECT_FALSE(std::filesystem::exists(folder_.path("base")));
}

INSTANTIATE_TEST_SUITE_P(Protections,
                         MakeCredentials,
                         ::testing::Values("encrypt", "sign"),
                         [](const auto& protection) { return protection.param; });

}  // namespace
}  // namespace trigpoint::bus
