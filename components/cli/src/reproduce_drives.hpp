// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The drives of `trigpoint reproduce`: which log, with which configuration, in which mode.
#pragma once

#include "trigpoint/evaluation/reproduction.hpp"
#include "trigpoint/pipeline/map_log.hpp"
#include "trigpoint/recording/fix_withholding.hpp"

#include "input.hpp"

#include <string>
#include <vector>

namespace trigpoint::cli {

struct ReproduceOptions {
  std::string out{"reproduction"};
  std::vector<std::string> drives{"campus", "park"};  ///< scenarios
  std::vector<std::string> modes{"lio", "fusion", "literal", "hard", "smooth"};
  std::string park;          ///< LIO-SAM's bag
  std::string small_campus;  ///< LIO-SAM's bag
  bool no_simulated{false};
  std::uint64_t seed{1};
  bool quick{false};
  double duration_s{0.0};  ///< of each drive; 0: all of it
  std::vector<std::string> config_files;
  bool published_ekf{false};
  double withhold_every_s{40.0};
  double withhold_for_s{10.0};
  bool no_withheld{false};
  bool keep_keyframes{false};
};

/// A drive to come: what it is, and how its log is opened.
struct DriveToRun {
  evaluation::ReproducedDrive about;
  InputOptions input;
};

/// A shipped preset by its name without .yaml, in TRIGPOINT_PRESETS (environment), the source tree
/// of the build or the installed share folder. Throws ConfigError when there is none.
std::string preset_file(const std::string& name);

/// In the order of the table: the scenarios, then the bags. Throws ConfigError when the options
/// contradict each other, and what open_input throws: every log is opened once, so what is wrong
/// with any shows before the first is driven. Nothing is written.
std::vector<DriveToRun> drives_of(const ReproduceOptions& options);

/// What happens in the runs of a drive, in the order of `about.modes`, each with every fix and then
/// without some.
std::vector<pipeline::RunOfMany> runs_of(const DriveToRun& drive,
                                         const SystemConfig& config,
                                         const recording::FixWithholding& withholding);

}  // namespace trigpoint::cli
