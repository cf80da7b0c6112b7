// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A simulated drive through the mapper alone, with all that a restart anywhere in it needs.
#pragma once

#include "trigpoint/lio_mapper/lio_mapper.hpp"
#include "trigpoint/recording/log.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <variant>
#include <vector>

namespace trigpoint::pipeline {

inline void feed(lio_mapper::LioMapper& mapper,
                 const recording::LogEntry& entry,
                 std::vector<lio_mapper::ScanResult>& scans,
                 Events& events) {
  lio_mapper::Output output;
  if (const auto* imu = std::get_if<ImuSample>(&entry.measurement)) {
    output = mapper.on_imu(*imu);
  } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry.measurement)) {
    output = mapper.on_cloud(*cloud);
  }
  events.insert(events.end(), output.events.begin(), output.events.end());
  std::move(output.scans.begin(), output.scans.end(), std::back_inserter(scans));
}

inline bool said(const Events& events, const std::string& code) {
  return std::any_of(events.begin(), events.end(), [&](const Event& e) { return e.code == code; });
}

struct ResumeDrive {
  explicit ResumeDrive(const std::string& scenario_name, std::uint64_t seed, double duration_s) {
    const auto scenario = simulator::load_scenario(scenario_name);
    const auto reader = simulator::open_scenario(scenario, seed, duration_s);
    robot = *reader->robot();
    lio_mapper::LioMapper mapper({}, robot);
    while (auto entry = reader->next()) {
      if (!std::holds_alternative<GnssFix>(entry->measurement)) {
        feed(mapper, *entry, scans, events);
        entries.push_back(std::move(*entry));
      }
    }
    for (const auto& scan : scans) {
      if (scan.keyframe) {
        keyframes.push_back(*scan.keyframe);
      }
    }
  }

  /// Only of keyframes that were there at `until_ns`.
  lio_mapper::StoredPoints points_until(Nanoseconds until_ns) const {
    return [this, until_ns](const lio_mapper::MapRegion& region, const auto& visit) {
      for (const lio_mapper::Keyframe& keyframe : keyframes) {
        const Eigen::Vector3d away = keyframe.T_odom_base.p - region.center_odom_m;
        if (keyframe.stamp_ns <= until_ns &&
            away.head<2>().cwiseAbs().maxCoeff() <= region.half_side_m) {
          PointCloud moved = keyframe.points_base;
          for (PointXyzi& point : moved) {
            const Eigen::Vector3d p = keyframe.T_odom_base * point.position().cast<double>();
            point.x = static_cast<float>(p.x());
            point.y = static_cast<float>(p.y());
            point.z = static_cast<float>(p.z());
          }
          visit(moved);
        }
      }
    };
  }

  /// The undisturbed run's pose at a scan.
  const Pose* pose_at(Nanoseconds stamp_ns) const {
    const auto scan = std::find_if(
        scans.begin(), scans.end(), [&](const auto& s) { return s.odometry.stamp_ns == stamp_ns; });
    return scan == scans.end() ? nullptr : &scan->odometry.T_frame_child;
  }

  RobotConfig robot;
  std::vector<recording::LogEntry> entries;
  std::vector<lio_mapper::ScanResult> scans;
  std::vector<lio_mapper::Keyframe> keyframes;
  Events events;
};

/// What was measured between two moments.
inline void feed_from(lio_mapper::LioMapper& mapper,
                      const ResumeDrive& drive,
                      Nanoseconds from_ns,
                      double duration_s,
                      std::vector<lio_mapper::ScanResult>& scans,
                      Events& events) {
  for (const recording::LogEntry& entry : drive.entries) {
    if (entry.receive_ns > from_ns && entry.receive_ns < from_ns + from_seconds(duration_s)) {
      feed(mapper, entry, scans, events);
    }
  }
}

struct Resumed {
  std::vector<lio_mapper::ScanResult> scans;
  Events events;
};

/// A mapper of its own from a checkpoint on, over what was measured after `from_ns`.
inline Resumed resume(const ResumeDrive& drive,
                      const lio_mapper::Checkpoint& checkpoint,
                      const lio_mapper::StoredPoints& points,
                      Nanoseconds from_ns,
                      double duration_s) {
  Resumed resumed;
  lio_mapper::LioMapper mapper({}, drive.robot);
  mapper.resume(checkpoint, points);
  feed_from(mapper, drive, from_ns, duration_s, resumed.scans, resumed.events);
  auto rest = mapper.finish();
  std::move(rest.scans.begin(), rest.scans.end(), std::back_inserter(resumed.scans));
  return resumed;
}

}  // namespace trigpoint::pipeline
