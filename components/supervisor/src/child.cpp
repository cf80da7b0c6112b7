// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "child.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace trigpoint::supervisor {

namespace {

constexpr int kCannotBeStarted = 127;  ///< as a shell says it

[[noreturn]] void become(const ChildSettings& settings, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) {
    _exit(kCannotBeStarted);  // it died before the line above
  }
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  if (!settings.log_file.empty()) {
    const int log = open(settings.log_file.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
    if (log >= 0) {
      dup2(log, STDOUT_FILENO);
      dup2(log, STDERR_FILENO);
      close(log);
    }
  }
  setenv("NOTIFY_SOCKET", settings.notify_address.c_str(), 1);
  unsetenv("WATCHDOG_USEC");  // a supervisor's of ours
  if (settings.watchdog_s > 0.0) {
    setenv("WATCHDOG_USEC", std::to_string(std::llround(1e6 * settings.watchdog_s)).c_str(), 1);
  }
  std::vector<char*> arguments;
  for (const std::string& argument : settings.command) {
    arguments.push_back(const_cast<char*>(argument.c_str()));
  }
  arguments.push_back(nullptr);
  execvp(arguments.front(), arguments.data());
  dprintf(STDERR_FILENO, "%s: %s\n", arguments.front(), std::strerror(errno));
  _exit(kCannotBeStarted);
}

}  // namespace

pid_t start_child(const ChildSettings& settings) {
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) {
    throw std::runtime_error(std::string("cannot fork: ") + std::strerror(errno));
  }
  if (child == 0) {
    become(settings, parent);
  }
  return child;
}

std::optional<int> reap(pid_t child) {
  int status = 0;
  return waitpid(child, &status, WNOHANG) == child ? std::optional(status) : std::nullopt;
}

}  // namespace trigpoint::supervisor
