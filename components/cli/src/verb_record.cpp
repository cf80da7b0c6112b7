// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/shell/shell.hpp"

#include "input.hpp"
#include "interruption.hpp"
#include "number_checks.hpp"
#include "recorder.hpp"
#include "verbs.hpp"
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <numeric>
#include <optional>

namespace trigpoint::cli {

namespace {

struct RecordVerbOptions {
  InputOptions input;
  std::string out;
  std::vector<std::string> topics;
  double duration_s{0.0};
  std::optional<recording::Storage> storage;
};

/// All topics, or those that the user named. Throws ConfigError for a name that nobody publishes.
std::vector<recording::KnownTopic> choose(const std::vector<recording::KnownTopic>& all,
                                          const std::vector<std::string>& names) {
  if (names.empty()) {
    return all;
  }
  std::vector<recording::KnownTopic> chosen;
  for (const std::string& name : names) {
    const auto found = std::find_if(all.begin(), all.end(), [&name](const auto& topic) {
      return topic.name == name || "/" + topic.name == name;
    });
    if (found == all.end()) {
      std::string list;
      for (const auto& topic : all) {
        list += " " + topic.name;
      }
      throw ConfigError("--topic: no topic '" + name + "'; there are:" + list);
    }
    chosen.push_back(*found);
  }
  return chosen;
}

std::uint64_t total(const std::vector<recording::TopicSummary>& topics) {
  return std::accumulate(
      topics.begin(), topics.end(), std::uint64_t{0}, [](std::uint64_t sum, const auto& topic) {
        return sum + topic.messages;
      });
}

namespace fs = std::filesystem;

void require_empty_or_new(const std::string& out) {
  std::error_code error;
  if (recording::names_mcap_file(out) && fs::exists(out)) {
    throw ConfigError("--out: " + out + " exists; a recording is never written over another");
  }
  if (fs::exists(out) && (!fs::is_directory(out) || !fs::is_empty(out, error))) {
    throw ConfigError("--out: " + out +
                      " exists and is not an empty folder; a recording is never written over "
                      "something else");
  }
}

/// An empty recording is of no use; a folder that was there before stays.
void remove_bag(const std::string& out, bool was_there) {
  std::error_code error;
  if (!was_there) {
    fs::remove_all(out, error);
    return;
  }
  for (const auto& entry : fs::directory_iterator(out, error)) {
    fs::remove(entry.path(), error);
  }
}

int run(const RecordVerbOptions& options) {
  require_empty_or_new(options.out);
  if (recording::names_mcap_file(options.out) && options.storage == recording::Storage::kSqlite3) {
    throw ConfigError("--storage sqlite3: " + options.out +
                      " names an MCAP file; name a folder, or leave --storage out");
  }
  const bool was_there = fs::exists(options.out);
  const shell::EventLog log("record");
  const SystemConfig config = load_config_of(options.input);
  recording::RecordOptions record;
  record.bus = config.bus;
  record.topics = choose(recording::known_topics(config.cores.robot), options.topics);
  record.out = options.out;
  record.storage = options.storage.value_or(recording::Storage::kSqlite3);
  record.duration_s = options.duration_s;
  record.on_event = [&log](const Event& event) { log(event); };
  record.progress = [terminal = isatty(STDERR_FILENO) == 1](const auto& topics) {
    std::fprintf(stderr,
                 "%srecorded %llu messages on %zu topics%s",
                 terminal ? "\r" : "",
                 static_cast<unsigned long long>(total(topics)),
                 topics.size(),
                 terminal ? "  " : "\n");
  };
  const auto begin = std::chrono::steady_clock::now();
  const recording::RecordResult result = recording::record(record);
  const std::chrono::duration<double> recorded = std::chrono::steady_clock::now() - begin;
  std::cerr << "\n";
  for (const recording::TopicSummary& topic : result.topics) {
    std::cout << topic.topic << "  " << topic.type << "  " << topic.messages << "\n";
  }
  if (result.dropped > 0) {
    std::cerr << "trigpoint record: " << result.dropped
              << " messages came faster than the disk took them and are not in the bag\n";
  }
  if (total(result.topics) == 0) {
    std::cerr << "trigpoint record: nothing was heard on DDS domain " << bus::domain_of(config.bus)
              << ", so no bag is left; trigpoint doctor tells who is there\n";
    remove_bag(options.out, was_there);
    return 1;
  }
  if (recorded.count() < options.duration_s) {
    std::cerr << "trigpoint record: interrupted after " << recorded.count() << " of "
              << options.duration_s << " s; the bag is whole up to there\n";
    return kInterrupted;
  }
  return result.dropped == 0 ? 0 : 1;
}

}  // namespace

void add_record(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand(
      "record", "Write what is on the bus into a rosbag2 or an MCAP file, until Ctrl-C");
  const auto options = std::make_shared<RecordVerbOptions>();
  verb->add_option(
          "--out", options->out, "folder of the bag, new or empty; FILE.mcap: that file alone")
      ->required();
  add_storage_option(*verb, options->storage);
  verb->add_option("--config", options->input.config_files, "YAML with the keys to change");
  verb->add_option("--topic", options->topics, "only this topic; may be repeated");
  verb->add_option("--duration", options->duration_s, "stop by itself after this time, s")
      ->check(more_than_zero());
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
