// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "html.hpp"
#include "json.hpp"
#include "page_document.hpp"
#include "reproduction.hpp"
#include "table.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iterator>

namespace trigpoint::evaluation {

namespace {

/// Less than this share of the larger figure is called no difference.
constexpr double kNoDifference = 0.05;

const ModeFigures* mode_of(const DriveFigures& drive, const std::string& mode) {
  const auto found = std::find_if(
      drive.modes.begin(), drive.modes.end(), [&](const auto& each) { return each.mode == mode; });
  return found == drive.modes.end() ? nullptr : &*found;
}

const PaperRow* paper_row(const DriveFigures& drive) {
  const auto& rows = paper_table();
  const auto found = std::find_if(rows.begin(), rows.end(), [&](const PaperRow& row) {
    return row.dataset == drive.drive.paper_dataset;
  });
  return found == rows.end() ? nullptr : &*found;
}

double paper_figure(const PaperRow& row, const std::string& mode) {
  return mode == "lio" ? row.fast_lio_m : mode == "literal" ? row.ours_m : kNaN;
}

std::string column_of(const std::string& mode) {
  const std::string name = paper_name_of(mode);
  return "`" + mode + "`" + (name.empty() ? "" : " = " + name);
}

bool has(const DriveFigures& drive, const Against& against) {
  return std::any_of(drive.modes.begin(), drive.modes.end(), [&](const ModeFigures& mode) {
    return (mode.*against.evaluation).has_value();
  });
}

std::vector<std::string> row_of_samples(const DriveFigures& drive, const Against& against) {
  std::vector<std::string> cells{std::string(against.name) + ": samples (of whole reference)", ""};
  for (const ModeFigures& mode : drive.modes) {
    const auto& evaluation = mode.*against.evaluation;
    cells.push_back(evaluation ? std::to_string(evaluation->pairs) + " (" +
                                     share(evaluation->coverage.whole) + ")"
                               : "-");
  }
  return cells;
}

/// Error in GPS dropouts: the largest of the drive's.
std::vector<std::string> row_of_dropouts(const DriveFigures& drive) {
  std::vector<std::string> cells{"truth, largest error in a dropout, no alignment, xyz", ""};
  for (const ModeFigures& mode : drive.modes) {
    double worst_m = kNaN;
    if (mode.truth) {
      for (const OutageError& outage : mode.truth->outages) {
        worst_m = std::fmax(worst_m, outage.max_m);
      }
    }
    cells.push_back(fixed(worst_m, 3));
  }
  return cells;
}

std::string table_of(const DriveFigures& drive) {
  std::vector<std::string> head{"RMSE, m", "LIO-SAM"};
  for (const ModeFigures& mode : drive.modes) {
    head.push_back(column_of(mode.mode));
  }
  Table table(head);
  if (const PaperRow* row = paper_row(drive)) {
    std::vector<std::string> cells{std::string("paper, ") + row->dataset + ": GPS as fed",
                                   fixed(row->lio_sam_m, 2)};
    for (const ModeFigures& mode : drive.modes) {
      cells.push_back(fixed(paper_figure(*row, mode.mode), 2));
    }
    table.add(cells);
  }
  for (const Against& against : kAgainst) {
    if (!has(drive, against)) {
      continue;
    }
    for (const AlignmentKind kind : kShown) {
      for (const bool horizontal : {false, true}) {
        std::vector<std::string> cells{
            std::string(against.name) + ", " +
                (kind == AlignmentKind::kNone ? "no alignment" : name_of(kind)) + ", " +
                (horizontal ? "xy" : "xyz"),
            ""};
        for (const ModeFigures& mode : drive.modes) {
          cells.push_back(fixed(rmse_of(mode.*against.evaluation, kind, horizontal), 3));
        }
        table.add(cells);
      }
    }
    table.add(row_of_samples(drive, against));
  }
  if (has(drive, kAgainst[2]) && !drive.dropouts.empty()) {
    table.add(row_of_dropouts(drive));
  }
  return table.str();
}

/// Is the figure of `better` the smaller one?
std::string verdict(double better_m, double other_m) {
  if (!std::isfinite(better_m) || !std::isfinite(other_m)) {
    return "-";
  }
  const double difference_m = better_m - other_m;
  const bool is_none = std::abs(difference_m) <= kNoDifference * std::max(better_m, other_m);
  return std::string(is_none            ? "no difference"
                     : difference_m < 0 ? "holds"
                                        : "does NOT hold") +
         " (" + fixed(better_m, 3) + " to " + fixed(other_m, 3) + ")";
}

struct Claim {
  const char* words;
  const char* better;
  const char* other;
};

/// The paper's words fit two readings: the assignment as printed, and its rule on rows of a filter.
constexpr std::array<Claim, 7> kClaims{
    {{"paper, as printed: its method is below FAST-LIO", "literal", "lio"},
     {"paper, rule on rows: the same", "hard", "lio"},
     {"paper: GPS without a gate is below FAST-LIO", "fusion", "lio"},
     {"paper, as printed: its gate is below none", "literal", "fusion"},
     {"paper, rule on rows: the same", "hard", "fusion"},
     {"ours: the default is below the printed method", "smooth", "literal"},
     {"ours: the default is below the rule on rows", "smooth", "hard"}}};

std::string claims_of(const DriveFigures& drive) {
  std::vector<std::string> head{"claim"};
  std::vector<Against> columns;
  for (const Against& against : kAgainst) {
    if (has(drive, against)) {
      head.push_back(std::string("against ") + against.name);
      columns.push_back(against);
    }
  }
  Table table(head);
  for (const Claim& claim : kClaims) {
    const ModeFigures* better = mode_of(drive, claim.better);
    const ModeFigures* other = mode_of(drive, claim.other);
    if (better == nullptr || other == nullptr) {
      continue;
    }
    std::vector<std::string> cells{std::string(claim.words) + " (`" + claim.better + "` to `" +
                                   claim.other + "`)"};
    for (const Against& against : columns) {
      cells.push_back(verdict(rmse_of(better->*against.evaluation, AlignmentKind::kNone, false),
                              rmse_of(other->*against.evaluation, AlignmentKind::kNone, false)));
    }
    table.add(cells);
  }
  return table.is_empty() ? ""
                          : "\nWhat can be read off, by the RMSE without alignment over xyz, to "
                            "within 5 %:\n\n" +
                                table.str();
}

std::string dropouts_of(const DriveFigures& drive) {
  if (drive.dropouts.empty()) {
    return "No GPS dropout of more than 2 s.";
  }
  std::string text = "GPS dropouts: " + std::to_string(drive.dropouts.size()) + ", of";
  for (const Window& window : drive.dropouts) {
    text += " " + fixed(to_seconds(window.end_ns - window.begin_ns), 1) + " s";
  }
  return text + ".";
}

std::string modes_listed(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) {
    text += "- " + sentence + "\n";
  }
  return text.empty() ? "" : text + "\n";
}

std::string section_of(const DriveFigures& drive) {
  const ReproducedDrive& about = drive.drive;
  std::string text = "## " + about.name + "\n\n" + about.source + " " + dropouts_of(drive) + "\n";
  if (!about.paper_dataset.empty() && !about.is_paper_data) {
    text += "The paper's row is of its own recording, " + about.paper_dataset +
            ", of which this drive is no copy: read the order of the columns, not the size.\n";
  }
  text += "\n" + table_of(drive) + claims_of(drive) + "\n";
  return text + (drive.problems.empty() ? "" : "**Problems**\n\n" + modes_listed(drive.problems));
}

constexpr const char* kExplained =
    "Every figure is the RMSE of `fused.tum`, what was published while driving, from the first "
    "alignment on. "
    "The paper prints RMSE \"with respect to GPS\" and does not say how it aligned, whether z is "
    "in, or which "
    "samples it took, so each is shown.\n\n"
    "- **GPS as fed** is the paper's measure: at every fix of the log, the antenna against the "
    "fix. The filters were "
    "given these fixes, so it measures obedience to GPS, not accuracy, and a method that copies "
    "GPS scores 0.\n"
    "- **withheld GPS**: stretches of fixes that nobody was given, in a second run. Their own "
    "error is in the figure.\n"
    "- **truth** (simulated drives): base_link at every published pose.\n"
    "- **no alignment**: as published in `map`; `lio` was placed there once, by the fixes of its "
    "first metres. "
    "**yaw + translation**: turned and moved onto the reference as a whole before scoring, which "
    "favours a drift.\n"
    "- LIO-SAM was not run; its column is the paper's.\n\n";

std::string incomplete(const Reproduction& result) {
  if (result.missing.empty()) {
    return "";
  }
  std::string names;
  for (const std::string& name : result.missing) {
    names += (names.empty() ? "" : ", ") + name;
  }
  return "**INCOMPLETE: not done (yet): " + names + ".**\n\n";
}

std::string beginning(const Reproduction& result) {
  return "# The paper's comparison, reproduced\n\n" + incomplete(result) + result.how + "\n\n" +
         kExplained;
}

std::string data_url(const std::string& png) {
  std::ifstream in(png, std::ios::binary);
  const std::vector<char> bytes((std::istreambuf_iterator<char>(in)),
                                std::istreambuf_iterator<char>());
  return "data:image/png;base64," + html::base64(bytes);
}

std::string page_of(const Reproduction& result, const std::string& folder) {
  std::string body = html::of_markdown(beginning(result));
  for (const DriveFigures& drive : result.drives) {
    body += html::of_markdown(section_of(drive));
    for (const std::string& picture : drive.pictures) {
      body += "<figure><img alt=\"" + html::escape(picture) + "\" style=\"max-width:100%\" src=\"" +
              data_url(exporter::path_in(folder, picture)) + "\"/></figure>\n";
    }
  }
  return html_of({"The paper's comparison - Trigpoint", "<main>\n" + body + "</main>\n", {}});
}

std::string json_of(const Evaluation& evaluation) {
  json::Object object;
  object.add("samples", json::number(static_cast<std::uint64_t>(evaluation.pairs)))
      .add("coverage_whole", json::number(evaluation.coverage.whole))
      .add("coverage_from_first", json::number(evaluation.coverage.from_first));
  for (const AlignmentKind kind : kShown) {
    const AbsoluteError& error = score_of(evaluation, kind).error;
    object.add(kind == AlignmentKind::kNone ? "none" : "yaw_translation",
               json::Object()
                   .add("rmse_xyz_m", json::number(error.position_m.rmse))
                   .add("rmse_xy_m", json::number(error.horizontal_m.rmse))
                   .add("rmse_east_m", json::number(error.axes_m[0].rmse))
                   .add("rmse_north_m", json::number(error.axes_m[1].rmse))
                   .add("rmse_up_m", json::number(error.axes_m[2].rmse))
                   .add("median_xyz_m", json::number(error.position_m.median))
                   .add("max_xyz_m", json::number(error.position_m.max))
                   .str());
  }
  return object.str();
}

std::string json_of(const ModeFigures& mode) {
  json::Object object;
  object.add("mode", json::text(mode.mode)).add("paper_name", json::text(paper_name_of(mode.mode)));
  for (const Against& against : kAgainst) {
    const auto& evaluation = mode.*against.evaluation;
    object.add(against.key, evaluation ? json_of(*evaluation) : "null");
  }
  return object.str();
}

std::string json_of(const DriveFigures& drive) {
  std::vector<std::string> modes;
  for (const ModeFigures& mode : drive.modes) {
    modes.push_back("\n   " + json_of(mode));
  }
  std::vector<std::string> dropouts;
  for (const Window& window : drive.dropouts) {
    dropouts.push_back(json::array({json::number(window.begin_ns), json::number(window.end_ns)}));
  }
  std::vector<std::string> problems;
  for (const std::string& problem : drive.problems) {
    problems.push_back(json::text(problem));
  }
  const PaperRow* row = paper_row(drive);
  return json::Object()
      .add("drive", json::text(drive.drive.name))
      .add("source", json::text(drive.drive.source))
      .add("is_paper_data", drive.drive.is_paper_data ? "true" : "false")
      .add("paper",
           row == nullptr ? "null"
                          : json::Object()
                                .add("dataset", json::text(row->dataset))
                                .add("lio_sam_m", json::number(row->lio_sam_m))
                                .add("fast_lio_m", json::number(row->fast_lio_m))
                                .add("ours_m", json::number(row->ours_m))
                                .str())
      .add("dropouts_ns", json::array(dropouts))
      .add("modes", json::array(modes))
      .add("problems", json::array(problems))
      .str();
}

}  // namespace

std::string print(const Reproduction& result) {
  std::string text = beginning(result);
  for (const DriveFigures& drive : result.drives) {
    text += section_of(drive);
    for (const std::string& picture : drive.pictures) {
      text += "![" + picture + "](" + picture + ")\n\n";
    }
  }
  return text;
}

std::string to_csv(const Reproduction& result) {
  std::string text =
      "drive,mode,paper_name,reference,alignment,axes,samples,coverage_whole,rmse_m\n";
  for (const DriveFigures& drive : result.drives) {
    for (const ModeFigures& mode : drive.modes) {
      for (const Against& against : kAgainst) {
        const auto& evaluation = mode.*against.evaluation;
        for (const AlignmentKind kind : kShown) {
          for (const bool horizontal : {false, true}) {
            if (evaluation) {
              text += drive.drive.name + "," + mode.mode + "," + paper_name_of(mode.mode) + "," +
                      against.key + "," + name_of(kind) + "," + (horizontal ? "xy" : "xyz") + "," +
                      std::to_string(evaluation->pairs) + "," +
                      json::number(evaluation->coverage.whole) + "," +
                      json::number(rmse_of(evaluation, kind, horizontal)) + "\n";
            }
          }
        }
      }
    }
  }
  return text;
}

std::string to_json(const Reproduction& result) {
  std::vector<std::string> drives;
  for (const DriveFigures& drive : result.drives) {
    drives.push_back("\n  " + json_of(drive));
  }
  std::vector<std::string> missing;
  for (const std::string& name : result.missing) {
    missing.push_back(json::text(name));
  }
  return json::Object()
             .add("complete", result.missing.empty() ? "true" : "false")
             .add("missing", json::array(missing))
             .add("how", json::text(result.how))
             .add("drives", json::array(drives))
             .str() +
         "\n";
}

void write(const Reproduction& result, const std::string& folder) {
  exporter::create_session_folder(folder);
  exporter::write_text(exporter::path_in(folder, "reproduction.md"), print(result));
  exporter::write_text(exporter::path_in(folder, "reproduction.html"), page_of(result, folder));
  exporter::write_text(exporter::path_in(folder, "reproduction.csv"), to_csv(result));
  exporter::write_text(exporter::path_in(folder, "reproduction.json"), to_json(result));
}

}  // namespace trigpoint::evaluation
