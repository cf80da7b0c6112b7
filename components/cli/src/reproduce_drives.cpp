// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "reproduce_drives.hpp"

#include "trigpoint/export/session.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

namespace trigpoint::cli {

namespace {

namespace fs = std::filesystem;

/// Enough for the alignment, a withheld stretch and, on campus, the dropout.
constexpr double kQuick_s = 60.0;

/// "campus+wrong_fix" as the name of a folder.
std::string folder_name(const std::string& scenario) {
  std::string name = fs::path(scenario).filename().string();
  std::replace(name.begin(), name.end(), '=', '_');
  return name;
}

std::string stands_for(const std::string& scenario) {
  const std::string base = scenario.substr(0, scenario.find('+'));
  return base == "campus" ? "Small Campus" : base == "park" ? "Park" : "";
}

void add_modes(DriveToRun& drive, const ReproduceOptions& options) {
  const std::string folder = exporter::path_in(options.out, drive.about.name);
  for (const std::string& mode : options.modes) {
    drive.about.modes.push_back(
        {mode,
         exporter::path_in(folder, mode),
         options.no_withheld ? "" : exporter::path_in(folder, mode + "_withheld")});
  }
}

DriveToRun with_settings(const ReproduceOptions& options, const std::string& log) {
  DriveToRun drive;
  drive.input.log = log;
  drive.input.duration_s = options.quick ? kQuick_s : options.duration_s;
  return drive;
}

void add_config_files(DriveToRun& drive, const ReproduceOptions& options) {
  auto& files = drive.input.config_files;
  if (options.published_ekf) {
    files.push_back(preset_file("lio_sam_ekf"));
  }
  files.insert(files.end(), options.config_files.begin(), options.config_files.end());
}

DriveToRun scenario_drive(const ReproduceOptions& options, const std::string& scenario) {
  require_scenario(scenario);
  DriveToRun drive = with_settings(options, scenario);
  drive.input.seed = options.seed;
  drive.about.name = folder_name(scenario);
  drive.about.source =
      "Simulated drive `" + scenario + "`, seed " + std::to_string(options.seed) + ".";
  drive.about.paper_dataset = stands_for(scenario);
  add_config_files(drive, options);
  add_modes(drive, options);
  return drive;
}

DriveToRun bag_drive(const ReproduceOptions& options,
                     const std::string& bag,
                     const std::string& preset,
                     const std::string& name,
                     const std::string& dataset) {
  DriveToRun drive = with_settings(options, bag);
  drive.about.name = name;
  drive.about.source =
      "Recorded drive `" + fs::path(bag).filename().string() + "`, preset `" + preset + "`.";
  drive.about.paper_dataset = dataset;
  drive.about.is_paper_data = true;
  drive.input.config_files.push_back(preset_file(preset));
  add_config_files(drive, options);
  add_modes(drive, options);
  return drive;
}

/// Both would be written into one folder.
void refuse_doubles(const std::string& option, std::vector<std::string> names) {
  std::sort(names.begin(), names.end());
  const auto twice = std::adjacent_find(names.begin(), names.end());
  if (twice != names.end()) {
    throw ConfigError(option + ": " + *twice + " is named twice");
  }
}

void check(const ReproduceOptions& options) {
  if (options.quick && options.duration_s > 0.0) {
    throw ConfigError("--quick is a --duration of its own: leave one of them out");
  }
  if (!options.no_withheld && options.withhold_for_s >= options.withhold_every_s) {
    throw ConfigError("--withhold-for must be less than --withhold-every: nothing would be fed");
  }
  refuse_doubles("--modes", options.modes);
  if (fs::exists(exporter::path_in(options.out, "reproduction.json"))) {
    throw ConfigError("--out: " + options.out +
                      " holds a reproduction already; name another folder, or remove it");
  }
  refuse_used_folder(options.out);
}

void check_names(const std::vector<DriveToRun>& drives) {
  std::vector<std::string> names;
  for (const DriveToRun& drive : drives) {
    names.push_back(drive.about.name);
  }
  refuse_doubles("--drives", std::move(names));
}

}  // namespace

std::string preset_file(const std::string& name) {
  std::vector<fs::path> folders;
  if (const char* folder = std::getenv("TRIGPOINT_PRESETS"); folder != nullptr) {
    folders.emplace_back(folder);
  }
  folders.emplace_back(TRIGPOINT_PRESETS_SOURCE);
  folders.emplace_back(TRIGPOINT_PRESETS_INSTALLED);
  for (const fs::path& folder : folders) {
    if (const fs::path file = folder / (name + ".yaml"); fs::is_regular_file(file)) {
      return file.string();
    }
  }
  throw ConfigError("the preset " + name + ".yaml is neither in " + TRIGPOINT_PRESETS_SOURCE +
                    " nor in " + TRIGPOINT_PRESETS_INSTALLED +
                    "; set TRIGPOINT_PRESETS to the folder that has it");
}

std::vector<DriveToRun> drives_of(const ReproduceOptions& options) {
  check(options);
  std::vector<DriveToRun> drives;
  if (!options.no_simulated) {
    for (const std::string& scenario : options.drives) {
      drives.push_back(scenario_drive(options, scenario));
    }
  }
  if (!options.small_campus.empty()) {
    drives.push_back(bag_drive(
        options, options.small_campus, "lio_sam_campus", "recorded_small_campus", "Small Campus"));
  }
  if (!options.park.empty()) {
    drives.push_back(bag_drive(options, options.park, "lio_sam_park", "recorded_park", "Park"));
  }
  if (drives.empty()) {
    throw ConfigError("there is nothing to drive: --no-simulated without --park or --small-campus");
  }
  check_names(drives);
  for (const DriveToRun& drive : drives) {
    try {
      open_input(drive.input);
    } catch (const recording::LogError& error) {
      throw ConfigError(error.what());  // one of the arguments, found before the first drive
    }
  }
  return drives;
}

std::vector<pipeline::RunOfMany> runs_of(const DriveToRun& drive,
                                         const SystemConfig& config,
                                         const recording::FixWithholding& withholding) {
  std::vector<pipeline::RunOfMany> runs;
  for (const evaluation::ModeSessions& mode : drive.about.modes) {
    SystemConfig own = config;
    own.cores.fusion_gate.mode = mode.mode;
    pipeline::RunOfMany run{own.cores, {}};
    run.options.session = mode.fed;
    run.options.config_text = print(own);
    run.options.mode = mode.mode;
    runs.push_back(run);
    if (!mode.withheld.empty()) {
      run.options.session = mode.withheld;
      run.options.withhold = withholding;
      runs.push_back(run);
    }
  }
  return runs;
}

}  // namespace trigpoint::cli
