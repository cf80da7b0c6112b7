// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fix_reference.hpp"
#include "gate_series.hpp"
#include "gnuplot.hpp"
#include "pictures.hpp"
#include "reproduction.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <sstream>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

constexpr int kReproductionWidth_px = 1500;
constexpr double kReproductionMargin_m = 6.0;
constexpr double kLeastPart_m = 15.0;   ///< half a side of the part with the dropout
constexpr double kLeastDetail_m = 0.3;  ///< and of that where modes differ
constexpr std::size_t kMostPoints = 6'000;
constexpr const char* kDropoutColour = "#ffdf3d";

struct Style {
  const char* mode;
  const char* line;
};

/// The later ones are drawn over the earlier ones, and thinner.
constexpr std::array<Style, 5> kStyles{{{"lio", "lw 2.2 lc rgb '#e8772e'"},
                                        {"fusion", "lw 4.2 lc rgb '#8e3fae'"},
                                        {"literal", "lw 3.2 lc rgb '#c02942'"},
                                        {"hard", "lw 2.4 lc rgb '#1f6fbf'"},
                                        {"smooth", "lw 1.6 lc rgb '#17853c'"}}};

std::string style_of(const std::string& mode) {
  const auto found = std::find_if(
      kStyles.begin(), kStyles.end(), [&](const Style& style) { return mode == style.mode; });
  return found == kStyles.end() ? "lw 2 lc rgb '#444444'" : found->line;
}

std::string picture_title_of(const std::string& mode) {
  const std::string name = paper_name_of(mode);
  return name.empty() ? mode : mode + " (" + name + ")";
}

struct ModeCurve {
  std::string mode;
  Trajectory fused;
};

/// What both pictures show, read once.
struct Content {
  std::vector<ModeCurve> curves;
  Trajectory truth;
  Trajectory fixes;                ///< base_link at each: the lever arm taken off
  std::vector<FusionStatus> gate;  ///< of the last mode
  std::string gate_mode;
  Nanoseconds begin_ns{0};
};

/// The curves are of base_link, the fixes of an antenna that stands elsewhere: the difference would
/// be taken for an error. With the attitude that the robot had at the fix.
Trajectory at_base_link(const Trajectory& antenna,
                        const Trajectory& fused,
                        const Eigen::Vector3d& antenna_position_base_m) {
  Trajectory base;
  for (const auto& [stamp_ns, fix] : antenna) {
    if (const auto pose = pose_at(fused, stamp_ns)) {
      base.push_back({stamp_ns, Pose(pose->q, fix.p - pose->q * antenna_position_base_m)});
    }
  }
  return base;
}

Content read(const ReproducedDrive& drive) {
  Content content;
  for (const ModeSessions& mode : drive.modes) {
    SessionData data = load_session(mode.fed, {});
    if (content.fixes.empty() && data.datum) {
      content.fixes = at_base_link(fix_positions(data.fixes, *data.datum, FixChoice::kAll),
                                   data.fused,
                                   data.antenna_position_base_m);
      content.truth = thinned(data.truth, kMostPoints);
      content.begin_ns = data.span().begin_ns;
    }
    content.curves.push_back({mode.mode, thinned(data.fused, kMostPoints)});
    content.gate = std::move(data.gate);
    content.gate_mode = mode.mode;
  }
  const bool is_empty = std::all_of(content.curves.begin(),
                                    content.curves.end(),
                                    [](const ModeCurve& curve) { return curve.fused.empty(); });
  if (is_empty) {
    throw std::runtime_error("there is no trajectory in map to draw");
  }
  return content;
}

using Keep = std::function<bool(Nanoseconds)>;

/// x y z of the poses to keep; a blank line wherever some are left out.
DataFile rows_of(const Trajectory& trajectory, const Keep& keep = {}) {
  DataFile rows;
  for (const auto& [stamp_ns, pose] : trajectory) {
    const bool is_kept = !keep || keep(stamp_ns);
    rows.add({is_kept ? pose.p.x() : kNaN, pose.p.y(), pose.p.z()});
  }
  return rows;
}

struct Square {
  Eigen::Vector2d centre_m{Eigen::Vector2d::Zero()};
  double half_m{kLeastPart_m};
};

const ModeCurve& reference_curve(const Content& content) {
  return *std::find_if(content.curves.rbegin(), content.curves.rend(), [](const ModeCurve& curve) {
    return !curve.fused.empty();
  });
}

Square around(const Trajectory& trajectory, const Keep& keep) {
  Eigen::Vector2d lowest_m = Eigen::Vector2d::Constant(1e12);
  Eigen::Vector2d highest_m = -lowest_m;
  for (const auto& [stamp_ns, pose] : trajectory) {
    if (keep(stamp_ns)) {
      lowest_m = lowest_m.cwiseMin(pose.p.head<2>());
      highest_m = highest_m.cwiseMax(pose.p.head<2>());
    }
  }
  Square square;
  if (lowest_m.x() <= highest_m.x()) {
    square.centre_m = 0.5 * (lowest_m + highest_m);
    square.half_m =
        std::max(kLeastPart_m, 0.5 * (highest_m - lowest_m).maxCoeff() + kReproductionMargin_m);
  }
  return square;
}

Square around_longest(const Content& content, const std::vector<Window>& dropouts) {
  const auto longest =
      std::max_element(dropouts.begin(), dropouts.end(), [](const Window& a, const Window& b) {
        return a.end_ns - a.begin_ns < b.end_ns - b.begin_ns;
      });
  return around(reference_curve(content).fused, [&](Nanoseconds stamp_ns) {
    return stamp_ns >= longest->begin_ns && stamp_ns <= longest->end_ns;
  });
}

/// Where a mode lies furthest beside the last one, seen from above.
Square around_furthest(const Content& content) {
  const Trajectory& reference = reference_curve(content).fused;
  double furthest_m = 0.0;
  Square square;
  for (const ModeCurve& curve : content.curves) {
    for (const PosePair& pair : associate(curve.fused, reference).pairs) {
      const double apart_m = (pair.estimate.p - pair.reference.p).head<2>().norm();
      if (apart_m >= furthest_m) {
        furthest_m = apart_m;
        square.centre_m = 0.5 * (pair.estimate.p + pair.reference.p).head<2>();
      }
    }
  }
  square.half_m = std::max(kLeastDetail_m, 3.0 * furthest_m);
  return square;
}

/// What a panel shows; without a part the whole.
struct Panel {
  std::string title;
  std::optional<Square> part;
};

std::vector<Panel> panels_of(const Content& content, const std::vector<Window>& dropouts) {
  std::vector<Panel> panels{{"whole", std::nullopt}};
  if (!dropouts.empty()) {
    panels.push_back({"the longest dropout", around_longest(content, dropouts)});
  }
  panels.push_back({"where modes differ most", around_furthest(content)});
  return panels;
}

class ReproductionPicture {
 public:
  ReproductionPicture(const DriveFigures& figures,
                      const Content& content,
                      const std::string& folder,
                      const std::string& name)
      : figures_(figures),
        content_(content),
        picture_(exporter::path_in(folder, file::kPlots), name) {}

  /// Fig. 7 to 10: the whole path, and parts of it enlarged; dropouts in yellow.
  std::string draw_trajectories(const std::string& gnuplot) const {
    const std::vector<Panel> panels = panels_of(content_, figures_.dropouts);
    std::ostringstream body;
    body << "set multiplot title "
         << quoted(figures_.drive.name +
                   ": as published in map, no alignment (compare Fig. 7 to 10)")
         << " noenhanced\n"
         << "set size ratio -1\nset grid lc rgb '#dddddd'\nset tics out nomirror\n"
         << "set xlabel 'east [m]'\nset ylabel 'north [m]' offset 1,0\n"
         << "set bmargin at screen 0.3\nset tmargin at screen 0.88\n"
         << "set key at screen 0.5,0.19 center top vertical maxrows 3 samplen 3 noenhanced\n";
    const double width = 0.98 / static_cast<double>(panels.size());
    for (std::size_t i = 0; i < panels.size(); ++i) {
      const double left = 0.01 + width * static_cast<double>(i);
      body << "set title '" << panels[i].title << "'\nset lmargin at screen " << left + 0.045
           << "\nset rmargin at screen " << left + width - 0.01 << "\n"
           << range_of(panels[i].part) << plot("1:2", "plot", i == 0) << "unset key\n";
    }
    body << "unset multiplot\n";
    return picture_.draw(gnuplot, kReproductionWidth_px, 700, body.str());
  }

  /// Fig. 11: the path in space, and the uncertainty of each axis with its threshold.
  std::string draw_uncertainty(const std::string& gnuplot) const {
    std::ostringstream body;
    body << "set multiplot title "
         << quoted(figures_.drive.name +
                   ": path in space and uncertainty of the GPS odometry (compare Fig. 11)")
         << " noenhanced\n"
         << "set origin 0,0.5\nset size 1,0.47\nset key at screen 0.985,0.93 right top samplen 3 "
            "noenhanced\nset view 62,32\nset ticslevel 0.05\nset xyplane relative 0.05\n"
         << "set grid lc rgb '#dddddd'\nset xlabel 'east [m]'\nset ylabel 'north [m]'\n"
         << "set zlabel 'up [m]' rotate parallel\n"
         << plot("1:2:3", "splot", true)
         << "set key inside right top\nunset zlabel\nset tics out nomirror\nset ylabel ''\n"
         << "set xlabel ''\nset format x ''\nset style fill solid 1.0 noborder\nset logscale y\n"
         << "set format y '%g'\nset lmargin at screen 0.07\nset rmargin at screen 0.98\n";
    for (std::size_t axis = 0; axis < kAxisNames.size(); ++axis) {
      const double top = 0.475 - 0.145 * static_cast<double>(axis);
      body << "set tmargin at screen " << top << "\nset bmargin at screen " << top - 0.125 << "\n"
           << (axis == 2 ? "set format x '%g'\nset xlabel 'time [s]'\n" : "") << sigma_panel(axis);
    }
    body << "unset multiplot\n";
    return picture_.draw(gnuplot, 1300, 1250, body.str());
  }

 private:
  static std::string range_of(const std::optional<Square>& square) {
    if (!square) {
      return "";
    }
    const Eigen::Vector2d lowest_m = square->centre_m.array() - square->half_m;
    const Eigen::Vector2d highest_m = square->centre_m.array() + square->half_m;
    std::ostringstream text;
    text << "set xrange [" << lowest_m.x() << ":" << highest_m.x() << "]\nset yrange ["
         << lowest_m.y() << ":" << highest_m.y() << "]\n";
    return text.str();
  }

  std::string plot(const std::string& columns, const std::string& verb, bool titled) const {
    const auto title = [&](const std::string& words) {
      return titled ? " title '" + words + "'" : std::string(" notitle");
    };
    std::vector<std::string> parts;
    const auto add = [&](const std::string& name,
                         const DataFile& rows,
                         const std::string& style,
                         const std::string& words) {
      if (!rows.is_empty()) {
        parts.push_back(picture_.data(name, rows) + " using " + columns + " with " + style +
                        title(words));
      }
    };
    const auto in_dropout = [&](Nanoseconds stamp_ns) {
      return is_inside(figures_.dropouts, stamp_ns);
    };
    add("dropouts.xyz",
        rows_of(reference_curve(content_).fused, in_dropout),
        std::string("lines lw 16 lc rgb '") + kDropoutColour + "'",
        "GPS dropout");
    add("fixes.xyz",
        rows_of(content_.fixes),
        "points pt 6 ps 0.5 lc rgb '#9a9a9a'",
        "GPS fixes, lever arm taken off");
    for (const ModeCurve& curve : content_.curves) {
      add(curve.mode + ".xyz",
          rows_of(curve.fused),
          "lines " + style_of(curve.mode),
          picture_title_of(curve.mode));
    }
    add("truth.xyz", rows_of(content_.truth), "lines lw 1 dt 2 lc rgb '#000000'", "truth");
    std::string text = verb + " ";
    for (std::size_t i = 0; i < parts.size(); ++i) {
      text += (i == 0 ? "" : ", \\\n     ") + parts[i];
    }
    return text + "\n";
  }

  std::string sigma_panel(std::size_t axis) const {
    DataFile sigma;
    double lowest_m = 0.1;
    double highest_m = 1.0;
    double threshold_m = kNaN;
    double end_s = 1.0;
    for (const FusionStatus& row : content_.gate) {
      const double sigma_m = row.axes.at(axis).sigma_m;
      end_s = std::max(end_s, seconds_since(content_.begin_ns, row.stamp_ns));
      threshold_m = row.axes.at(axis).threshold_m;
      if (is_known_sigma(sigma_m)) {
        sigma.add({seconds_since(content_.begin_ns, row.stamp_ns), sigma_m});
        lowest_m = std::min(lowest_m, std::max(sigma_m, kLowestSigma_m));
        highest_m = std::max({highest_m, sigma_m, threshold_m});
      }
    }
    if (sigma.is_empty()) {
      sigma.add({-1.0, 1.0});  // gnuplot calls a file without rows an error
    }
    DataFile boxes;
    for (const Window& window : figures_.dropouts) {
      const double from_s = seconds_since(content_.begin_ns, window.begin_ns);
      const double to_s = seconds_since(content_.begin_ns, window.end_ns);
      boxes.add({from_s, lowest_m, from_s, to_s, lowest_m / 1.5, highest_m * 2.0});
    }
    const std::string name = kAxisNames.at(axis);
    std::ostringstream text;
    text << "set ylabel 'sigma " << name << " [m]'\nset xrange [0:" << end_s << "]\nset yrange ["
         << lowest_m / 1.5 << ":" << highest_m * 2.0 << "]\nplot ";
    if (!boxes.is_empty()) {
      text << picture_.data("dropouts_" + name + ".box", boxes)
           << " using 1:2:3:4:5:6 with boxxyerror lc rgb '" << kDropoutColour
           << "' title 'GPS dropout', \\\n     ";
    }
    if (std::isfinite(threshold_m)) {
      text << threshold_m
           << " with lines lw 1.5 dt 2 lc rgb '#c00000' title 'threshold', \\\n     ";
    }
    text << picture_.data("sigma_" + name + ".dat", sigma)
         << " using 1:2 with lines lw 2 lc rgb '#1f6fbf' title 'sigma of GPS odometry'\n";
    return text.str();
  }

  const DriveFigures& figures_;
  const Content& content_;
  Picture picture_;
};

}  // namespace

void draw(DriveFigures& figures, const std::string& folder, const std::string& gnuplot) {
  const std::string& name = figures.drive.name;
  const std::string own = exporter::path_in(folder, name);
  try {
    const Content content = read(figures.drive);
    ReproductionPicture(figures, content, own, "trajectories").draw_trajectories(gnuplot);
    figures.pictures.push_back(name + "/trajectories.png");
    ReproductionPicture(figures, content, own, "uncertainty").draw_uncertainty(gnuplot);
    figures.pictures.push_back(name + "/uncertainty.png");
  } catch (const std::exception& error) {
    figures.problems.push_back(std::string("Pictures: ") + error.what() + ".");
  }
}

}  // namespace trigpoint::evaluation
