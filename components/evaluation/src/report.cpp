// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/report.hpp"

#include "gate_series.hpp"
#include "pictures.hpp"
#include "report_page.hpp"
#include "report_sections.hpp"
#include "session_data.hpp"
#include "session_map.hpp"
#include "session_scores.hpp"

#include <algorithm>
#include <filesystem>
#include <functional>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

using Draw = std::function<std::string(const SessionData&, const std::string& gnuplot)>;

void draw_all(const SessionData& data,
              const PointCloud& map,
              const ReportOptions& options,
              ReportResult& result) {
  const Draw trajectories = [&](const SessionData& session, const std::string& gnuplot) {
    return draw_trajectories(session, map, gnuplot);
  };
  for (const Draw& draw : {trajectories, Draw(draw_uncertainty), Draw(draw_scan_times)}) {
    try {
      result.pictures.push_back(draw(data, options.gnuplot));
    } catch (const std::exception& error) {
      result.problems.push_back(std::string(error.what()) + ".");
    }
  }
}

std::string print_list(const std::string& heading, const std::vector<std::string>& sentences) {
  std::string text;
  for (const auto& sentence : sentences) {
    text += "- " + sentence + "\n";
  }
  return text.empty() ? text : "## " + heading + "\n\n" + text + "\n";
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

void write_page(const SessionData& data,
                const PointCloud& map,
                const PageContent& content,
                ReportResult& result) {
  const std::string path = data.path(kReportPage);
  try {
    exporter::write_text(path, make_page(data, map, content));
    result.page_file = path;
  } catch (const std::exception& error) {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);  // an old one is not a new one
    result.problems.push_back(std::string(error.what()) + ".");
  }
}

std::string print_page(const ReportResult& result) {
  return result.page_file.empty() ? ""
                                  : "[" + std::string(kReportPage) + "](" + kReportPage +
                                        ") has the same on one page, with the map in 3-D.\n";
}

std::string joined(const std::vector<std::string>& sections) {
  std::string text;
  for (const auto& section : sections) {
    text += (text.empty() ? "" : "\n") + section;
  }
  return text;
}

/// What the gate refused most fixes for, when it used none of them; empty when it used some.
std::string refusal_of_all(const SessionData& data) {
  const GateTotals totals = totals_of(data.gate);
  if (totals.fixes_seen == 0 || totals.fixes_used > 0) {
    return "";
  }
  const auto& verdicts = totals.verdicts;
  const auto most = std::max_element(
      verdicts.begin(), verdicts.end(), [](auto& a, auto& b) { return a.count < b.count; });
  return "None of " + std::to_string(totals.fixes_seen) + " fixes was used" +
         (most == verdicts.end()
              ? std::string(".")
              : ", most often because: " + most->name + " (" + std::to_string(most->count) + ").");
}

/// Of an odom epoch that was not aligned the map holds nothing; empty when the last one was.
std::string unaligned_end(const SessionData& data) {
  if (data.scans.empty()) {
    return "";
  }
  const std::uint32_t epoch = data.scans.back().status.odom_epoch;
  std::size_t scans = 0;
  for (const auto& scan : data.scans) {
    if (scan.status.odom_epoch == epoch) {
      ++scans;
      if (scan.status.aligned) {
        return "";
      }
    }
  }
  return "The drive ended in odom epoch " + std::to_string(epoch) +
         ", which was not aligned with map: " +
         (scans == 1 ? "its one scan is" : "its " + std::to_string(scans) + " scans are") +
         " left out of the map.";
}

/// Fixes that no alignment came of are a failure; without fixes nobody expects one.
std::vector<std::string> find_failures(const SessionData& data,
                                       const Accounting& found,
                                       const std::vector<MissedScans>& missed) {
  std::vector<std::string> failures;
  if (std::string lost = lost_end(data, missed); !lost.empty() && !data.interrupted()) {
    failures.push_back(std::move(lost));
  }
  // What was on its way while a process was down is listed under Restarts; no restart brings more.
  if (!found.surplus.empty() && !data.interrupted()) {
    failures.push_back("More came than the drive published: " + found.surplus.front() +
                       (found.surplus.size() > 1 ? ", and more (see Messages)." : ".") +
                       " Somebody else published it, too.");
  } else if (!found.losses.empty() && !data.interrupted() && data.restarts.empty()) {
    failures.push_back("Not all messages are accounted for: " + found.losses.front() +
                       (found.losses.size() > 1 ? ", and more (see Messages)." : "."));
  }
  const bool lio_only = data.run && data.run->mode == "lio";
  const bool admitted = data.alignment && data.alignment->admitted;
  const bool was_admitted = data.alignment && data.alignment->was_admitted;
  if (!lio_only && was_admitted && data.fixes_fed() > 0) {
    if (std::string end = unaligned_end(data); !end.empty()) {
      failures.push_back(std::move(end));
    }
  } else if (!lio_only && !admitted && data.fixes_fed() > 0) {
    failures.push_back("No alignment of odom with map was admitted although there were " +
                       std::to_string(data.fixes_fed()) +
                       " fixes: the map is not georeferenced reliably.");
  }
  if (const std::string refusal = refusal_of_all(data); !lio_only && !refusal.empty()) {
    failures.push_back(refusal);
  }
  if (data.fused.empty() && !(lio_only && data.fixes_fed() == 0)) {
    failures.push_back(std::string(file::kFused) + " is empty: nothing was published in map.");
  }
  return failures;
}

}  // namespace

ReportResult write_report(const std::string& session_folder, const ReportOptions& options) {
  const auto data = load_session(session_folder, options);
  ReportResult result;
  result.problems = data.problems;
  const SessionMap map = read_map(data);
  if (!map.problem.empty()) {
    result.problems.push_back(map.problem + ".");
  }
  const PointCloud& shown = map_under(data, map);
  const Accounting found = account(data);
  const std::vector<MissedScans> missed = missed_scans_of(data);
  result.failures = options.failures;
  for (std::string& failure : find_failures(data, found, missed)) {
    result.failures.push_back(std::move(failure));
  }
  if (options.pictures) {
    draw_all(data, shown, options, result);
  }
  const auto scores = score_session(data);
  std::vector<std::string> sections{print_run(data),
                                    print_restarts(data, missed),
                                    "## Errors\n\n" + print_scores(data, scores),
                                    print_alignment(data),
                                    print_gate(data),
                                    print_times(data),
                                    print_accounting(data, found),
                                    print_map(data, map)};
  std::erase(sections, "");
  if (options.page) {
    write_page(data, shown, {scores, sections, result.problems, result.failures}, result);
  }
  result.text = print_list("Failed", result.failures) + print_list("Problems", result.problems) +
                joined(sections);
  result.report_file = data.path(file::kReport);
  exporter::write_text(result.report_file,
                       "# Session report\n\n" + result.text + "\n" +
                           print_pictures(result.pictures) + print_page(result));
  const bool has_trajectory = !data.fused.empty() || !data.lio.empty();
  result.complete = result.problems.empty() && has_trajectory;
  return result;
}

}  // namespace trigpoint::evaluation
