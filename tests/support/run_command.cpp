// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "run_command.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

namespace trigpoint::tests {

namespace fs = std::filesystem;

namespace {

std::string make_temporary(const char* pattern, bool folder) {
  std::string name = (fs::temp_directory_path() / pattern).string();
  if (folder) {
    if (mkdtemp(name.data()) == nullptr) {
      throw std::runtime_error("cannot make " + name);
    }
    return name;
  }
  const int descriptor = mkstemp(name.data());
  if (descriptor < 0) {
    throw std::runtime_error("cannot make " + name);
  }
  close(descriptor);
  return name;
}

[[noreturn]] void become(const std::vector<std::string>& arguments,
                         const std::map<std::string, std::string>& environment,
                         const std::string& output) {
  setpgid(0, 0);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  std::signal(SIGINT, SIG_DFL);  // ignored where the tests themselves run in the background
  const int file = open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND, 0600);
  const int nothing = open("/dev/null", O_RDONLY);
  dup2(nothing, STDIN_FILENO);
  dup2(file, STDOUT_FILENO);
  dup2(file, STDERR_FILENO);
  for (const auto& [name, value] : environment) {
    setenv(name.c_str(), value.c_str(), 1);
  }
  std::vector<char*> pointers;
  for (const std::string& argument : arguments) {
    pointers.push_back(const_cast<char*>(argument.c_str()));
  }
  pointers.push_back(nullptr);
  execvp(pointers[0], pointers.data());
  _exit(127);
}

}  // namespace

Command::Command(const std::vector<std::string>& arguments,
                 const std::map<std::string, std::string>& environment)
    : output_file_(make_temporary("trigpoint-output-XXXXXX", false)) {
  pid_ = fork();
  if (pid_ < 0) {
    throw std::runtime_error("cannot fork");
  }
  if (pid_ == 0) {
    become(arguments, environment, output_file_);
  }
  setpgid(pid_, pid_);
}

Command::~Command() {
  kill(-pid_, SIGKILL);
  if (!reaped_) {
    waitpid(pid_, nullptr, 0);
  }
  std::error_code ignored;
  fs::remove(output_file_, ignored);
}

void Command::signal(int number) const {
  kill(pid_, number);
}

bool Command::running() {
  int status = 0;
  if (!reaped_ && waitpid(pid_, &status, WNOHANG) == pid_) {
    reap(status);
  }
  return !reaped_;
}

void Command::reap(int status) {
  reaped_ = true;
  result_.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

CommandResult Command::wait(std::chrono::seconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (running() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  if (running()) {
    result_.timed_out = true;
    kill(-pid_, SIGKILL);
    int status = 0;
    waitpid(pid_, &status, 0);
    reap(status);
  }
  result_.output = output_so_far();
  return result_;
}

std::string Command::output_so_far() const {
  return read_file(output_file_);
}

CommandResult run_command(const std::vector<std::string>& arguments,
                          std::chrono::seconds limit,
                          const std::map<std::string, std::string>& environment) {
  Command command(arguments, environment);
  return command.wait(limit);
}

TemporaryFolder::TemporaryFolder() : folder_(make_temporary("trigpoint-test-XXXXXX", true)) {}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

std::string TemporaryFolder::path(const std::string& name) const {
  return name.empty() ? folder_ : folder_ + "/" + name;
}

std::string read_file(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void write_file(const std::string& file, const std::string& text) {
  std::ofstream stream(file, std::ios::binary);
  stream << text;
}

int own_domain_id(int offset) {
  constexpr int kDomains = 100;  // above 101 the ports are not ours
  static std::map<int, int> taken;
  if (const auto known = taken.find(offset); known != taken.end()) {
    return known->second;
  }
  for (int attempt = 0; attempt < kDomains; ++attempt) {
    const int domain = 1 + (static_cast<int>(getpid()) * 7 + offset + attempt) % kDomains;
    const fs::path file =
        fs::temp_directory_path() / ("trigpoint-test-domain-" + std::to_string(domain) + ".lock");
    const int lock = open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
    if (lock >= 0 && flock(lock, LOCK_EX | LOCK_NB) == 0) {
      return taken[offset] = domain;  // the lock ends with the process
    }
    close(lock);
  }
  throw std::runtime_error("all DDS domains are taken by other tests");
}

std::string own_domain(int offset) {
  return std::to_string(own_domain_id(offset));
}

}  // namespace trigpoint::tests
