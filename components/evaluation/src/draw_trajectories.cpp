// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fix_reference.hpp"
#include "gnuplot.hpp"
#include "map_raster.hpp"
#include "pictures.hpp"
#include "session_map.hpp"

#include <sstream>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

constexpr double kMargin_m = 25.0;
constexpr int kMostCells = 1500;
constexpr int kWidth_px = 1300;
constexpr int kLowestHeight_px = 650;
constexpr int kHighestHeight_px = 1500;

struct Box {
  Eigen::Vector2d lowest_m{Eigen::Vector2d::Constant(1e12)};
  Eigen::Vector2d highest_m{Eigen::Vector2d::Constant(-1e12)};

  void include(const Trajectory& trajectory) {
    for (const auto& pose : trajectory) {
      lowest_m = lowest_m.cwiseMin(pose.pose.p.head<2>());
      highest_m = highest_m.cwiseMax(pose.pose.p.head<2>());
    }
  }

  bool is_empty() const { return lowest_m.x() > highest_m.x(); }
};

struct Curve {
  std::string name;
  std::string title;
  Trajectory trajectory;
  std::string style;
};

Trajectory placed(const Pose& T, Trajectory trajectory) {
  for (auto& pose : trajectory) {
    pose.pose = T * pose.pose;
  }
  return trajectory;
}

/// The later ones are drawn over the earlier ones.
std::vector<Curve> curves_of(const SessionData& data) {
  std::vector<Curve> curves;
  const auto add = [&](Curve curve) {
    if (!curve.trajectory.empty()) {
      curve.trajectory = thinned(curve.trajectory);
      curves.push_back(std::move(curve));
    }
  };
  add({"truth", "truth", data.truth, "lines lw 8 lc rgb '#f2c230'"});
  add({"gps", "gps filter", data.gps, "lines lw 1.5 lc rgb '#1f6fbf'"});
  add({"fused", "fused", data.fused, "lines lw 4.5 lc rgb '#17853c'"});
  // Over the wider fused: where the two agree both are seen.
  const auto T_map_odom = lio_placement(data);
  add({"lio",
       lio_title(T_map_odom.has_value()),
       placed(T_map_odom.value_or(Pose{}), data.lio),
       "lines lw 1.5 lc rgb '#e8772e'"});
  if (data.datum) {
    const auto all = fix_positions(data.fixes, *data.datum, FixChoice::kAll);
    const auto withheld = fix_positions(data.fixes, *data.datum, FixChoice::kWithheld);
    add({"fixes", "GPS fixes (antenna)", all, "points pt 2 ps 0.6 lc rgb '#3b8fd9'"});
    add({"withheld", "withheld fixes", withheld, "points pt 6 ps 0.9 lc rgb '#8e3fae'"});
  }
  return curves;
}

std::string raster_command(const Picture& picture, const MapRaster& raster) {
  const std::string bytes(reinterpret_cast<const char*>(raster.darkness.data()),
                          raster.darkness.size() * sizeof(float));
  std::ostringstream text;
  text << picture.data("map.raster", bytes) << " binary array=(" << raster.columns << ","
       << raster.rows << ") format='%float' origin=(" << raster.lowest_m.x() + raster.cell_m / 2
       << "," << raster.lowest_m.y() + raster.cell_m / 2 << ") dx=" << raster.cell_m
       << " dy=" << raster.cell_m << " with image notitle, \\\n     ";
  return text.str();
}

std::string plot_command(const Picture& picture,
                         const std::vector<Curve>& curves,
                         const std::string& background) {
  std::string text = "plot " + background;
  for (std::size_t i = 0; i < curves.size(); ++i) {
    DataFile rows;
    for (const auto& pose : curves[i].trajectory) {
      rows.add({pose.pose.p.x(), pose.pose.p.y()});
    }
    text += (i == 0 ? "" : ", \\\n     ") + picture.data(curves[i].name + ".xy", rows) +
            " using 1:2 with " + curves[i].style + " title '" + curves[i].title + "'";
  }
  return text + "\n";
}

int height_for(const Eigen::Vector2d& size_m) {
  const double plot_px = 0.88 * kWidth_px * size_m.y() / size_m.x();
  return std::clamp(static_cast<int>(plot_px) + 120, kLowestHeight_px, kHighestHeight_px);
}

}  // namespace

std::string draw_trajectories(const SessionData& data,
                              const PointCloud& map,
                              const std::string& gnuplot) {
  const Picture picture(data.path(file::kPlots), "trajectories");
  const auto curves = curves_of(data);
  Box box;
  for (const auto& curve : curves) {
    box.include(curve.trajectory);
  }
  if (box.is_empty()) {
    throw std::runtime_error("trajectories.png: there is no trajectory to draw");
  }
  box.lowest_m.array() -= kMargin_m;
  box.highest_m.array() += kMargin_m;
  const auto background =
      map.empty()
          ? std::string()
          : raster_command(picture, rasterise(map, box.lowest_m, box.highest_m, kMostCells));
  std::ostringstream body;
  body << "set title 'Top view: trajectories" << (map.empty() ? "" : " over the map") << ", frame "
       << shown_frame(data) << "'\n"
       << "set xlabel 'east [m]' offset 0,0.6\nset ylabel 'north [m]'\n"
       << "set size ratio -1\nset grid lc rgb '#cccccc'\nset tics out nomirror\n"
       << "set key outside below center horizontal\n"
       << "set palette defined (0 '#ffffff', 0.02 '#ececec', 1 '#505050')\nunset colorbox\n"
       << "set cbrange [0:1]\n"
       << "set xrange [" << box.lowest_m.x() << ":" << box.highest_m.x() << "]\n"
       << "set yrange [" << box.lowest_m.y() << ":" << box.highest_m.y() << "]\n"
       << plot_command(picture, curves, background);
  return picture.draw(gnuplot, kWidth_px, height_for(box.highest_m - box.lowest_m), body.str());
}

}  // namespace trigpoint::evaluation
