// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The comparison of the paper that this project implements (S. Hossain, X. Lin, "Uncertainty-Aware
// Tightly-Coupled GPS Fused LIO-SLAM", arXiv:2209.10047, 2022; its Table I and Figures 7 to 11) on
// sessions of the same drives in every mode of the gate: the verb `trigpoint reproduce`.
#pragma once

#include "trigpoint/evaluation/continuity.hpp"
#include "trigpoint/evaluation/evaluate.hpp"

#include <optional>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// A row of the paper's Table I: RMSE "with respect to GPS", m. Alignment, axes and samples are not
/// stated there.
struct PaperRow {
  const char* dataset;
  double lio_sam_m;
  double fast_lio_m;
  double ours_m;  ///< LIO-FUSION with uncertainty
};

const std::vector<PaperRow>& paper_table();

/// What the paper calls a mode of the gate; empty when it has no such method.
std::string paper_name_of(const std::string& mode);

/// The sessions of one mode on one drive.
struct ModeSessions {
  std::string mode;
  std::string fed;       ///< every fix was given to the filters
  std::string withheld;  ///< stretches of them were not; empty: there is no such run
};

struct ReproducedDrive {
  std::string name;           ///< "campus": also the folder of its pictures
  std::string source;         ///< what was driven, in words
  std::string paper_dataset;  ///< row of the paper's table beside it; empty: none
  bool is_paper_data{false};  ///< that recording itself, not a drive in its stead
  std::vector<ModeSessions> modes;
};

/// fused.tum of one mode against what there is; nullopt: there is no such reference, or nothing was
/// published in map.
struct ModeFigures {
  std::string mode;
  std::optional<Evaluation> fixes_fed;       ///< circular: the fixes that the filters were given
  std::optional<Evaluation> fixes_withheld;  ///< of the other run, which was not given them
  std::optional<Evaluation> truth;           ///< of the run with every fix
  std::optional<Evaluation> truth_withheld;  ///< of the run without the withheld ones
};

struct DriveFigures {
  ReproducedDrive drive;
  std::vector<ModeFigures> modes;
  std::vector<Window> dropouts;       ///< of accepted fixes, in the runs with every fix
  std::vector<std::string> pictures;  ///< paths relative to the folder of the result
  std::vector<std::string> problems;  ///< a sentence each
};

/// Reads the sessions and scores them. What cannot be scored is a problem.
DriveFigures score(const ReproducedDrive& drive);

/// trajectories.png (Fig. 7 to 10) and uncertainty.png (Fig. 11) in FOLDER/NAME of the drive, added
/// to its pictures; what cannot be drawn is a problem.
void draw(DriveFigures& figures, const std::string& folder, const std::string& gnuplot = "gnuplot");

struct Reproduction {
  std::string how;  ///< command and settings, in words
  std::vector<DriveFigures> drives;
  std::vector<std::string> missing;  ///< drives that are not done (yet); not empty: incomplete
};

/// Why a mode or drive is no success: nothing scored, a picture missing. One sentence each.
std::vector<std::string> failures_of(const Reproduction& result);

/// Markdown that also reads well in a terminal.
std::string print(const Reproduction& result);
/// A line a figure: drive, mode, reference, alignment, axes, samples, coverage, RMSE.
std::string to_csv(const Reproduction& result);
/// Every figure with all its digits; `complete` is false while a drive is missing.
std::string to_json(const Reproduction& result);

/// Replaces reproduction.md, .html, .csv and .json in `folder`. The page holds its pictures. Throws
/// std::runtime_error naming the file that the disk refused.
void write(const Reproduction& result, const std::string& folder);

}  // namespace trigpoint::evaluation
