// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/map_quality.hpp"

#include "trigpoint/export/map.hpp"
#include "trigpoint/export/session.hpp"

#include "json.hpp"
#include "table.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

constexpr double kTight_m = 0.10;
/// Keyframes on the spot bring nothing new.
constexpr std::size_t kApart = 2;

/// Cuts the drive into passes by the way between its keyframes.
class PassCutter {
 public:
  explicit PassCutter(double pass_m) : pass_m_(pass_m) {}

  void add(const Pose& T_map_base, const PointCloud& points_map) {
    if (last_m_) {
      way_m_ += (T_map_base.p - *last_m_).norm();
    }
    last_m_ = T_map_base.p;
    if (way_m_ >= pass_m_) {
      finish();
    }
    cloud_.insert(cloud_.end(), points_map.begin(), points_map.end());
  }

  void finish() {
    if (!cloud_.empty()) {
      walls_.add_pass(cloud_);
    }
    cloud_.clear();
    way_m_ = 0.0;
  }

  const PassWalls& walls() const { return walls_; }

 private:
  double pass_m_;
  double way_m_{0.0};
  std::optional<Eigen::Vector3d> last_m_;
  PointCloud cloud_;
  PassWalls walls_;
};

std::optional<PassOffset> passes_of(const std::string& session, double pass_m) {
  PassCutter cutter(pass_m);
  const bool placed = exporter::visit_placed_keyframes(
      session, [&](const Pose& pose, const PointCloud& points) { cutter.add(pose, points); });
  if (!placed) {
    return std::nullopt;
  }
  cutter.finish();
  return cutter.walls().offset(kApart);
}

std::string sentence_of(const PassOffset& passes) {
  if (passes.walls == 0) {
    return "no wall was seen by two of " + std::to_string(passes.passes) +
           " passes that do not follow each other";
  }
  return "median " + fixed(passes.median_m, 3) + " m, 90th percentile " + fixed(passes.p90_m, 3) +
         " m, " + std::to_string(passes.walls) + " walls seen by several of " +
         std::to_string(passes.passes) + " passes";
}

}  // namespace

SurfaceError surface_error(const PointCloud& cloud,
                           const SurfaceDistance& distance_m,
                           std::size_t most_points) {
  SurfaceError result;
  std::vector<double> distances_m;
  const std::size_t step = cloud.size() / most_points + 1;
  double sum_m2 = 0.0;
  std::size_t tight = 0;
  for (std::size_t i = 0; i < cloud.size(); i += step) {
    const auto distance = distance_m(cloud[i].position().cast<double>());
    if (!distance) {
      ++result.without_surface;
      continue;
    }
    distances_m.push_back(*distance);
    sum_m2 += *distance * *distance;
    tight += *distance <= kTight_m ? 1 : 0;
  }
  result.points = distances_m.size();
  if (distances_m.empty()) {
    return result;
  }
  std::sort(distances_m.begin(), distances_m.end());
  const auto n = static_cast<double>(distances_m.size());
  result.rmse_m = std::sqrt(sum_m2 / n);
  result.median_m = distances_m[static_cast<std::size_t>(std::lround(0.5 * (n - 1.0)))];
  result.p90_m = distances_m[static_cast<std::size_t>(std::lround(0.9 * (n - 1.0)))];
  result.share_within_10cm = static_cast<double>(tight) / n;
  return result;
}

MapQuality map_quality(const std::string& session,
                       const SurfaceDistance& distance_m,
                       double pass_m) {
  const std::string file = exporter::path_in(session, exporter::session_file::kMap);
  if (!std::filesystem::exists(file)) {
    throw std::runtime_error(session + ": holds no map.pcd; trigpoint report renders it");
  }
  const PointCloud cloud = exporter::read_pcd(file);
  MapQuality quality;
  quality.points = cloud.size();
  quality.entropy = mean_map_entropy(cloud);
  quality.thickness = facade_thickness(cloud);
  quality.passes = passes_of(session, pass_m);
  if (distance_m) {
    quality.surfaces = surface_error(cloud, distance_m);
  }
  return quality;
}

std::string print(const MapQuality& quality) {
  const MapEntropy& entropy = quality.entropy;
  std::string text = "## Map\n\n" + std::to_string(quality.points) + " points\n" +
                     "Mean map entropy: " + fixed(entropy.mean, 3) + " within " +
                     fixed(entropy.radius_m, 2) + " m, of " + std::to_string(entropy.points) +
                     " points (" + std::to_string(entropy.lonely) + " without neighbours enough)\n";
  text += "Thickness of facades (one sigma): median " + fixed(quality.thickness.median_m, 3) +
          " m, 90th percentile " + fixed(quality.thickness.p90_m, 3) + " m, " +
          std::to_string(quality.thickness.planes) + " planes\n";
  text += "Double walls between passes: " +
          (quality.passes ? sentence_of(*quality.passes)
                          : std::string("not known, the session holds no corrected keyframes")) +
          "\n";
  if (quality.surfaces) {
    const SurfaceError& surfaces = *quality.surfaces;
    text += "Distance to the true surfaces: rmse " + fixed(surfaces.rmse_m, 3) + " m, median " +
            fixed(surfaces.median_m, 3) + " m, 90th percentile " + fixed(surfaces.p90_m, 3) +
            " m, " + share(surfaces.share_within_10cm) + " within 0.1 m, of " +
            std::to_string(surfaces.points) + " points (" +
            std::to_string(surfaces.without_surface) + " more in leaves)\n";
  }
  return text;
}

std::string to_json(const MapQuality& quality) {
  using json::number;
  const auto count = [](std::size_t n) { return number(static_cast<std::uint64_t>(n)); };
  json::Object object;
  object.add("points", count(quality.points))
      .add("entropy",
           json::Object()
               .add("mean", number(quality.entropy.mean))
               .add("radius_m", number(quality.entropy.radius_m))
               .add("points", count(quality.entropy.points))
               .add("lonely", count(quality.entropy.lonely))
               .str())
      .add("facade_thickness",
           json::Object()
               .add("planes", count(quality.thickness.planes))
               .add("median_m", number(quality.thickness.median_m))
               .add("p90_m", number(quality.thickness.p90_m))
               .str());
  const PassOffset passes = quality.passes.value_or(PassOffset{});
  object.add("between_passes",
             json::Object()
                 .add("passes", count(passes.passes))
                 .add("walls", count(passes.walls))
                 .add("median_m", number(passes.median_m))
                 .add("p90_m", number(passes.p90_m))
                 .str());
  if (quality.surfaces) {
    object.add("true_surfaces",
               json::Object()
                   .add("points", count(quality.surfaces->points))
                   .add("without_surface", count(quality.surfaces->without_surface))
                   .add("rmse_m", number(quality.surfaces->rmse_m))
                   .add("median_m", number(quality.surfaces->median_m))
                   .add("p90_m", number(quality.surfaces->p90_m))
                   .add("share_within_10cm", number(quality.surfaces->share_within_10cm))
                   .str());
  }
  return object.str();
}

}  // namespace trigpoint::evaluation
