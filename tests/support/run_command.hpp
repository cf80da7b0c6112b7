// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <string>
#include <vector>

namespace trigpoint::tests {

struct CommandResult {
  int exit_code{-1};  ///< 128 + signal when a signal ended it
  bool timed_out{false};
  std::string output;  ///< standard output and error together
};

/// A program in a process group of its own; whatever is left of the group is killed at the end.
class Command {
 public:
  /// `environment` is added to this process's own.
  Command(const std::vector<std::string>& arguments,
          const std::map<std::string, std::string>& environment = {});
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  pid_t pid() const { return pid_; }

  void signal(int number) const;
  bool running();
  /// Kills the group when it has not ended by itself within `limit`.
  CommandResult wait(std::chrono::seconds limit);
  std::string output_so_far() const;

 private:
  void reap(int status);

  pid_t pid_{-1};
  bool reaped_{false};
  std::string output_file_;
  CommandResult result_;
};

CommandResult run_command(const std::vector<std::string>& arguments,
                          std::chrono::seconds limit = std::chrono::seconds(60),
                          const std::map<std::string, std::string>& environment = {});

/// A folder of its own that is removed at the end.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  std::string path(const std::string& name = {}) const;

 private:
  std::string folder_;
};

std::string read_file(const std::string& file);
void write_file(const std::string& file, const std::string& text);

/// A DDS domain, 1 to 100, that no other test on this computer has as long as this process lives;
/// always the same for an offset.
int own_domain_id(int offset = 0);
std::string own_domain(int offset = 0);

}  // namespace trigpoint::tests
