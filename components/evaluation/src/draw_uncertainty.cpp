// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fix_reference.hpp"
#include "gate_series.hpp"
#include "gnuplot.hpp"
#include "pictures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

constexpr int kUncertaintyWidth_px = 1300;
constexpr int kPanelHeight_px = 230;
constexpr int kTimeLabel_px = 62;  ///< tics and label below the lowest panel
constexpr std::array<const char*, 3> kAxisFiles{"east.dat", "north.dat", "up.dat"};
/// By AxisSource.
constexpr std::array<const char*, 4> kSourceColours{"#d9d9d9", "#f7c59f", "#b9e3c0", "#b7d4f0"};
constexpr const char* kOutageColour = "#8c2d2d";

/// Of lio.tum; lio_title does not fit beside the panels.
const char* short_title(bool is_placed) {
  return is_placed ? "lio (yaw + t)" : "lio (odom)";
}

/// Vertical extent of a panel with a logarithmic scale.
struct SigmaRange {
  double lowest_m{0.01};
  double highest_m{1.0};
};

SigmaRange sigma_range(const std::vector<FusionStatus>& rows, std::size_t axis) {
  SigmaRange range;
  for (const auto& row : rows) {
    for (const double value_m : {row.axes.at(axis).sigma_m, row.axes.at(axis).threshold_m}) {
      if (is_known_sigma(value_m)) {
        range.lowest_m = std::min(range.lowest_m, std::max(value_m, kLowestSigma_m));
        range.highest_m = std::max(range.highest_m, value_m);
      }
    }
  }
  return {range.lowest_m / 1.5, range.highest_m * 2.5};
}

class UncertaintyPicture {
 public:
  explicit UncertaintyPicture(const SessionData& data)
      : data_(data),
        picture_(data.path(file::kPlots), "uncertainty"),
        span_(data.span()),
        outages_(data.outages()) {}

  std::string draw(const std::string& gnuplot) {
    if (data_.gate.empty() && data_.fused.empty() && data_.lio.empty() && data_.gps.empty()) {
      throw std::runtime_error("uncertainty.png: there is nothing to draw");
    }
    std::ostringstream body;
    const bool has_error = !data_.truth.empty();
    const int panels = has_error ? 5 : 4;
    const int height_px = panels * kPanelHeight_px + 40;
    body << "set multiplot layout " << panels
         << ",1 title 'GPS uncertainty per axis, and what the gate chose' margins "
            "0.075,0.84,"
         << static_cast<double>(kTimeLabel_px) / height_px << ",0.965 spacing 0.035\n"
         << "set xrange [0:" << std::max(1.0, time(span_.end_ns)) << "]\n"
         << "set grid lc rgb '#dddddd'\nset tics out nomirror\nset key outside right top Left "
            "reverse samplen 2\n"
         << "set style fill solid 1.0 noborder\nset format x ''\n";
    for (std::size_t axis = 0; axis < 3; ++axis) {
      body << sigma_panel(axis);
    }
    body << "unset logscale y\nset format y '%g'\n";
    body << (has_error ? "" : "set format x '%g'\nset xlabel 'time [s]'\n") << height_panel();
    if (has_error) {
      body << "set format x '%g'\nset xlabel 'time [s]'\n" << error_panel();
    }
    body << "unset multiplot\n";
    return picture_.draw(gnuplot, kUncertaintyWidth_px, height_px, body.str());
  }

 private:
  double time(Nanoseconds stamp_ns) const { return seconds_since(span_.begin_ns, stamp_ns); }

  /// Rectangles x y xlow xhigh ylow yhigh of the runs in which the gate chose one source.
  DataFile source_boxes(std::size_t axis, AxisSource source, const SigmaRange& range) const {
    DataFile boxes;
    for (const auto& run : source_runs(data_.gate, axis)) {
      const double from = time(run.begin_ns);
      const double to = time(run.end_ns);
      if (run.source == source && to > from) {
        boxes.add({from, range.lowest_m, from, to, range.lowest_m, range.highest_m});
      }
    }
    return boxes;
  }

  /// A bar along the upper edge of the panel.
  std::string outage_boxes(const std::string& name, double lowest, double highest) const {
    DataFile boxes;
    for (const auto& window : outages_) {
      const double from = time(window.begin_ns);
      boxes.add({from, lowest, from, time(window.end_ns), lowest, highest});
    }
    return boxes.is_empty()
               ? std::string()
               : picture_.data(name, boxes) + " using 1:2:3:4:5:6 with boxxyerror lc rgb '" +
                     kOutageColour + "' title 'GPS outage', \\\n     ";
  }

  std::string sigma_panel(std::size_t axis) {
    const std::string name = kAxisNames.at(axis);
    const auto range = sigma_range(data_.gate, axis);
    std::ostringstream text;
    text << "set logscale y\nset format y '%g'\nset ylabel 'sigma " << name << " [m]'\n"
         << "set yrange [" << range.lowest_m << ":" << range.highest_m << "]\nplot ";
    for (std::size_t source = 0; source < kSourceNames.size(); ++source) {
      const auto boxes = source_boxes(axis, static_cast<AxisSource>(source), range);
      const std::string source_file = name + "_" + kSourceNames.at(source) + ".box";
      if (!boxes.is_empty()) {
        text << picture_.data(source_file, boxes) << " using 1:2:3:4:5:6 with boxxyerror lc rgb '"
             << kSourceColours.at(source) << "' title 'gate: " << kSourceNames.at(source)
             << "', \\\n     ";
      }
    }
    text << outage_boxes(name + "_outage.box", range.highest_m / 1.35, range.highest_m);
    const auto quoted = picture_.data(kAxisFiles.at(axis), sigma_rows(axis));
    text << quoted << " using 1:2 with lines lw 2 lc rgb '#1f6fbf' title 'GPS sigma', "
         << "\\\n     " << quoted
         << " using 1:3 with lines lw 1.5 dt 2 lc rgb '#c00000' title 'threshold', \\\n     "
         << picture_.data("alignment_" + std::string(kAxisFiles.at(axis)), alignment_rows(axis))
         << " using 1:2 with lines lw 1.5 lc rgb '#555555' title 'alignment sigma'\n";
    return text.str();
  }

  DataFile sigma_rows(std::size_t axis) const {
    DataFile rows;
    for (const auto& row : data_.gate) {
      rows.add({time(row.stamp_ns), row.axes.at(axis).sigma_m, row.axes.at(axis).threshold_m});
    }
    return with_a_row(std::move(rows));
  }

  DataFile alignment_rows(std::size_t axis) const {
    DataFile rows;
    for (const auto& row : data_.gate) {
      const double sigma_m = row.position_sigma_m.at(axis);
      rows.add({time(row.stamp_ns), is_known_sigma(sigma_m) ? sigma_m : kNaN});
    }
    return with_a_row(std::move(rows));
  }

  /// gnuplot calls a file without rows an error; this one lies outside every range.
  static DataFile with_a_row(DataFile rows) {
    if (rows.is_empty()) {
      rows.add({-1.0, 1.0, 1.0});
    }
    return rows;
  }

  std::string curve(const std::string& name,
                    const std::string& title,
                    const std::vector<Eigen::Vector2d>& points,
                    const std::string& style) const {
    if (points.empty()) {
      return "";
    }
    DataFile rows;
    for (const auto& point : points) {
      rows.add({point.x(), point.y()});
    }
    return picture_.data(name, rows) + " using 1:2 with " + style + " title '" + title + "'";
  }

  std::vector<Eigen::Vector2d> heights(const Trajectory& trajectory, const Pose& T = Pose{}) const {
    std::vector<Eigen::Vector2d> points;
    for (const auto& [stamp_ns, pose] : thinned(trajectory)) {
      points.emplace_back(time(stamp_ns), (T * pose.p).z());
    }
    return points;
  }

  std::vector<Eigen::Vector2d> errors(const Trajectory& trajectory, const Pose& T = Pose{}) const {
    std::vector<Eigen::Vector2d> points;
    const auto pairs = associate(thinned(trajectory), data_.truth).pairs;
    for (const auto& pair : pairs) {
      const double error_m = (T * pair.estimate.p - pair.reference.p).norm();
      points.emplace_back(time(pair.stamp_ns), std::max(error_m, kLowestError_m));
    }
    return points;
  }

  /// Joins the curves that there are; a panel always has one.
  static std::string plot(const std::vector<std::string>& curves) {
    std::string text;
    for (const auto& curve : curves) {
      if (!curve.empty()) {
        text += (text.empty() ? "" : ", \\\n     ") + curve;
      }
    }
    // gnuplot calls a panel without points an error: an empty one gets a line outside its range.
    return text.empty() ? "unset logscale y\nset yrange [0:1]\nplot -1 notitle\n"
                        : "set yrange [*:*]\nplot " + text + "\n";
  }

  std::string height_panel() const {
    const auto T_map_odom = lio_placement(data_);
    Trajectory fixes;
    if (data_.datum) {
      fixes = fix_positions(data_.fixes, *data_.datum, FixChoice::kAll);
    }
    return "set ylabel 'z [m]'\n" +
           plot({curve("fixes.z",
                       "fixes (antenna)",
                       heights(fixes),
                       "points pt 2 ps 0.5 lc rgb '#7fb2e5'"),
                 curve("truth.z", "truth", heights(data_.truth), "lines lw 4 lc rgb '#f2c230'"),
                 curve("gps.z", "gps filter", heights(data_.gps), "lines lw 1 lc rgb '#1f6fbf'"),
                 curve("fused.z", "fused", heights(data_.fused), "lines lw 4 lc rgb '#17853c'"),
                 // Last and thinner: where the two agree both are seen.
                 curve("lio.z",
                       short_title(T_map_odom.has_value()),
                       heights(data_.lio, T_map_odom.value_or(Pose{})),
                       "lines lw 1.5 lc rgb '#e8772e'")});
  }

  std::string error_panel() const {
    const auto T_map_odom = lio_placement(data_);
    // Centimetres with GPS and tens of metres without: only a logarithm shows both.
    return "set logscale y\nset ylabel 'error [m]'\n" +
           plot({curve("gps.error", "gps filter", errors(data_.gps), "lines lw 1 lc rgb '#1f6fbf'"),
                 curve("fused.error", "fused", errors(data_.fused), "lines lw 4 lc rgb '#17853c'"),
                 T_map_odom ? curve("lio.error",
                                    short_title(true),
                                    errors(data_.lio, *T_map_odom),
                                    "lines lw 1.5 lc rgb '#e8772e'")
                            : std::string()});
  }

  const SessionData& data_;
  Picture picture_;
  Window span_;
  std::vector<Window> outages_;
};

}  // namespace

std::string draw_uncertainty(const SessionData& data, const std::string& gnuplot) {
  return UncertaintyPicture(data).draw(gnuplot);
}

}  // namespace trigpoint::evaluation
