// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/evaluation/comparison.hpp"
#include "trigpoint/export/session.hpp"

#include "number_checks.hpp"
#include "verbs.hpp"

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
};

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
  const evaluation::Comparison comparison = evaluation::compare(options.input);
  std::cout << evaluation::print(comparison);
  if (!options.json_file.empty()) {
    exporter::write_text(options.json_file, evaluation::to_json(comparison));
  }
  if (!options.plots_folder.empty()) {
    for (const std::string& picture : evaluation::draw(comparison, options.plots_folder)) {
      std::cout << picture << "\n";
    }
  }
  return 0;
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
  verb->add_option("--lio",
                   options->input.lio_file,
                   "TUM file in odom: steps are told beyond its own change")
      ->check(CLI::ExistingFile);
  verb->add_option(
          "--fixes", options->input.fixes_file, "fixes.csv of the session: errors in GPS outages")
      ->check(CLI::ExistingFile);
  verb->add_option("--gap",
                   options->largest_gap_s,
                   "poses of the reference farther than this from an estimate's moment are not "
                   "interpolated, s")
      ->capture_default_str()
      ->check(more_than_zero());
  verb->footer(
      "Errors are those of evo (APE, with the reference interpolated at the estimate's moments) "
      "and of KITTI (percent of segments of 10, 50 and 100 m; percent over 100 m are metres per "
      "100 m). Definitions: components/evaluation/README.md.");
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
