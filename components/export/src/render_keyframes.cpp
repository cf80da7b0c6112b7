// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/point_cloud.hpp"
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/lio_mapper/pose_graph.hpp"
#include "trigpoint/lio_mapper/see_through.hpp"

#include "pcd_writer.hpp"
#include "render_map.hpp"
#include "voxel_tiles.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <stdexcept>
#include <vector>

namespace trigpoint::exporter {

namespace {

using lio_mapper::Keyframe;

/// About 0.6 GB; a campus drive has a tenth.
constexpr std::size_t kMostVoxels = 8'000'000;
/// From the middle of a sweep to its last point, at which a keyframe's pose is.
constexpr double kHalfSweep_s = 0.05;
/// Two keyframes farther apart do not tell the speed.
constexpr double kLongestStep_s = 2.0;

/// Where keyframes belong, in the order of their reading.
struct Places {
  std::string frame{"map"};
  std::vector<std::optional<Pose>> T_frame_base;
  std::vector<Nanoseconds> stamps_ns;

  /// Origin of the rays, in the middle of the sweep.
  Eigen::Vector3d origin_m(std::size_t i, const Eigen::Vector3d& lidar_position_base_m) const {
    const Pose& T = *T_frame_base[i];
    const Eigen::Vector3d origin_m = T * lidar_position_base_m;
    if (i == 0 || !T_frame_base[i - 1]) {
      return origin_m;
    }
    const double step_s = to_seconds(stamps_ns[i] - stamps_ns[i - 1]);
    const Eigen::Vector3d before_m = *T_frame_base[i - 1] * lidar_position_base_m;
    return step_s > kHalfSweep_s && step_s < kLongestStep_s
               ? Eigen::Vector3d(origin_m - kHalfSweep_s / step_s * (origin_m - before_m))
               : origin_m;
  }
};

lio_mapper::GraphInput survey(const KeyframeSource& keyframes,
                              const std::optional<Alignment>& fallback) {
  lio_mapper::GraphInput input;
  input.fallback = fallback;
  keyframes(
      [&](const Keyframe& keyframe) { input.keyframes.push_back(graph_keyframe_of(keyframe)); });
  return input;
}

Places places_of(const lio_mapper::GraphInput& input, const CorrectedPoses* corrected) {
  Places places;
  for (const lio_mapper::GraphKeyframe& keyframe : input.keyframes) {
    places.stamps_ns.push_back(keyframe.stamp_ns);
  }
  if (corrected == nullptr) {
    lio_mapper::OnlinePlaces online = lio_mapper::place_online(input);
    places.frame = online.frame;
    places.T_frame_base = std::move(online.T_map_base);
    return places;
  }
  places.frame = corrected->frame;
  for (const Nanoseconds stamp_ns : places.stamps_ns) {
    const auto pose = corrected->T_frame_base.find(stamp_ns);
    places.T_frame_base.push_back(
        pose == corrected->T_frame_base.end() ? std::nullopt : std::optional(pose->second));
  }
  return places;
}

/// Goes through the keyframes that have a place, and tells how far it is.
class Passes {
 public:
  Passes(const KeyframeSource& keyframes,
         const Places& places,
         int passes,
         const std::function<void(double)>& progress)
      : keyframes_(keyframes), places_(places), passes_(passes), progress_(progress) {}

  void operator()(const std::function<void(std::size_t, const PointCloud&)>& visit) {
    std::size_t i = 0;
    keyframes_([&](const Keyframe& keyframe) {
      if (i < places_.T_frame_base.size() && places_.T_frame_base[i]) {
        visit(i, moved(keyframe.points_base, *places_.T_frame_base[i]));
      }
      ++i;
      if (progress_) {
        const double share =
            static_cast<double>(i) / static_cast<double>(places_.T_frame_base.size());
        progress_((pass_ + std::min(share, 1.0)) / passes_);
      }
    });
    ++pass_;
  }

 private:
  const KeyframeSource& keyframes_;
  const Places& places_;
  double passes_;
  double pass_{0.0};
  const std::function<void(double)>& progress_;
};

void measure(const PointCloud& points, MapReport& report) {
  for (const PointXyzi& point : points) {
    const Eigen::Vector3d p = point.position().cast<double>();
    report.lowest_m = report.lowest_m.cwiseMin(p);
    report.highest_m = report.highest_m.cwiseMax(p);
  }
}

void render(Passes& passes,
            const Places& places,
            const MapCorrections& corrections,
            double voxel_m,
            const std::string& out_pcd,
            MapReport& report) {
  lio_mapper::SeeThrough see_through;
  if (corrections.remove_moving) {
    passes([&](std::size_t, const PointCloud& points) { see_through.add(points); });
    passes([&](std::size_t i, const PointCloud& points) {
      see_through.look(points, places.origin_m(i, corrections.lidar_position_base_m));
    });
    see_through.decide();
  }
  PcdWriter file(out_pcd, places.frame);
  VoxelTiles tiles(voxel_m, kMostVoxels, [&](const PointCloud& points) { file.append(points); });
  passes([&](std::size_t, PointCloud points) {
    ++report.keyframes;
    report.points_read += points.size();
    report.points_moving +=
        std::erase_if(points, [&](const PointXyzi& point) { return see_through.is_moving(point); });
    measure(points, report);
    tiles.add(points);
  });
  tiles.finish();
  report.points_written = file.finish();
}

void say_what_is_missing(MapReport& report) {
  if (report.frame == "odom") {
    report.remark =
        "no alignment to the datum was found: the map is in the frame odom and not georeferenced";
  }
  if (report.points_read == 0) {
    report.lowest_m.setZero();
    report.highest_m.setZero();
    report.remark = "there are no points: the map is empty";
  } else if (report.keyframes_left_out > 0) {
    report.remark += (report.remark.empty() ? "" : "; ") +
                     std::to_string(report.keyframes_left_out) +
                     " keyframes of an odom epoch without alignment are left out";
  }
}

}  // namespace

MapReport render_keyframes(const KeyframeSource& keyframes,
                           const std::optional<Alignment>& fallback,
                           double voxel_m,
                           const std::string& out_pcd,
                           const std::function<void(double)>& progress,
                           const MapCorrections& corrections) {
  if (!(voxel_m > 0.0)) {
    throw std::runtime_error("the map's voxel size must be above 0 m, got " +
                             std::to_string(voxel_m));
  }
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  MapReport report;
  report.lowest_m.setConstant(kInfinity);
  report.highest_m.setConstant(-kInfinity);
  const Places places = places_of(survey(keyframes, fallback), corrections.corrected);
  report.frame = places.frame;
  Passes passes(keyframes, places, corrections.remove_moving ? 3 : 1, progress);
  render(passes, places, corrections, voxel_m, out_pcd, report);
  report.keyframes_left_out = places.T_frame_base.size() - report.keyframes;
  say_what_is_missing(report);
  return report;
}

}  // namespace trigpoint::exporter
