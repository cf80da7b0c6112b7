// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "report_page.hpp"

#include "gate_series.hpp"
#include "html.hpp"
#include "page_document.hpp"
#include "page_files.hpp"
#include "page_plots.hpp"
#include "page_scene.hpp"
#include "pictures.hpp"
#include "table.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

constexpr const char* kTimesTitle = "Times per scan";  ///< of the section of report.md

std::string name_of_session(const SessionData& data) {
  const auto path = std::filesystem::weakly_canonical(data.folder);
  return path.has_filename() ? path.filename().string() : path.parent_path().filename().string();
}

std::string tile(const std::string& value, const std::string& what, const std::string& more = "") {
  return "<div class=\"tile\"><b>" + html::escape(value) + "</b><span>" + html::escape(what) +
         "</span>" + (more.empty() ? "" : "<small>" + html::escape(more) + "</small>") + "</div>\n";
}

/// Of fused.tum without alignment, against the best reference that there is.
std::string error_tile(const PageContent& content) {
  for (const auto& block : content.scores) {
    for (const auto& evaluation : block.evaluations) {
      if (evaluation.estimate_name == file::kFused) {
        const auto& error = evaluation.scores.at(0).error.position_m;
        return tile(fixed(error.rmse, 3) + " m",
                    "RMSE of " + std::string(file::kFused),
                    "against " + block.reference_name + ", no alignment; at most " +
                        fixed(error.max, 3) + " m");
      }
    }
  }
  return tile("-", "RMSE", "there is nothing to measure against");
}

std::string outage_tile(const SessionData& data) {
  if (data.accepted_fixes_ns().empty()) {
    return tile("-", "GPS dropouts", "no fix was accepted");
  }
  double sum_s = 0.0;
  double longest_s = 0.0;
  const auto outages = data.outages();
  for (const auto& window : outages) {
    const double duration_s = to_seconds(window.end_ns - window.begin_ns);
    sum_s += duration_s;
    longest_s = std::max(longest_s, duration_s);
  }
  return outages.empty()
             ? tile("none", "GPS dropouts", "of more than 2 s")
             : tile(std::to_string(outages.size()),
                    outages.size() == 1 ? "GPS dropout" : "GPS dropouts",
                    fixed(sum_s, 1) + " s in all, longest " + fixed(longest_s, 1) + " s");
}

std::string tiles(const SessionData& data, const PageContent& content) {
  std::string text = error_tile(content);
  if (!data.lio.empty()) {
    text += tile(fixed(length_of(data.lio, data.odom_begins()), 1) + " m",
                 "driven",
                 fixed(data.driven_s(), 1) + " s");
  }
  text += outage_tile(data);
  if (!data.gate.empty()) {
    const GateTotals totals = totals_of(data.gate);
    text += tile(
        std::to_string(totals.fixes_used),
        "fixes used",
        "of " + std::to_string(totals.fixes_seen) + " seen, gate mode " + data.gate.back().mode);
  }
  if (data.run) {
    double data_s = 0.0;
    double wall_s = 0.0;
    for (const exporter::RunInfo& run : data.runs()) {
      data_s += run.wall_s > 0.0 ? run.data_s : 0.0;
      wall_s += run.wall_s;
    }
    text += wall_s > 0.0 ? tile(fixed(data_s / wall_s, 2) + " x",
                                "real time",
                                fixed(wall_s, 1) + " s of processing")
                         : tile("-", "real time", "not known: the run was killed");
  }
  return "<div class=\"tiles\">\n" + text + "</div>\n";
}

std::string note(const std::string& style,
                 const std::string& heading,
                 const std::vector<std::string>& sentences) {
  std::string items;
  for (const auto& sentence : sentences) {
    items += "<li>" + html::escape(sentence) + "</li>";
  }
  return items.empty() ? ""
                       : "<div class=\"note " + style + "\"><b>" + html::escape(heading) +
                             "</b><ul>" + items + "</ul></div>\n";
}

struct Part {
  std::string id;
  std::string title;
  std::string body;  ///< HTML
};

/// "## What the gate did" is what-the-gate-did.
std::string id_of(const std::string& title) {
  std::string id;
  for (const char c : title) {
    id += std::isalnum(static_cast<unsigned char>(c)) != 0
              ? static_cast<char>(std::tolower(static_cast<unsigned char>(c)))
              : '-';
  }
  return id;
}

/// A section of report.md; one without a heading is nothing.
Part part_of(const std::string& section) {
  const auto begin = section.find("## ");
  const auto end = section.find('\n', begin);
  if (begin == std::string::npos || end == std::string::npos) {
    return {};
  }
  const std::string title = section.substr(begin + 3, end - begin - 3);
  return {id_of(title), title, html::of_markdown(section.substr(end))};
}

std::string scene_part(const std::string& scene) {
  return page_files::kScene + scene;
}

std::vector<Part> parts_of(const SessionData& data,
                           const PageContent& content,
                           const PointCloud& map) {
  std::vector<Part> parts{
      {"trajectories", "Trajectories", plot_top_view(data, map)},
      {"map-3d", "Map in 3-D", ""},
      {"uncertainty", "Uncertainty and the gate", plot_uncertainty(data) + plot_verdicts(data)},
      {"over-time", "Height and error", plot_height(data) + plot_error(data)}};
  if (const auto scene = scene_of(data, map); !scene.empty()) {
    parts[1].body = scene_part(scene);
  }
  for (const auto& section : content.sections) {
    parts.push_back(part_of(section));
    if (parts.back().title == kTimesTitle) {
      parts.back().body += plot_scan_times(data);
    }
  }
  parts.erase(
      std::remove_if(parts.begin(), parts.end(), [](const Part& p) { return p.body.empty(); }),
      parts.end());
  return parts;
}

std::string subtitle(const SessionData& data) {
  std::string text;
  if (data.run) {
    text = "Log " + data.run->log +
           (data.run->data_s > 0.0 ? ", " + fixed(data.run->data_s, 1) + " s" : std::string()) +
           "; gate mode " + data.run->mode + ", GPS filter " + data.run->gps_filter + ". ";
  }
  return text + "t = 0 is " + exporter::stamp_text(data.span().begin_ns) +
         " s of the sensors' time.";
}

}  // namespace

std::string make_page(const SessionData& data, const PointCloud& map, const PageContent& content) {
  const std::string name = name_of_session(data);
  std::string nav;
  std::string body;
  for (const auto& part : parts_of(data, content, map)) {
    const std::string title = html::escape(part.title);
    nav += "<a href=\"#" + part.id + "\">" + title + "</a>";
    body +=
        "<section id=\"" + part.id + "\">\n<h2>" + title + "</h2>\n" + part.body + "</section>\n";
  }
  return html_of({name + " - Trigpoint session report",
                  "<header><p class=\"kind\">Trigpoint session report</p><h1>" +
                      html::escape(name) + "</h1>\n<p>" + html::escape(subtitle(data)) +
                      "</p>\n</header>\n<nav>" + nav + "</nav>\n<main>\n" +
                      note("failed", "Failed", content.failures) +
                      note("problem", "Problems", content.problems) + tiles(data, content) + body +
                      "</main>\n",
                  {page_files::kPlots, page_files::kMap3d}});
}

}  // namespace trigpoint::evaluation
