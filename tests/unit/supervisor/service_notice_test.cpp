// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/shell/service_notice.hpp"

#include "run_command.hpp"
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <string>

namespace trigpoint::shell {
namespace {

/// A socket with a file, as systemd's is.
class Supervisor {
 public:
  Supervisor() : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0)) {
    sockaddr_un own{};
    own.sun_family = AF_UNIX;
    std::strncpy(own.sun_path, path().c_str(), sizeof own.sun_path - 1);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&own), sizeof own), 0);
    setenv("NOTIFY_SOCKET", path().c_str(), 1);
  }

  ~Supervisor() {
    unsetenv("NOTIFY_SOCKET");
    ::close(socket_);
  }

  std::string heard() const {
    std::array<char, 100> text{};
    const ssize_t size = ::recv(socket_, text.data(), text.size(), 0);
    return size < 0 ? "nothing" : std::string(text.data(), static_cast<std::size_t>(size));
  }

 private:
  std::string path() const { return folder_.path("notify"); }

  tests::TemporaryFolder folder_;
  int socket_;
};

TEST(ServiceNotice, says_in_the_words_of_sd_notify_what_the_program_does) {
  const Supervisor supervisor;
  const ServiceNotice notice;
  EXPECT_EQ(supervisor.heard(), "nothing");
  notice.ready();
  EXPECT_EQ(supervisor.heard(), "READY=1\nWATCHDOG=1");
  notice.alive();
  EXPECT_EQ(supervisor.heard(), "WATCHDOG=1");
  notice.stopping();
  EXPECT_EQ(supervisor.heard(), "STOPPING=1");
}

TEST(ServiceNotice, asks_a_supervisor_that_watches_for_patience_and_gives_it_back) {
  const Supervisor supervisor;
  ServiceNotice().allow_silence(std::chrono::seconds(20));
  EXPECT_EQ(supervisor.heard(), "nothing") << "it does not watch";
  setenv("WATCHDOG_USEC", "3000000", 1);
  const ServiceNotice notice;
  notice.allow_silence(std::chrono::seconds(20));
  EXPECT_EQ(supervisor.heard(), "WATCHDOG_USEC=20000000\nWATCHDOG=1");
  notice.allow_silence(std::chrono::seconds(1));
  EXPECT_EQ(supervisor.heard(), "WATCHDOG_USEC=3000000\nWATCHDOG=1");
  notice.allow_usual_silence();
  EXPECT_EQ(supervisor.heard(), "WATCHDOG_USEC=3000000\nWATCHDOG=1");
  unsetenv("WATCHDOG_USEC");
}

TEST(ServiceNotice, does_nothing_without_a_supervisor_or_when_it_is_gone) {
  unsetenv("NOTIFY_SOCKET");
  ServiceNotice().ready();
  setenv("NOTIFY_SOCKET", "/nobody/is/there", 1);
  ServiceNotice().ready();
  setenv("NOTIFY_SOCKET", std::string(500, '/').c_str(), 1);
  ServiceNotice().ready();
  unsetenv("NOTIFY_SOCKET");
}

}  // namespace
}  // namespace trigpoint::shell
