// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fix_reference.hpp"
#include "html.hpp"
#include "map_raster.hpp"
#include "page_plots.hpp"
#include "pictures.hpp"
#include "png.hpp"
#include "session_map.hpp"
#include "svg_plot.hpp"
#include "table.hpp"

#include <algorithm>
#include <set>

namespace trigpoint::evaluation {

namespace {

using TopViewPoints = std::vector<Eigen::Vector2d>;

constexpr double kMarginPart = 0.06;  ///< of the larger side
constexpr double kLeastMargin_m = 20.0;
constexpr int kMostTopViewCells = 1200;
constexpr double kMostOblong = 2.2;  ///< of the sides of the picture
constexpr std::size_t kMostTopViewPoses = 6000;

TopViewPoints places(const Trajectory& trajectory, const Pose& T = Pose{}) {
  TopViewPoints points;
  for (const auto& pose : thinned(trajectory, kMostTopViewPoses)) {
    points.emplace_back((T * pose.pose.p).head<2>());
  }
  return points;
}

/// What is published in map, or else what there is.
const Trajectory& shown_of(const SessionData& data) {
  return !data.fused.empty() ? data.fused : !data.gps.empty() ? data.gps : data.lio;
}

/// The way driven without GPS: by truth when there is one, else as estimated.
Trajectory driven(const SessionData& data, const Window& window) {
  Trajectory part;
  for (const auto& pose : data.truth.empty() ? shown_of(data) : data.truth) {
    if (pose.stamp_ns >= window.begin_ns && pose.stamp_ns <= window.end_ns) {
      part.push_back(pose);
    }
  }
  return part;
}

/// Fixes by what the gate made of them; those that gate.csv does not tell of count as used.
PlotCurve fixes_curve(const SessionData& data, bool used) {
  std::set<Nanoseconds> refused_ns;
  for (const auto& verdict : last_verdicts(data)) {
    if (!verdict.used) {
      refused_ns.insert(verdict.fix_stamp_ns);
    }
  }
  Trajectory chosen;
  for (const auto& fix : fix_positions(data.fixes, *data.datum, FixChoice::kAll)) {
    if ((refused_ns.count(fix.stamp_ns) == 0) == used) {
      chosen.push_back(fix);
    }
  }
  return {used ? "fix" : "refused",
          used ? "GPS fixes (antenna)" : "fixes not used",
          places(chosen),
          Drawn::kDots};
}

std::vector<PlotCurve> top_view_curves_of(const SessionData& data) {
  const auto T_map_odom = lio_placement(data);
  std::vector<PlotCurve> curves;
  if (data.datum) {
    curves.push_back(fixes_curve(data, true));
  }
  curves.push_back({"truth", "truth", places(data.truth)});
  curves.push_back({"gps", "gps filter", places(data.gps)});
  curves.push_back({"fused", "fused", places(data.fused)});
  // Over the wider fused: where the two agree both are seen.
  curves.push_back(
      {"lio", lio_title(T_map_odom.has_value()), places(data.lio, T_map_odom.value_or(Pose{}))});
  if (data.datum) {
    curves.push_back(fixes_curve(data, false));
    const auto withheld = fix_positions(data.fixes, *data.datum, FixChoice::kWithheld);
    curves.push_back({"withheld", "withheld fixes", places(withheld), Drawn::kDots});
  }
  return curves;
}

struct TopViewBox {
  Eigen::Vector2d low;
  Eigen::Vector2d high;
};

/// Around all curves, and no thin strip.
std::optional<TopViewBox> box_of(const std::vector<PlotCurve>& curves) {
  TopViewBox box{Eigen::Vector2d::Constant(1e12), Eigen::Vector2d::Constant(-1e12)};
  for (const auto& curve : curves) {
    for (const auto& point : curve.points) {
      box.low = box.low.cwiseMin(point);
      box.high = box.high.cwiseMax(point);
    }
  }
  if (box.low.x() > box.high.x()) {
    return std::nullopt;
  }
  const double longest_m = (box.high - box.low).maxCoeff();
  const double margin_m = std::max(kLeastMargin_m, kMarginPart * longest_m);
  const double least_m = (longest_m + 2.0 * margin_m) / kMostOblong;
  for (int i = 0; i < 2; ++i) {
    const double wanted_m = std::max(box.high[i] - box.low[i] + 2.0 * margin_m, least_m);
    const double missing_m = wanted_m - (box.high[i] - box.low[i]);
    box.low[i] -= missing_m / 2.0;
    box.high[i] += missing_m / 2.0;
  }
  return box;
}

void add_map(SvgPlot& plot, const PointCloud& map, const TopViewBox& box) {
  const auto raster = rasterise(map, box.low, box.high, kMostTopViewCells);
  plot.add_picture("data:image/png;base64," + html::base64(png_of(raster)),
                   raster.lowest_m,
                   raster.lowest_m + raster.cell_m * Eigen::Vector2d(raster.columns, raster.rows));
}

void add_dropouts(SvgPlot& plot, const SessionData& data) {
  int number = 0;
  PlotCurve halo{"dropout-way", "GPS dropout", {}};
  for (const auto& window : data.outages()) {
    ++number;
    const auto part = driven(data, window);
    if (part.empty()) {
      continue;
    }
    const auto points = places(part);
    halo.points.insert(halo.points.end(), points.begin(), points.end());
    halo.points.emplace_back(kNaN, kNaN);
    const auto& middle = part[part.size() / 2].pose.p;
    const double duration_s = to_seconds(window.end_ns - window.begin_ns);
    plot.add_label(middle.x(),
                   middle.y(),
                   "dropout " + std::to_string(number) + ": " + fixed(duration_s, 1) + " s",
                   "dropout");
  }
  plot.add(halo);
}

}  // namespace

std::string plot_top_view(const SessionData& data, const PointCloud& map) {
  const auto curves = top_view_curves_of(data);
  const auto box = box_of(curves);
  if (!box) {
    return "";
  }
  const Eigen::Vector2d size_m = box->high - box->low;
  SvgPlot plot("top-view",
               "Seen from above, frame " + shown_frame(data),
               {box->low.x(), box->high.x(), false, "east [m]"},
               {box->low.y(), box->high.y(), false, "north [m]"},
               SvgPlot::kWidth * size_m.y() / size_m.x());
  if (!map.empty()) {
    add_map(plot, map, *box);
  }
  add_dropouts(plot, data);
  for (const auto& curve : curves) {
    plot.add(curve);
  }
  return plot.html("map");
}

}  // namespace trigpoint::evaluation
