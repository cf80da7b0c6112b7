// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/shell/stop_signal.hpp"

#include "input.hpp"
#include "interruption.hpp"
#include "number_checks.hpp"
#include "progress.hpp"
#include "verbs.hpp"

#include <iostream>
#include <memory>
#include <string>

namespace trigpoint::cli {

namespace {

struct MergeOptions {
  std::string first;
  std::string second;
  std::string out;
  double voxel_m{0.1};
};

int run(const MergeOptions& options) {
  refuse_used_folder(options.out);
  exporter::MergeReport report;
  try {
    const shell::StopSignal stop;
    Progress progress("merging");
    report = exporter::merge_sessions(
        options.first, options.second, options.out, options.voxel_m, [&](double share) {
          if (stop.requested()) {
            throw Interrupted();
          }
          progress(share);
        });
  } catch (const Interrupted&) {
    std::cerr << "trigpoint merge: interrupted; nothing of it is left in " << options.out << "\n";
    return kInterrupted;
  }
  std::cout << report.graph.keyframes << " keyframes, " << report.graph.rows << " GPS rows, "
            << report.graph.loops << " loop closures, " << report.loops_between
            << " of them between the sessions; map and trajectories are in " << options.out << "\n";
  if (report.loops_between == 0) {
    std::cerr << "trigpoint merge: the sessions never meet: they lie beside each other by GPS "
                 "alone\n";
  }
  return 0;
}

}  // namespace

void add_merge(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand(
      "merge", "One map of two independent sessions, in the frame of the first one's datum");
  const auto options = std::make_shared<MergeOptions>();
  verb->add_option("FIRST", options->first, "session whose datum is kept")
      ->required()
      ->check(CLI::ExistingDirectory);
  verb->add_option("SECOND", options->second, "session that is brought to it")
      ->required()
      ->check(CLI::ExistingDirectory);
  verb->add_option("--out", options->out, "folder, created when missing")->required();
  verb->add_option("--voxel", options->voxel_m, "cell size of the map, m")
      ->capture_default_str()
      ->check(more_than_zero());
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
