// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trajectory_files.hpp"

#include "csv.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <iterator>

namespace trigpoint::exporter {

namespace {

struct Known {
  const char* file;
  const char* content;
  bool is_in_map;
};

constexpr std::array<Known, 5> kTrajectories{
    {{session_file::kFused, "what was published while driving, base_link in map", true},
     {session_file::kFusedSmoothed, "the corrected past, base_link in map", true},
     {session_file::kLio, "LiDAR and IMU alone, base_link in odom", false},
     {session_file::kGps, "the GPS filter, base_link in map", true},
     {session_file::kTruth, "truth of the log, base_link in map", true}}};

/// lio and fused have no stamps in common: lio, a pose a scan, is interpolated, but for a lost
/// scan.
constexpr Nanoseconds kLongestGap_ns = 250'000'000;

std::string fixed(double value, int decimals) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

/// Interpolated; nullopt outside the trajectory and in its gaps.
std::optional<Pose> pose_at(const Trajectory& trajectory, Nanoseconds stamp_ns) {
  const auto after = std::lower_bound(
      trajectory.begin(), trajectory.end(), stamp_ns, [](const StampedPose& pose, Nanoseconds t) {
        return pose.stamp_ns < t;
      });
  if (after == trajectory.end()) {
    return std::nullopt;
  }
  if (after->stamp_ns == stamp_ns) {
    return after->pose;
  }
  if (after == trajectory.begin() ||
      after->stamp_ns - std::prev(after)->stamp_ns > kLongestGap_ns) {
    return std::nullopt;
  }
  const auto before = std::prev(after);
  const double part =
      to_seconds(stamp_ns - before->stamp_ns) / to_seconds(after->stamp_ns - before->stamp_ns);
  return interpolate(before->pose, after->pose, part);
}

/// T_map_odom at the first moment that both know.
std::optional<Pose> first_placement(const Trajectory& fused, const Trajectory& lio) {
  for (const StampedPose& pose : fused) {
    if (const auto odom = pose_at(lio, pose.stamp_ns)) {
      return pose.pose * odom->inverse();
    }
  }
  return std::nullopt;
}

Track track_of(const NamedTrajectory& trajectory,
               const Pose& T_map_frame,
               const geodesy::MapOnEarth& earth) {
  Track track{trajectory.name, trajectory.content, {}};
  track.points.reserve(trajectory.poses.size());
  for (const StampedPose& pose : trajectory.poses) {
    track.points.push_back({pose.stamp_ns, earth.geographic(T_map_frame * pose.pose.p)});
  }
  return track;
}

const Trajectory* find(const std::vector<NamedTrajectory>& trajectories, const std::string& name) {
  const auto found = std::find_if(trajectories.begin(), trajectories.end(), [&](const auto& each) {
    return each.name == name;
  });
  return found == trajectories.end() ? nullptr : &found->poses;
}

}  // namespace

std::vector<NamedTrajectory> read_trajectories(const std::string& session,
                                               std::vector<std::string>& missing) {
  std::vector<NamedTrajectory> trajectories;
  for (const Known& known : kTrajectories) {
    const std::string file = path_in(session, known.file);
    if (!std::filesystem::exists(file)) {
      missing.push_back(std::string("no ") + known.file + " in the session");
      continue;
    }
    trajectories.push_back({std::filesystem::path(known.file).stem().string(),
                            known.content,
                            known.is_in_map,
                            read_trajectory(file)});
  }
  return trajectories;
}

void write_kitti(const std::string& file,
                 const std::string& times_file,
                 const Trajectory& trajectory) {
  std::string poses;
  std::string times;
  for (const StampedPose& stamped : trajectory) {
    const Eigen::Matrix3d R = stamped.pose.q.toRotationMatrix();
    for (Eigen::Index row = 0; row < 3; ++row) {
      for (Eigen::Index column = 0; column < 3; ++column) {
        poses += fixed(R(row, column), 12) + " ";
      }
      poses += fixed(stamped.pose.p[row], 6) + (row < 2 ? " " : "\n");
    }
    times += stamp_text(stamped.stamp_ns) + "\n";
  }
  write_text(file, poses);
  write_text(times_file, times);
}

void write_trajectory_csv(const std::string& file,
                          const Trajectory& trajectory,
                          const geodesy::MapOnEarth* earth) {
  std::string text =
      "stamp_ns,x_m,y_m,z_m,qx,qy,qz,qw,latitude_deg,longitude_deg,height_m,easting_m,"
      "northing_m\n";
  for (const auto& [stamp_ns, pose] : trajectory) {
    CsvLine line;
    line.add(stamp_ns);
    for (const double value : {pose.p.x(), pose.p.y(), pose.p.z()}) {
      line.add(value);
    }
    for (const double value : {pose.q.x(), pose.q.y(), pose.q.z(), pose.q.w()}) {
      line.add(value);
    }
    const geodesy::Geographic place =
        earth == nullptr ? geodesy::Geographic{} : earth->geographic(pose.p);
    const Eigen::Vector3d utm_m = (earth == nullptr ? std::nullopt : earth->utm(pose.p))
                                      .value_or(Eigen::Vector3d::Constant(kNaN));
    for (const double value : {place.latitude_deg, place.longitude_deg, place.height_m}) {
      line.add(value);
    }
    text += line.add(utm_m.x()).add(utm_m.y()).str();
  }
  write_text(file, text);
}

std::vector<Track> tracks_of(const std::vector<NamedTrajectory>& trajectories,
                             const geodesy::MapOnEarth& earth) {
  const Trajectory* fused = find(trajectories, "fused");
  std::vector<Track> tracks;
  for (const NamedTrajectory& trajectory : trajectories) {
    std::optional<Pose> T_map_frame = Pose{};
    if (!trajectory.is_in_map) {
      T_map_frame = fused == nullptr ? std::nullopt : first_placement(*fused, trajectory.poses);
    }
    if (!T_map_frame || trajectory.poses.empty()) {
      continue;
    }
    tracks.push_back(track_of(trajectory, *T_map_frame, earth));
    if (!trajectory.is_in_map) {
      tracks.back().content += ", placed once, at the first pose of fused";
    }
  }
  return tracks;
}

}  // namespace trigpoint::exporter
