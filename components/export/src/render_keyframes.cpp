// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
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

/// How level odom is, is learnt while driving: a keyframe is levelled by what was known this much
/// farther on. Over that distance odom's own tilt hardly drifts (lio_mapper's drift: 0.06 degree).
constexpr double kLevellingLag_m = 100.0;

/// Tilt of T_map_odom after some distance.
struct Level {
  double distance_m;
  Eigen::Vector2d tilt_rad;
};

/// What a first reading tells of one odom epoch.
struct Epoch {
  std::uint64_t keyframes{0};
  std::optional<YawPose> first_alignment;
  Eigen::Vector3d aligned_at_odom_m{Eigen::Vector3d::Zero()};  ///< base_link at the first alignment
  std::vector<Level> levels;                                   ///< of aligned keyframes
  std::optional<Eigen::Vector3d> newest_odom_m;
  double distance_m{0.0};

  /// Of a keyframe in turn, when keyframes come in the order of the first reading.
  void go_to(const Eigen::Vector3d& p_odom_m) {
    distance_m += newest_odom_m ? (p_odom_m - *newest_odom_m).norm() : 0.0;
    newest_odom_m = p_odom_m;
  }

  /// At the present distance plus the lag, or at the end.
  Eigen::Vector2d tilt_rad() const {
    const auto after =
        std::lower_bound(levels.begin(),
                         levels.end(),
                         distance_m + kLevellingLag_m,
                         [](const Level& level, double d) { return level.distance_m < d; });
    return after == levels.end() ? levels.back().tilt_rad : after->tilt_rad;
  }
};

/// The same transform with another tilt, turned about the point `p_odom_m`, which stays.
YawPose levelled(const YawPose& T_map_odom,
                 const Eigen::Vector2d& tilt_rad,
                 const Eigen::Vector3d& p_odom_m) {
  YawPose turned = T_map_odom;
  turned.tilt_rad = tilt_rad;
  turned.p += T_map_odom.pose() * p_odom_m - turned.pose() * p_odom_m;
  return turned;
}

using Epochs = std::map<std::uint32_t, Epoch>;

Epochs survey(const KeyframeSource& keyframes, const std::optional<Alignment>& fallback) {
  Epochs epochs;
  keyframes([&](const Keyframe& keyframe) {
    auto& epoch = epochs[keyframe.odom_epoch];
    ++epoch.keyframes;
    epoch.go_to(keyframe.T_odom_base.p);
    if (keyframe.aligned && !epoch.first_alignment) {
      epoch.first_alignment = keyframe.T_map_odom;
      epoch.aligned_at_odom_m = keyframe.T_odom_base.p;
    }
    if (keyframe.aligned) {
      epoch.levels.push_back({epoch.distance_m, keyframe.T_map_odom.tilt_rad});
    }
  });
  for (auto& [number, epoch] : epochs) {
    epoch.distance_m = 0.0;
    epoch.newest_odom_m.reset();
  }
  const auto of_fallback = fallback ? epochs.find(fallback->odom_epoch) : epochs.end();
  if (of_fallback != epochs.end() && !of_fallback->second.first_alignment) {
    of_fallback->second.first_alignment = fallback->T_map_odom;
  }
  return epochs;
}

/// Without any alignment the pieces of several epochs do not fit together: the largest stays alone
/// in its odom frame.
void settle_for_odom(Epochs& epochs, MapReport& report) {
  const auto largest =
      std::max_element(epochs.begin(), epochs.end(), [](const auto& a, const auto& b) {
        return a.second.keyframes < b.second.keyframes;
      });
  largest->second.first_alignment = YawPose{};
  report.frame = "odom";
  report.remark =
      "no alignment to the datum was found: the map is in the frame odom and not georeferenced";
}

class Renderer {
 public:
  Renderer(Epochs epochs, double voxel_m, const std::string& out_pcd, const std::string& frame)
      : epochs_(std::move(epochs)),
        file_(out_pcd, frame),
        tiles_(voxel_m, kMostVoxels, [this](const PointCloud& points) { file_.append(points); }) {}

  void add(const Keyframe& keyframe, MapReport& report) {
    Epoch& epoch = epochs_.at(keyframe.odom_epoch);
    epoch.go_to(keyframe.T_odom_base.p);
    if (!epoch.first_alignment) {
      ++report.keyframes_left_out;
      return;
    }
    YawPose T_map_odom = keyframe.aligned ? keyframe.T_map_odom : *epoch.first_alignment;
    if (!epoch.levels.empty()) {
      T_map_odom = levelled(T_map_odom,
                            epoch.tilt_rad(),
                            keyframe.aligned ? keyframe.T_odom_base.p : epoch.aligned_at_odom_m);
    }
    tiles_.add(place(T_map_odom.pose() * keyframe.T_odom_base, keyframe.points_base, report));
    ++report.keyframes;
  }

  std::uint64_t finish() {
    tiles_.finish();
    return file_.finish();
  }

 private:
  static PointCloud place(const Pose& T_map_base, const PointCloud& points, MapReport& report) {
    PointCloud placed = points;
    for (auto& point : placed) {
      const Eigen::Vector3d p = T_map_base * point.position().cast<double>();
      report.lowest_m = report.lowest_m.cwiseMin(p);
      report.highest_m = report.highest_m.cwiseMax(p);
      point.x = static_cast<float>(p.x());
      point.y = static_cast<float>(p.y());
      point.z = static_cast<float>(p.z());
    }
    report.points_read += points.size();
    return placed;
  }

  Epochs epochs_;
  PcdWriter file_;
  VoxelTiles tiles_;
};

std::uint64_t total(const Epochs& epochs) {
  std::uint64_t keyframes = 0;
  for (const auto& [number, epoch] : epochs) {
    keyframes += epoch.keyframes;
  }
  return keyframes;
}

}  // namespace

MapReport render_keyframes(const KeyframeSource& keyframes,
                           const std::optional<Alignment>& fallback,
                           double voxel_m,
                           const std::string& out_pcd,
                           const std::function<void(double)>& progress) {
  if (!(voxel_m > 0.0)) {
    throw std::runtime_error("the map's voxel size must be above 0 m, got " +
                             std::to_string(voxel_m));
  }
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  MapReport report;
  report.lowest_m.setConstant(kInfinity);
  report.highest_m.setConstant(-kInfinity);
  auto epochs = survey(keyframes, fallback);
  const auto all = total(epochs);
  const bool placed = std::any_of(epochs.begin(), epochs.end(), [](const auto& epoch) {
    return epoch.second.first_alignment.has_value();
  });
  if (!placed && all > 0) {
    settle_for_odom(epochs, report);
  }
  Renderer renderer(epochs, voxel_m, out_pcd, report.frame);
  keyframes([&](const Keyframe& keyframe) {
    renderer.add(keyframe, report);
    if (progress) {
      progress(static_cast<double>(report.keyframes + report.keyframes_left_out) /
               static_cast<double>(all));
    }
  });
  report.points_written = renderer.finish();
  if (report.points_read == 0) {
    report.lowest_m.setZero();
    report.highest_m.setZero();
    report.remark = "there are no points: the map is empty";
  } else if (report.keyframes_left_out > 0) {
    report.remark += (report.remark.empty() ? "" : "; ") +
                     std::to_string(report.keyframes_left_out) +
                     " keyframes of an odom epoch without alignment are left out";
  }
  return report;
}

}  // namespace trigpoint::exporter
