// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/evaluation/comparison.hpp"
#include "trigpoint/evaluation/map_quality.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/geodesy/map_on_earth.hpp"
#include "trigpoint/simulator/scenario.hpp"
#include "trigpoint/simulator/surfaces.hpp"

#include "finish_session.hpp"
#include "input.hpp"
#include "number_checks.hpp"
#include "verbs.hpp"

#include <cstdint>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

namespace trigpoint::cli {

namespace {

struct EvaluateOptions {
  evaluation::ComparisonInput input;
  double largest_gap_s{to_seconds(evaluation::kDefaultGap_ns)};
  std::string json_file;
  std::string plots_folder;
  bool map{false};
  std::string scenario;  ///< whose world is the map's truth
  std::uint64_t seed{1};
};

/// Distances in the session's map to the surfaces of a scenario's world, which lie in the map of
/// the scenario's datum.
evaluation::SurfaceDistance surface_distance(const EvaluateOptions& options) {
  const simulator::Scenario scenario = simulator::load_scenario(options.scenario);
  const auto surfaces = std::make_shared<simulator::Surfaces>(scenario, options.seed);
  const std::string datum_file =
      exporter::path_in(options.input.estimate, exporter::session_file::kDatum);
  if (!std::filesystem::exists(datum_file)) {
    throw ConfigError(options.input.estimate +
                      ": has no datum.yaml, so its map cannot be laid over the scenario's world");
  }
  const geodesy::MapOnEarth session_map(exporter::read_datum(datum_file));
  const geodesy::LocalFrame scenario_map(scenario.datum);
  return [surfaces, session_map, scenario_map](
             const Eigen::Vector3d& p_map_m) -> std::optional<double> {
    const auto p_scenario_m = scenario_map.to_map(session_map.geographic(p_map_m));
    return p_scenario_m ? surfaces->distance_m(*p_scenario_m) : std::nullopt;
  };
}

void check_map_options(const EvaluateOptions& options) {
  if (!options.map && !options.scenario.empty()) {
    throw ConfigError("--scenario is the truth of --map, which is not asked for");
  }
  if (options.map && !std::filesystem::is_directory(options.input.estimate)) {
    throw ConfigError("--map needs a session folder, " + options.input.estimate + " is a file");
  }
  if (!options.scenario.empty()) {
    require_scenario(options.scenario);
  }
}

void check_inputs(const EvaluateOptions& options) {
  for (const std::string& input : {options.input.estimate, options.input.reference}) {
    if (std::filesystem::is_directory(input)) {
      refuse_other_folder(input);
    }
  }
  if (!options.input.lio_file.empty() && std::filesystem::is_directory(options.input.estimate)) {
    throw ConfigError("--lio goes with a file; the session " + options.input.estimate +
                      " brings its own lio.tum");
  }
}

void refuse_to_overwrite(const EvaluateOptions& options) {
  if (std::filesystem::exists(options.json_file)) {
    throw ConfigError(options.json_file + ": is there already, choose another file");
  }
  if (std::filesystem::exists(options.plots_folder)) {
    throw ConfigError(options.plots_folder + ": is there already, choose another folder");
  }
}

int run(EvaluateOptions options) {
  refuse_to_overwrite(options);
  options.input.largest_gap_ns = from_seconds(options.largest_gap_s);
  check_inputs(options);
  check_map_options(options);
  options.input.may_be_empty = options.map;
  evaluation::Comparison comparison = evaluation::compare(options.input);
  if (options.map) {
    comparison.map = evaluation::map_quality(
        options.input.estimate,
        options.scenario.empty() ? evaluation::SurfaceDistance{} : surface_distance(options));
  }
  std::cout << evaluation::print(comparison);
  if (!options.json_file.empty()) {
    exporter::write_text(options.json_file, evaluation::to_json(comparison));
  }
  if (!options.plots_folder.empty()) {
    for (const std::string& picture : evaluation::draw(comparison, options.plots_folder)) {
      std::cout << picture << "\n";
    }
  }
  for (const std::string& file : comparison.damaged) {
    std::cerr << "trigpoint evaluate: left out, " << file << "\n";
  }
  return comparison.damaged.empty() ? 0 : 1;
}

}  // namespace

void add_evaluate(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand("evaluate",
                                      "Errors of trajectories against a reference: three "
                                      "alignments, per axis, coverage, steps, outages, end to end");
  const auto options = std::make_shared<EvaluateOptions>();
  verb->add_option("ESTIMATE",
                   options->input.estimate,
                   "TUM file, KITTI file (times in NAME_times.txt or times.txt beside it), or "
                   "session folder: each of its trajectories")
      ->required()
      ->check(CLI::ExistingPath);
  verb->add_option("REFERENCE",
                   options->input.reference,
                   "the same; of a session its truth, its withheld fixes and all its fixes. May be "
                   "left out when ESTIMATE is a session")
      ->check(CLI::ExistingPath);
  verb->add_option("--json", options->json_file, "file for every figure with all its digits");
  verb->add_option("--plots", options->plots_folder, "folder for pictures, made here");
  verb->add_flag(
      "--map", options->map, "also how sharp the session's map is, and how double its walls");
  verb->add_option("--scenario",
                   options->scenario,
                   "with --map: the scenario that the session is of; distances of the map's points "
                   "to its surfaces");
  verb->add_option("--seed", options->seed, "of that scenario")
      ->capture_default_str()
      ->check(whole_number());
  verb->add_option("--lio",
                   options->input.lio_file,
                   "TUM file in odom: steps are told beyond its own change")
      ->check(CLI::ExistingFile);
  verb->add_option(
          "--fixes", options->input.fixes_file, "fixes.csv of the session: errors in GPS outages")
      ->check(CLI::ExistingFile);
  verb->add_option(
          "--gap",
          options->largest_gap_s,
          "poses farther than this from the moment asked for are not interpolated, s: those "
          "of the reference, and of the estimate where fixes are the reference")
      ->capture_default_str()
      ->check(more_than_zero());
  verb->footer(
      "Errors are those of evo (APE, with the reference interpolated at the estimate's moments) "
      "and of KITTI (percent of segments of 10, 50 and 100 m; percent over 100 m are metres per "
      "100 m). Definitions: components/evaluation/README.md.");
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
