// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/report.hpp"

#include "pictures.hpp"
#include "report_sections.hpp"
#include "session_data.hpp"
#include "session_scores.hpp"

#include <filesystem>
#include <functional>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

using Draw = std::function<std::string(const SessionData&, const std::string& gnuplot)>;

void draw_all(const SessionData& data, const ReportOptions& options, ReportResult& result) {
  for (const Draw& draw :
       {Draw(draw_trajectories), Draw(draw_uncertainty), Draw(draw_scan_times)}) {
    try {
      result.pictures.push_back(draw(data, options.gnuplot));
    } catch (const std::exception& error) {
      result.problems.push_back(std::string(error.what()) + ".");
    }
  }
}

std::string print_problems(const std::vector<std::string>& problems) {
  std::string text;
  for (const auto& problem : problems) {
    text += "- " + problem + "\n";
  }
  return text.empty() ? text : "## Problems\n\n" + text + "\n";
}

std::string print_pictures(const std::vector<std::string>& pictures) {
  std::string text;
  for (const auto& picture : pictures) {
    const auto name = std::filesystem::path(picture).filename().string();
    text += "![" + name + "](" + name + ")\n\n";
  }
  return text.empty() ? text
                      : "## Pictures\n\n" + text +
                            "Scripts and data are in plots/; `cd plots && gnuplot "
                            "trajectories.gp` draws anew.\n";
}

}  // namespace

ReportResult write_report(const std::string& session_folder, const ReportOptions& options) {
  const auto data = load_session(session_folder, options);
  ReportResult result;
  result.problems = data.problems;
  if (options.pictures) {
    draw_all(data, options, result);
  }
  result.text = print_problems(result.problems) + print_run(data) + "\n## Errors\n\n" +
                print_scores(data, score_session(data)) + "\n" + print_alignment(data) + "\n" +
                print_gate(data) + "\n" + print_times(data) + "\n" + print_accounting(data) + "\n" +
                print_map(data);
  result.report_file = data.path(file::kReport);
  exporter::write_text(
      result.report_file,
      "# Session report\n\n" + result.text + "\n" + print_pictures(result.pictures));
  const bool has_trajectory = !data.fused.empty() || !data.lio.empty();
  result.complete = result.problems.empty() && has_trajectory;
  return result;
}

}  // namespace trigpoint::evaluation
