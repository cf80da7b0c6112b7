// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the fusion gate must show, as one table: simulated drives with faults of the GPS, every mode
// on the same input, over several seeds. The truth is used for scoring only.
#include "fusion_map.hpp"
#include "fusion_scoreboard.hpp"
#include <CLI/CLI.hpp>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <future>
#include <iterator>
#include <set>
#include <string>
#include <vector>

namespace {

using namespace trigpoint;
using namespace trigpoint::fusion_table;

struct Options {
  std::vector<std::string> scenarios;
  std::vector<std::string> modes;
  std::uint64_t seeds{5};
  std::uint64_t first_seed{1};
  std::uint64_t short_runs{50};
  std::uint64_t jobs{1};
  std::string csv;
  bool only_faults{false};
  bool map_rows{false};
  std::string scratch{std::filesystem::temp_directory_path().string()};
  cli::InputOptions input;
};

std::vector<Row> chosen(const Options& options) {
  std::vector<Row> result;
  for (const Row& row : rows()) {
    const auto& wanted = options.scenarios;
    if ((wanted.empty() && (!options.map_rows || row.score_map)) ||
        std::find(wanted.begin(), wanted.end(), row.scenario) != wanted.end()) {
      result.push_back(row);
    }
  }
  return result;
}

/// Every scenario once, in the order of the rows.
std::vector<std::string> scenarios_of(const std::vector<Row>& chosen_rows) {
  std::vector<std::string> names;
  for (const Row& row : chosen_rows) {
    if (std::find(names.begin(), names.end(), row.scenario) == names.end()) {
      names.push_back(row.scenario);
    }
  }
  return names;
}

std::vector<Row> rows_of(const std::vector<Row>& chosen_rows, const std::string& scenario) {
  std::vector<Row> result;
  std::copy_if(
      chosen_rows.begin(), chosen_rows.end(), std::back_inserter(result), [&](const Row& row) {
        return row.scenario == scenario;
      });
  return result;
}

void print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

void tell(const Drive& result) {
  std::fprintf(stderr,
               "%s, seed %llu done; processor time of the cores:",
               result.scenario.c_str(),
               static_cast<unsigned long long>(result.seed));
  for (const auto& [mode, run] : result.runs) {
    std::fprintf(stderr, " %s %.0f s", mode.c_str(), run.process_s);
  }
  std::fprintf(stderr, "\n");
}

/// Drives into a folder of its own, which goes when it is scored.
void run_map_row(const Row& row, const Options& options, Scoreboard& scores) {
  namespace fs = std::filesystem;
  for (std::uint64_t i = 0; i < options.seeds; ++i) {
    for (const std::string& mode : options.modes) {
      const fs::path folder =
          fs::path(options.scratch) / ("fusion_table_" + std::to_string(getpid()));
      fs::remove_all(folder);
      fs::create_directories(folder);
      MapTask task{options.input, mode, folder.string()};
      task.input.seed = options.first_seed + i;
      scores.add(row, mode, *task.input.seed, row.score_map(task));
      fs::remove_all(folder);
      std::fprintf(stderr,
                   "%s, seed %llu, %s done\n",
                   row.scenario.c_str(),
                   static_cast<unsigned long long>(*task.input.seed),
                   mode.c_str());
    }
  }
}

/// All seeds of one scenario.
void run_scenario(const std::string& scenario,
                  const std::vector<Row>& its_rows,
                  const Options& options,
                  Scoreboard& scores) {
  const auto any = [&](bool Row::*flag) {
    return std::any_of(its_rows.begin(), its_rows.end(), [&](const Row& row) { return row.*flag; });
  };
  DriveOptions one{options.input, options.modes, any(&Row::sorted)};
  one.input.log = scenario;
  const std::uint64_t seeds = any(&Row::many_short) ? options.short_runs : options.seeds;
  for (std::uint64_t i = 0; i < seeds; i += options.jobs) {
    std::vector<std::future<Drive>> drives;
    for (std::uint64_t job = i; job < std::min(seeds, i + options.jobs); ++job) {
      one.input.seed = options.first_seed + job;
      drives.push_back(std::async(std::launch::async, drive, one));
    }
    for (std::future<Drive>& each : drives) {
      const Drive result = each.get();
      for (const Row& row : its_rows) {
        for (const std::string& mode : options.modes) {
          scores.add(row, mode, result.seed, row.score(result, mode));
        }
      }
      tell(result);
    }
  }
}

void print_windows(const char* kind,
                   const std::vector<evaluation::Window>& windows,
                   const Drive& drive) {
  for (const evaluation::Window& window : windows) {
    const simulator::Truth& truth = *drive.truth;
    double driven_m = 0.0;
    Eigen::Vector3d last_m = truth.at(window.begin_ns).T_map_base.p;
    for (Nanoseconds ns = window.begin_ns; ns < window.end_ns; ns += 100'000'000) {
      const Eigen::Vector3d now_m = truth.at(ns).T_map_base.p;
      driven_m += (now_m - last_m).norm();
      last_m = now_m;
    }
    double largest_m = 0.0;
    for (const simulator::FixTruth& fix : drive.fixes) {
      const bool inside = fix.stamp_ns >= window.begin_ns && fix.stamp_ns < window.end_ns;
      largest_m = inside ? std::max(largest_m, fix.fault_error_enu_m.norm()) : largest_m;
    }
    std::printf("| %s | %llu | %s | %.1f | %.1f | %.1f | %.1f |\n",
                drive.scenario.c_str(),
                static_cast<unsigned long long>(drive.seed),
                kind,
                to_seconds(window.begin_ns - truth.first_ns()),
                to_seconds(window.end_ns - window.begin_ns),
                driven_m,
                largest_m);
  }
}

/// What the scenarios hold, to be read against what the table asks for.
void print_faults(const std::vector<std::string>& scenarios, const Options& options) {
  print(
      "| scenario | seed | what | from s | for s | m driven | largest fault m |\n"
      "|---|---|---|---|---|---|---|\n");
  for (const std::string& scenario : scenarios) {
    if (rows_of(rows(), scenario).front().score_map) {
      continue;
    }
    for (std::uint64_t i = 0; i < options.seeds; ++i) {
      cli::InputOptions input = options.input;
      input.log = scenario;
      input.seed = options.first_seed + i;
      const Drive drive = without_runs(input);
      print_windows("drive", {{drive.truth->first_ns(), drive.truth->last_ns()}}, drive);
      print_windows("outage", outages(drive), drive);
      print_windows("wrong",
                    stretches(drive,
                              [](const simulator::FixTruth& fix) {
                                return fix.fault_error_enu_m.norm() > 0.05;
                              }),
                    drive);
      print_windows(
          "not fixed",
          stretches(drive,
                    [](const simulator::FixTruth& fix) { return fix.gnss_class != "fixed"; }),
          drive);
    }
  }
}

void run(const Options& options) {
  const std::vector<Row> all = chosen(options);
  if (options.only_faults) {
    return print_faults(scenarios_of(all), options);
  }
  Scoreboard scores(options.modes, options.csv);
  print(scores.head());
  for (const std::string& scenario : scenarios_of(all)) {
    const auto its_rows = rows_of(all, scenario);
    if (its_rows.front().score_map) {
      run_map_row(its_rows.front(), options, scores);
    } else {
      run_scenario(scenario, its_rows, options, scores);
    }
    for (const Row& row : its_rows) {
      print(scores.print(row));
    }
  }
  print("\nWhat was said:\n");
  for (const Row& row : all) {
    print(scores.print_words(row));
  }
  if (options.modes.size() > 1) {
    print("\n" + scores.print_ratios(options.modes.back()));
  }
  print("\n" + scores.print_summary());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("What the fusion gate must show: every mode on simulated drives with GPS faults");
  Options options;
  std::set<std::string> names;
  for (const Row& row : rows()) {
    names.insert(row.scenario);
  }
  const std::vector<std::string> modes = known_modes();
  options.modes = modes;
  app.add_option("--scenario", options.scenarios, "only these rows; default: all")
      ->check(CLI::IsMember(names));
  app.add_option("--mode", options.modes, "of the gate; default: all; the last is compared")
      ->check(CLI::IsMember(modes));
  app.add_option("--seeds", options.seeds, "runs of each scenario")->check(CLI::PositiveNumber);
  app.add_option("--first-seed", options.first_seed, "the others follow it");
  app.add_option("--short-runs", options.short_runs, "runs of the row of consistency")
      ->check(CLI::PositiveNumber);
  app.add_option("--jobs", options.jobs, "seeds at a time")->check(CLI::PositiveNumber);
  app.add_option("--duration", options.input.duration_s, "only so much of each drive, s")
      ->check(CLI::PositiveNumber);
  app.add_option("--config", options.input.config_files, "overlays of the configuration");
  app.add_option("--csv", options.csv, "every single figure");
  app.add_flag("--map-rows", options.map_rows, "only the rows of the map and the corrected past");
  app.add_option("--scratch", options.scratch, "where the sessions of those rows are made")
      ->check(CLI::ExistingDirectory);
  app.add_flag("--faults", options.only_faults, "print the scenarios' faults and do not drive");
  CLI11_PARSE(app, argc, argv);
  try {
    run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fusion_table: %s\n", error.what());
    return 1;
  }
  return 0;
}
