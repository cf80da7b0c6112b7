// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion_map.hpp"

#include "trigpoint/base/point_cloud.hpp"
#include "trigpoint/evaluation/plane_thickness.hpp"
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/export/map.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"
#include "trigpoint/lio_mapper/see_through.hpp"
#include "trigpoint/pipeline/map_log.hpp"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <vector>

namespace trigpoint::fusion_table {

namespace {

namespace file = exporter::session_file;
using evaluation::AlignmentKind;
using exporter::path_in;
using pipeline::UseOfStored;

constexpr double kMapVoxel_m = 0.1;
constexpr double kSameSurface_m = 0.05;
constexpr double kRemovedShare_percent = 90.0;
constexpr double kSamePoint_m = 0.1;                // range noise, and the pose of the sweep
constexpr Nanoseconds kLeastSweep_ns = 50'000'000;  // from the first firing to the last
constexpr Nanoseconds kMostSweep_ns = 150'000'000;
constexpr const char* kSecondDay = "indoor_60+second_day";
constexpr const char* kFirstDay = "indoor_60";

Figure told(std::string name, double value, Bound bound = {}) {
  Figure figure;
  figure.name = std::move(name);
  figure.value = value;
  figure.bound = bound;
  return figure;
}

Bound map_at_most(double value) {
  return {std::nullopt, value};
}

/// `trigpoint map SCENARIO --out SESSION`, or with --resume; without map and report. Returns the
/// file of the drive's truth.
std::string map_drive(const MapTask& task,
                      const std::string& scenario,
                      const std::string& session,
                      UseOfStored use = UseOfStored::kNothing) {
  cli::InputOptions options = task.input;
  options.log = scenario;
  options.mode = task.mode;
  const std::string truth_folder = session + "_truth_of_" + scenario;
  const std::string truth = path_in(truth_folder, file::kTruth);
  cli::Input input = cli::open_input(options);
  cli::leave_truth(input, truth_folder);
  pipeline::MapLogOptions how;
  how.session = session;
  how.config_text = cli::print(input.config);
  how.mode = task.mode;
  how.use = use;
  if (use == UseOfStored::kResume) {
    how.stored = pipeline::open_stored_session(session);
  }
  pipeline::map_log(*input.reader, input.config.cores, how);
  return truth;
}

double rmse_m(const exporter::Trajectory& estimate, const exporter::Trajectory& truth) {
  const auto pairs = evaluation::associate(estimate, truth).pairs;
  return evaluation::absolute_error(pairs).position_m.rmse;
}

exporter::Trajectory between(const exporter::Trajectory& all, Nanoseconds from, Nanoseconds to) {
  exporter::Trajectory part;
  std::copy_if(all.begin(), all.end(), std::back_inserter(part), [&](const auto& pose) {
    return pose.stamp_ns >= from && pose.stamp_ns <= to;
  });
  return part;
}

/// Online and smoothed, of the drive that this truth is of.
Figures trajectories(const std::string& session, const std::string& truth_file) {
  const auto truth = evaluation::Trajectory(exporter::read_trajectory(truth_file));
  const auto of_drive = [&](const char* name) {
    return between(exporter::read_trajectory(path_in(session, name)),
                   truth.front().stamp_ns,
                   truth.back().stamp_ns);
  };
  const double online_m = rmse_m(of_drive(file::kFused), truth);
  const double smoothed_m = rmse_m(of_drive(file::kFusedSmoothed), truth);
  return {told("RMSE of fused.tum, m", online_m),
          told("RMSE of fused_smoothed.tum, m", smoothed_m)};
}

exporter::CorrectedPoses poses_between(const exporter::CorrectedPoses& all,
                                       Nanoseconds from_ns,
                                       Nanoseconds to_ns) {
  exporter::CorrectedPoses part;
  part.frame = all.frame;
  std::copy_if(all.T_frame_base.begin(),
               all.T_frame_base.end(),
               std::inserter(part.T_frame_base, part.T_frame_base.end()),
               [&](const auto& pose) { return pose.first >= from_ns && pose.first < to_ns; });
  return part;
}

/// The map as it is saved, of the keyframes that have a pose.
PointCloud saved_map(const std::string& session, const exporter::CorrectedPoses& poses) {
  const std::string pcd = path_in(session, "part.pcd");
  exporter::render_map(path_in(session, file::kKeyframes),
                       std::nullopt,
                       kMapVoxel_m,
                       pcd,
                       {},
                       {&poses, true, exporter::past_settings_of(session).lidar_position_base_m});
  return exporter::read_pcd(pcd);
}

Figures same_surfaces(const std::string& of, const PointCloud& first, const PointCloud& second) {
  const auto offset = evaluation::facade_offset(first, second);
  return {
      told("walls " + of + ", their distance: median, m", offset.median_m),
      told("walls " + of + ", their distance: 90 %, m", offset.p90_m, map_at_most(kSameSurface_m)),
      told("walls " + of + ": number", static_cast<double>(offset.planes))};
}

void append(Figures& to, const Figures& more) {
  to.insert(to.end(), more.begin(), more.end());
}

exporter::CorrectedPoses corrected_poses(const std::string& session) {
  exporter::correct_session(session);
  return exporter::read_corrected(session).value();
}

Figure datum_unchanged(const Datum& before, const std::string& session) {
  const Datum after = exporter::read_datum(path_in(session, file::kDatum));
  Figure figure = told("datum unchanged", before.id() == after.id() ? 1.0 : 0.0);
  figure.met = before.id() == after.id();
  return figure;
}

/// A sweep's pose in `file` for each keyframe of a session.
exporter::CorrectedPoses poses_of(const std::string& trajectory_file) {
  exporter::CorrectedPoses poses;
  for (const auto& pose : exporter::read_trajectory(trajectory_file)) {
    poses.T_frame_base[pose.stamp_ns] = pose.pose;
  }
  return poses;
}

/// Where the rays of each sweep met what moves.
class MovingTruth {
 public:
  MovingTruth(const std::string& truth_file, const std::filesystem::path& folder)
      : truth_(exporter::read_trajectory(truth_file)) {
    std::ifstream lines((folder / "moving_points.txt").string());
    std::string head;
    std::getline(lines, head);
    Nanoseconds stamp_ns = 0;
    std::uint64_t point = 0;
    std::uint64_t object = 0;
    Eigen::Vector3d p_map_m;
    while (lines >> stamp_ns >> point >> object >> p_map_m.x() >> p_map_m.y() >> p_map_m.z()) {
      hits_map_m_[stamp_ns].push_back(p_map_m);
    }
  }

  /// Which points of a keyframe lie on what moves. A keyframe's stamp is that of its last point.
  std::vector<bool> of(const lio_mapper::Keyframe& keyframe) const {
    std::vector<bool> moving(keyframe.points_base.size(), false);
    const auto T_map_base = evaluation::pose_at(truth_, keyframe.stamp_ns);
    const std::vector<Eigen::Vector3d>* hits = hits_of(keyframe.stamp_ns);
    for (std::size_t i = 0; T_map_base && hits != nullptr && i < moving.size(); ++i) {
      const Eigen::Vector3d p_m =
          *T_map_base * keyframe.points_base[i].position().cast<double>().eval();
      moving[i] = std::any_of(hits->begin(), hits->end(), [&](const Eigen::Vector3d& hit) {
        return (hit - p_m).norm() < kSamePoint_m;
      });
    }
    return moving;
  }

 private:
  /// Of the sweep that began before the keyframe: a cloud's stamp is that of its first firing.
  const std::vector<Eigen::Vector3d>* hits_of(Nanoseconds keyframe_ns) const {
    const auto after = hits_map_m_.upper_bound(keyframe_ns - kLeastSweep_ns);
    if (after == hits_map_m_.begin()) {
      return nullptr;
    }
    const auto sweep = std::prev(after);
    return keyframe_ns - sweep->first < kMostSweep_ns ? &sweep->second : nullptr;
  }

  evaluation::Trajectory truth_;
  std::map<Nanoseconds, std::vector<Eigen::Vector3d>> hits_map_m_;
};

struct Seen {
  std::size_t moving{0};
  std::size_t moving_removed{0};
  std::size_t others{0};
  std::size_t others_removed{0};
};

/// What the rendering of the map does (exporter::render_map), point by point.
Seen look_through(const std::string& session,
                  const exporter::CorrectedPoses& poses,
                  const MovingTruth& truth) {
  const std::string keyframes = path_in(session, file::kKeyframes);
  const Eigen::Vector3d lidar_m = exporter::past_settings_of(session).lidar_position_base_m;
  lio_mapper::SeeThrough see_through;
  const auto visit = [&](const auto& what) {
    lio_mapper::read_keyframes(keyframes, [&](const lio_mapper::Keyframe& keyframe) {
      const auto pose = poses.T_frame_base.find(keyframe.stamp_ns);
      if (pose != poses.T_frame_base.end()) {
        what(keyframe, moved(keyframe.points_base, pose->second), pose->second);
      }
    });
  };
  visit([&](const auto&, const PointCloud& points, const Pose&) { see_through.add(points); });
  visit([&](const auto&, const PointCloud& points, const Pose& pose) {
    see_through.look(points, pose * lidar_m);
  });
  see_through.decide();
  Seen seen;
  visit([&](const lio_mapper::Keyframe& keyframe, const PointCloud& points, const Pose&) {
    const std::vector<bool> is_moving = truth.of(keyframe);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const bool removed = see_through.is_moving(points[i]);
      ++(is_moving[i] ? seen.moving : seen.others);
      (is_moving[i] ? seen.moving_removed : seen.others_removed) += removed ? 1 : 0;
    }
  });
  return seen;
}

}  // namespace

Figures map_across_outages(const MapTask& task, const std::string& scenario) {
  const std::string session = path_in(task.folder, "session");
  const std::string truth = map_drive(task, scenario, session);
  const exporter::CorrectedPoses poses = corrected_poses(session);
  Figures figures = trajectories(session, truth);
  const auto thickness = evaluation::facade_thickness(saved_map(session, poses));
  figures.push_back(told("facades of the saved map, one sigma: median, m", thickness.median_m));
  figures.push_back(told("facades of the saved map, one sigma: 90 %, m", thickness.p90_m));
  cli::InputOptions input = task.input;
  input.log = scenario;
  const auto windows = outages(without_runs(input));
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const auto before = poses_between(poses, 0, windows[i].begin_ns);
    const auto after = poses_between(poses, windows[i].end_ns, INT64_MAX);
    append(figures,
           same_surfaces("before and after outage " + std::to_string(i + 1),
                         saved_map(session, before),
                         saved_map(session, after)));
  }
  return figures;
}

Figures map_of_second_run(const MapTask& task) {
  const std::string session = path_in(task.folder, "session");
  map_drive(task, kFirstDay, session);
  const Datum datum = exporter::read_datum(path_in(session, file::kDatum));
  const std::string truth = map_drive(task, kSecondDay, session, UseOfStored::kResume);
  const Nanoseconds second_ns = exporter::read_trajectory(truth).front().stamp_ns;
  const exporter::CorrectedPoses poses = corrected_poses(session);
  Figures figures = trajectories(session, truth);
  append(figures,
         same_surfaces("of both runs",
                       saved_map(session, poses_between(poses, 0, second_ns)),
                       saved_map(session, poses_between(poses, second_ns, INT64_MAX))));
  figures.push_back(datum_unchanged(datum, session));
  return figures;
}

Figures map_of_merged_sessions(const MapTask& task) {
  const std::string first = path_in(task.folder, "first");
  const std::string second = path_in(task.folder, "second");
  const std::string merged = path_in(task.folder, "merged");
  const std::string truth_of_first = map_drive(task, kFirstDay, first);
  const std::string truth_of_second = map_drive(task, kSecondDay, second);
  const Datum datum = exporter::read_datum(path_in(first, file::kDatum));
  const auto report = exporter::merge_sessions(first, second, merged, kMapVoxel_m);
  const std::string first_tum = path_in(merged, "first.tum");
  const std::string second_tum = path_in(merged, "second.tum");
  const auto rmse_of = [](const std::string& estimate, const std::string& truth) {
    return rmse_m(exporter::read_trajectory(estimate), exporter::read_trajectory(truth));
  };
  Figures figures{
      told("RMSE of the first session's corrected past, m", rmse_of(first_tum, truth_of_first)),
      told("RMSE of the second session's, m", rmse_of(second_tum, truth_of_second)),
      told("loops between the sessions", static_cast<double>(report.loops_between))};
  append(figures,
         same_surfaces("of both sessions",
                       saved_map(first, poses_of(first_tum)),
                       saved_map(second, poses_of(second_tum))));
  figures.push_back(datum_unchanged(datum, merged));
  return figures;
}

Figures map_without_traffic(const MapTask& task) {
  const std::string session = path_in(task.folder, "session");
  const std::string truth = map_drive(task, "street_traffic", session);
  const exporter::CorrectedPoses poses = corrected_poses(session);
  Figures figures = trajectories(session, truth);
  const auto moving = MovingTruth(truth, std::filesystem::path(truth).parent_path());
  const Seen seen = look_through(session, poses, moving);
  Figure moving_share =
      told("% of the points on what moves not in the map",
           100.0 * static_cast<double>(seen.moving_removed) / static_cast<double>(seen.moving));
  moving_share.bound.lowest = kRemovedShare_percent;
  figures.push_back(moving_share);
  figures.push_back(
      told("% of the other points lost",
           100.0 * static_cast<double>(seen.others_removed) / static_cast<double>(seen.others)));
  figures.push_back(told("points on what moves", static_cast<double>(seen.moving)));
  return figures;
}

}  // namespace trigpoint::fusion_table
