// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/gps_page.hpp"
#include "trigpoint/export/session.hpp"

#include "gnuplot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

namespace trigpoint::evaluation {

namespace {

constexpr int kWidth_px = 1200;
constexpr int kPanelHeight_px = 240;
constexpr double kSigmas = 3.0;
constexpr double kLeast_m = 1e-3;  // of the logarithmic scale
constexpr std::array<const char*, 3> kAxes{"east", "north", "up"};
constexpr std::array<const char*, 4> kColours{"#1f6fbf", "#2a9d4a", "#c0392b", "#7d3c98"};

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

std::string frame_of(const GpsPage& page, int panels, const std::string& title) {
  double from_s = page.outage_from_s;
  double to_s = page.outage_to_s;
  for (const FilterErrors& filter : page.filters) {
    if (!filter.samples.empty()) {
      from_s = std::min(from_s, filter.samples.front().time_s);
      to_s = std::max(to_s, filter.samples.back().time_s);
    }
  }
  std::ostringstream text;
  text << "set multiplot layout " << panels << ",1 title '" << title
       << "' margins 0.08,0.8,0.09,0.93 spacing 0.04\n"
       << "set xrange [" << from_s << ":" << to_s << "]\n"
       << "set grid lc rgb '#dddddd'\nset tics out nomirror\n"
       << "set key outside right top Left reverse samplen 2\nset format x ''\n"
       << "set object 1 rectangle from " << page.outage_from_s << ", graph 0 to "
       << page.outage_to_s << ", graph 1 fc rgb '#f6e3e3' fs solid noborder behind\n";
  return text.str();
}

/// The band is clipped to what the errors need, so that a wide one does not flatten the curve.
std::string axis_range(const FilterErrors& filter, Eigen::Index axis) {
  double most_m = 0.05;
  double band_m = 0.05;
  for (const ErrorSample& sample : filter.samples) {
    most_m = std::max(most_m, std::abs(sample.error_m(axis)));
    band_m = std::max(band_m, kSigmas * sample.sigma_m(axis));
  }
  const double range_m = std::min(1.05 * std::max(most_m, band_m), 6.0 * most_m);
  return "set yrange [" + std::to_string(-range_m) + ":" + std::to_string(range_m) + "]\n";
}

void draw_filter(const GpsPage& page,
                 const FilterErrors& filter,
                 const std::string& folder,
                 const std::string& gnuplot) {
  const Picture picture(folder + "/plots", filter.name);
  const std::string data = picture.data(filter.name + ".dat", rows_of(filter));
  std::ostringstream body;
  body << frame_of(page, 3, filter.name + ": error and 3 sigma") << "set style fill solid 1.0\n";
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const char* name = kAxes.at(static_cast<std::size_t>(axis));
    body << axis_range(filter, axis) << "set ylabel '" << name << " [m]'\n";
    if (axis == 2) {
      body << "set format x '%g'\nset xlabel 'time [s]'\n";
    }
    body << "plot " << data << " using 1:(-$" << 5 + axis << "):" << 5 + axis
         << " with filledcurves lc rgb '#c9ddf2' title '3 sigma', \\\n     " << data
         << " using 1:" << 2 + axis << " with lines lw 1.5 lc rgb '#1f3f6f' title 'error'\n";
  }
  body << "unset multiplot\n";
  picture.draw(gnuplot, kWidth_px, 3 * kPanelHeight_px, body.str());
}

void draw_all(const GpsPage& page, const std::string& folder, const std::string& gnuplot) {
  const Picture picture(folder + "/plots", "all");
  std::ostringstream body;
  body << frame_of(page, 1, "All filters: 3-D error (line) and 3 sigma (dashed)")
       << "set logscale y\nset ylabel '[m]'\nset format x '%g'\nset xlabel 'time [s]'\nplot ";
  for (std::size_t i = 0; i < page.filters.size(); ++i) {
    const FilterErrors& filter = page.filters[i];
    const std::string data = picture.data("all_" + filter.name + ".dat", rows_of(filter));
    const char* colour = kColours.at(i % kColours.size());
    body << (i == 0 ? "" : ", \\\n     ") << data << " using 1:8 with lines lw 1.5 lc rgb '"
         << colour << "' title '" << filter.name << "' noenhanced, \\\n     " << data
         << " using 1:9 with lines lw 1.5 dt 2 lc rgb '" << colour << "' notitle";
  }
  body << "\nunset multiplot\n";
  picture.draw(gnuplot, kWidth_px, 2 * kPanelHeight_px, body.str());
}

std::string html_of(const GpsPage& page) {
  std::ostringstream html;
  html << "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" << page.title
       << "</title></head>\n<body style=\"font-family: sans-serif; margin: 1em\">\n<h1>"
       << page.title << "</h1>\n<p>No fixes from " << page.outage_from_s << " to "
       << page.outage_to_s << " s (shaded). Bands are three times the published sigma.</p>\n"
       << "<p><img src=\"all.png\" alt=\"all filters\"></p>\n";
  for (const FilterErrors& filter : page.filters) {
    html << "<p><img src=\"" << filter.name << ".png\" alt=\"" << filter.name << "\"></p>\n";
  }
  html << "</body></html>\n";
  return html.str();
}

}  // namespace

std::string draw_gps_page(const GpsPage& page,
                          const std::string& folder,
                          const std::string& gnuplot) {
  for (const FilterErrors& filter : page.filters) {
    draw_filter(page, filter, folder, gnuplot);
  }
  draw_all(page, folder, gnuplot);
  const std::string file = exporter::path_in(folder, "index.html");
  exporter::write_text(file, html_of(page));
  return file;
}

}  // namespace trigpoint::evaluation
