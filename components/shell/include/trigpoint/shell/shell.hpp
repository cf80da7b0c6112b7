// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What every program does around its core: options, its part of the configuration, the log, honest
// exit codes.
#pragma once

#include "trigpoint/base/config.hpp"
#include "trigpoint/base/event.hpp"

#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace trigpoint::shell {

struct Options {
  std::vector<std::string> config_files;  ///< later ones win
  std::string session;                    ///< folder for this program's part; empty: no files
};

/// Logs events with spdlog to standard error: each code at most `burst` times in full, then counted
/// and summed up every few seconds. May be called from any thread.
class EventLog {
 public:
  explicit EventLog(const std::string& program);
  ~EventLog();
  void operator()(const Event& event) const;
  void operator()(const Events& events) const;
  void info(const std::string& text) const;
  void warning(const std::string& text) const;
  void error(const std::string& text) const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

/// Writes of result files that must not stop a live program: the first refusal of the disk is told
/// as an error and remembered for the exit code, further writes are skipped.
class DiskGuard {
 public:
  explicit DiskGuard(const EventLog& log) : log_(log) {}

  template <typename Write>
  void keep(Write write) {
    if (failed_) {
      return;
    }
    try {
      write();
    } catch (const std::runtime_error& error) {
      failed_ = true;
      log_.error(std::string(error.what()) + "; going on without writing files");
    }
  }

  bool failed() const { return failed_; }

 private:
  EventLog log_;
  bool failed_{false};
};

/// The sections that a program reads; the others of kConfigSections are left to their owners.
using Sections = std::map<std::string, std::function<void(ConfigFields&)>>;

/// Throws ConfigError with file, line, key and rule.
void load_sections(const std::vector<std::string>& files, const Sections& own);

/// Parses the options (`--help` and mistakes end here), runs `body` and turns what it throws into a
/// message on standard error. Exit codes: 0 done, 1 failed at run time, 2 wrong option or
/// configuration.
int run_program(int argc,
                char** argv,
                const std::string& name,
                const std::string& description,
                const std::function<int(const Options&, const EventLog&)>& body);

}  // namespace trigpoint::shell
