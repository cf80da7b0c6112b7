// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/gps_page.hpp"
#include "trigpoint/export/session.hpp"

#include "gnuplot.hpp"

#include <algorithm>
#include <array>
#include <sstream>
#include <vector>

namespace trigpoint::evaluation {

namespace {

constexpr int kGpsPageWidth_px = 1500;
constexpr int kGpsPanelHeight_px = 300;
constexpr int kAllHeight_px = 560;
constexpr double kSigmas = 3.0;
constexpr double kLeast_m = 1e-3;   // of the logarithmic scale
constexpr double kLinear_m = 0.03;  // about where the bands' scale turns from linear to logarithmic
constexpr std::array<const char*, 3> kAxes{"east", "north", "up"};
constexpr std::array<const char*, 4> kGpsPageColours{"#1f6fbf", "#2a9d4a", "#c0392b", "#7d3c98"};

DataFile rows_of(const FilterErrors& filter) {
  DataFile rows;
  for (const ErrorSample& sample : filter.samples) {
    const Eigen::Vector3d band = kSigmas * sample.sigma_m;
    rows.add({sample.time_s,
              sample.error_m.x(),
              sample.error_m.y(),
              sample.error_m.z(),
              band.x(),
              band.y(),
              band.z(),
              std::max(kLeast_m, sample.error_m.norm()),
              std::max(kLeast_m, band.norm())});
  }
  return rows;
}

/// The text of a gnuplot string in single quotes.
std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) {
    result += c;
    if (c == '\'') {
      result += c;
    }
  }
  return result + "'";
}

/// What all panels have: time axis, grid, the outage shaded.
std::string frame_of(const GpsPage& page) {
  double from_s = page.outage_from_s;
  double to_s = page.outage_to_s;
  for (const FilterErrors& filter : page.filters) {
    if (!filter.samples.empty()) {
      from_s = std::min(from_s, filter.samples.front().time_s);
      to_s = std::max(to_s, filter.samples.back().time_s);
    }
  }
  std::ostringstream text;
  text << "set xrange [" << from_s << ":" << to_s << "]\n"
       << "set grid lc rgb '#cccccc' lw 0.5\nset tics out nomirror\n"
       << "set object 1 rectangle from " << page.outage_from_s << ", graph 0 to "
       << page.outage_to_s << ", graph 1 fc rgb '#f3d9d9' fs solid noborder behind\n";
  return text.str();
}

/// One scale for all panels, linear about 0 and logarithmic outside, so that centimetres before an
/// outage and the tens of metres at its end are both seen, and filters can be compared.
std::string signed_logarithmic_scale(const GpsPage& page) {
  double most_m = 1.0;
  for (const FilterErrors& filter : page.filters) {
    for (const ErrorSample& sample : filter.samples) {
      most_m = std::max(
          {most_m, sample.error_m.cwiseAbs().maxCoeff(), kSigmas * sample.sigma_m.maxCoeff()});
    }
  }
  std::ostringstream text;
  text << "set nonlinear y via asinh(y/" << kLinear_m << ") inverse " << kLinear_m
       << "*sinh(y)\nset yrange [" << -1.3 * most_m << ":" << 1.3 * most_m << "]\nset ytics (0";
  for (double tic_m = 0.1; tic_m < 1.3 * most_m; tic_m *= 10.0) {
    text << ", " << tic_m << ", " << -tic_m;
  }
  text << ")\n";
  return text.str();
}

void draw_bands(const GpsPage& page, const std::string& folder, const std::string& gnuplot) {
  const Picture picture(folder + "/plots", "bands");
  const std::size_t columns = page.filters.size();
  std::vector<std::string> data;
  for (const FilterErrors& filter : page.filters) {
    data.push_back(picture.data("bands_" + filter.name + ".dat", rows_of(filter)));
  }
  std::ostringstream body;
  body << "set multiplot layout 3," << columns << " title "
       << quoted(page.title + ": error and 3 sigma band, outage shaded")
       << " noenhanced margins 0.055,0.99,0.07,0.9 spacing 0.035,0.03\n"
       << frame_of(page) << signed_logarithmic_scale(page);
  for (std::size_t axis = 0; axis < kAxes.size(); ++axis) {
    const bool is_lowest = axis + 1 == kAxes.size();
    for (std::size_t i = 0; i < columns; ++i) {
      body << (axis == 0
                   ? "set title " + quoted(page.filters[i].name) + " noenhanced offset 0,-0.5\n"
                   : "unset title\n")
           << (is_lowest ? "set format x '%g'\nset xlabel 'time since the start [s]'\n"
                         : "set format x ''\n")
           << (i == 0 ? std::string("set ylabel 'error ") + kAxes.at(axis) + " [m]' offset 1,0\n"
                      : "unset ylabel\n")
           << (axis == 0 && i == 0 ? "set key top left Left reverse opaque samplen 2\n"
                                   : "unset key\n")
           << "plot " << data[i] << " using 1:(-$" << 5 + axis << "):" << 5 + axis
           << " with filledcurves fs transparent solid 0.55 noborder lc rgb '#8fb8e0' "
              "title '3 sigma', \\\n     "
           << data[i] << " using 1:" << 2 + axis
           << " with lines lw 1.5 lc rgb '#12305c' title 'error'\n";
    }
  }
  body << "unset multiplot\n";
  picture.draw(gnuplot, kGpsPageWidth_px, 3 * kGpsPanelHeight_px, body.str());
}

void draw_all(const GpsPage& page, const std::string& folder, const std::string& gnuplot) {
  const Picture picture(folder + "/plots", "all");
  std::ostringstream body;
  body << "set title " << quoted(page.title + ": 3-D error and 3 sigma, outage shaded")
       << " noenhanced\n"
       << frame_of(page)
       << "set logscale y\nset format y '10^{%T}'\nset key outside right top Left reverse\n"
          "set ylabel '3-D position error [m]'\nset xlabel 'time since the start [s]'\nplot ";
  for (std::size_t i = 0; i < page.filters.size(); ++i) {
    const FilterErrors& filter = page.filters[i];
    const std::string data = picture.data("all_" + filter.name + ".dat", rows_of(filter));
    const char* colour = kGpsPageColours.at(i % kGpsPageColours.size());
    body << (i == 0 ? "" : ", \\\n     ") << data << " using 1:8 with lines lw 1.5 lc rgb '"
         << colour << "' title " << quoted(filter.name + " error") << " noenhanced, \\\n     "
         << data << " using 1:9 with lines lw 2 dt 2 lc rgb '" << colour << "' title "
         << quoted(filter.name + " 3 sigma") << " noenhanced";
  }
  body << "\n";
  picture.draw(gnuplot, kGpsPageWidth_px, kAllHeight_px, body.str());
}

std::string html_of(const GpsPage& page) {
  std::ostringstream html;
  html << "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" << page.title
       << "</title></head>\n<body style=\"font-family: sans-serif; margin: 1em\">\n<h1>"
       << page.title << "</h1>\n<p>No fixes from " << page.outage_from_s << " to "
       << page.outage_to_s << " s (shaded). Bands are three times the published sigma.</p>\n"
       << "<p><img src=\"bands.png\" alt=\"error and 3 sigma band of every filter and axis\"></p>\n"
       << "<p>The scale is linear about 0 and logarithmic outside; it is the same in all "
          "panels.</p>\n<p><img src=\"all.png\" alt=\"3-D errors of all filters\"></p>\n"
       << "</body></html>\n";
  return html.str();
}

}  // namespace

std::string draw_gps_page(const GpsPage& page,
                          const std::string& folder,
                          const std::string& gnuplot) {
  draw_bands(page, folder, gnuplot);
  draw_all(page, folder, gnuplot);
  const std::string file = exporter::path_in(folder, "index.html");
  exporter::write_text(file, html_of(page));
  return file;
}

}  // namespace trigpoint::evaluation
