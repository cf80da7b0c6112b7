// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Finds scenario files and puts a scenario together: what it is based on, its own text, and the
// changes named behind it.
#include "trigpoint/simulator/scenario.hpp"

#include "route.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>

namespace trigpoint::simulator {

namespace {

namespace fs = std::filesystem;

constexpr int kDeepestBase = 8;
constexpr const char* kOverlays = "overlays";

std::vector<fs::path> scenario_folders() {
  std::vector<fs::path> folders;
  if (const char* folder = std::getenv("TRIGPOINT_SCENARIOS"); folder != nullptr) {
    folders.emplace_back(folder);
  }
  folders.emplace_back(TRIGPOINT_SCENARIOS_SOURCE);
  folders.emplace_back(TRIGPOINT_SCENARIOS_INSTALLED);
  return folders;
}

/// An existing .yaml file, or a name in `below` of one of the folders.
std::optional<fs::path> find_file(const std::string& file_or_name, const fs::path& below = {}) {
  std::error_code ignored;
  const fs::path given(file_or_name);
  if ((given.extension() == ".yaml" || given.extension() == ".yml") &&
      fs::is_regular_file(given, ignored)) {
    return given;
  }
  if (given.has_parent_path() || given.has_extension()) {
    return std::nullopt;
  }
  for (const fs::path& folder : scenario_folders()) {
    if (const fs::path file = folder / below / (file_or_name + ".yaml");
        fs::is_regular_file(file, ignored)) {
      return file;
    }
  }
  return std::nullopt;
}

std::vector<std::string> names_in(const fs::path& below) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const fs::path& folder : scenario_folders()) {
    for (const auto& entry : fs::directory_iterator(folder / below, ignored)) {
      if (entry.path().extension() == ".yaml") {
        names.push_back(entry.path().stem().string());
      }
    }
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  if (!file) {
    throw ConfigError(path.string() + ": cannot be read");
  }
  return text.str();
}

/// "campus+a+b" as campus, a, b; a file whose own name has a plus is one.
std::vector<std::string> parts_of(const std::string& composed) {
  std::error_code ignored;
  if (fs::is_regular_file(composed, ignored)) {
    return {composed};
  }
  if (composed.ends_with('+')) {
    throw ConfigError(composed + ": ends with +, a change is expected after it");
  }
  std::vector<std::string> parts;
  std::stringstream text(composed);
  for (std::string part; std::getline(text, part, '+');) {
    parts.push_back(part);
  }
  return parts.empty() ? std::vector<std::string>{composed} : parts;
}

bool is_setting(const std::string& part) {
  return part.find('=') != std::string::npos;
}

/// "motion.start_m=150" as YAML.
std::string yaml_of_setting(const std::string& setting) {
  const std::size_t equal = setting.find('=');
  std::string yaml;
  std::string indent;
  std::stringstream keys(setting.substr(0, equal));
  for (std::string key; std::getline(keys, key, '.');) {
    yaml += (yaml.empty() ? "" : "\n") + indent + key + ":";
    indent += "  ";
  }
  return yaml + " " + setting.substr(equal + 1) + "\n";
}

void load_text(Scenario& scenario, const std::string& yaml, const std::string& name) {
  load_config_text(yaml, name, [&](ConfigFields& fields) { describe(scenario, fields); });
}

/// Lets the text change the scenario; its faults come on top.
void lay_over(Scenario& scenario, const std::string& yaml, const std::string& name) {
  std::vector<std::shared_ptr<Fault>> faults = std::exchange(scenario.faults, {});
  load_text(scenario, yaml, name);
  faults.insert(faults.end(), scenario.faults.begin(), scenario.faults.end());
  scenario.faults = std::move(faults);
}

std::string places_searched() {
  std::string places;
  for (const fs::path& folder : scenario_folders()) {
    places += "\n  " + folder.string();
  }
  return places;
}

fs::path need_file(const std::string& file_or_name) {
  const std::optional<fs::path> path = find_file(file_or_name);
  if (!path) {
    throw ConfigError(file_or_name + ": is neither a scenario file (.yaml) nor the name of one in" +
                      places_searched());
  }
  return *path;
}

fs::path need_overlay(const std::string& file_or_name) {
  const std::optional<fs::path> path = find_file(file_or_name, kOverlays);
  if (!path) {
    std::string known;
    for (const std::string& name : shipped_overlays()) {
      known += (known.empty() ? "" : ", ") + name;
    }
    throw ConfigError(file_or_name +
                      ": is no change of a scenario: neither key=value, nor a .yaml, " +
                      "nor one of: " + known);
  }
  return *path;
}

Scenario load_with_base(const std::string& yaml, const std::string& name, int depth) {
  Scenario scenario;
  load_text(scenario, yaml, name);
  if (scenario.based_on.empty()) {
    return scenario;
  }
  if (depth >= kDeepestBase) {
    throw ConfigError(name + ": based_on goes round in circles, or deeper than " +
                      std::to_string(kDeepestBase));
  }
  const fs::path base = need_file(scenario.based_on);
  scenario = load_with_base(text_of(base), base.string(), depth + 1);
  lay_over(scenario, yaml, name);
  scenario.based_on.clear();
  return scenario;
}

void check_route(const Scenario& scenario, const std::string& name) {
  if (!scenario.route) {
    throw ConfigError(name + ": has no section route");
  }
  try {
    static_cast<void>(driven_route(scenario));
  } catch (const ConfigError& error) {
    throw ConfigError(name + ": " + error.what());
  }
}

/// What a composed scenario is made of may change or move: all of it, as one text.
std::string whole_yaml(Scenario& scenario) {
  return print_config([&](ConfigFields& fields) { describe(scenario, fields); });
}

void add_change(Scenario& scenario, const std::string& change) {
  const std::string name = scenario.name + "+" + change;
  if (is_setting(change)) {
    lay_over(scenario, yaml_of_setting(change), change);
  } else {
    const fs::path overlay = need_overlay(change);
    lay_over(scenario, text_of(overlay), overlay.string());
  }
  scenario.name = name;
}

}  // namespace

Scenario load_scenario_text(const std::string& yaml, const std::string& name) {
  Scenario scenario = load_with_base(yaml, name, 0);
  check_route(scenario, name);
  scenario.source_yaml = yaml;
  return scenario;
}

Scenario load_scenario(const std::string& composed) {
  const std::vector<std::string> parts = parts_of(composed);
  const fs::path path = need_file(parts.front());
  const std::string yaml = text_of(path);
  Scenario scenario = load_with_base(yaml, path.string(), 0);
  for (std::size_t i = 1; i < parts.size(); ++i) {
    add_change(scenario, parts[i]);
  }
  check_route(scenario, composed);
  scenario.source_yaml = parts.size() == 1 ? yaml : whole_yaml(scenario);
  return scenario;
}

bool is_scenario(const std::string& composed) {
  return find_file(parts_of(composed).front()).has_value();
}

std::vector<std::string> shipped_scenarios() {
  return names_in({});
}

std::vector<std::string> shipped_overlays() {
  return names_in(kOverlays);
}

}  // namespace trigpoint::simulator
