// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "made_session.hpp"

#include "trigpoint/base/so3.hpp"
#include "trigpoint/export/map.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <cmath>
#include <numbers>

namespace trigpoint::evaluation::test {

namespace {

namespace file = exporter::session_file;
using exporter::path_in;

constexpr Nanoseconds kStart_ns = 1'700'000'000'000'000'000;
const Datum kDatum{48.98, 8.39, 116.0, kStart_ns};
const Eigen::Vector3d kAntenna_base_m{-0.5, 0.2, 1.5};
const Pose kT_map_odom{from_yaw(0.6), {40.0, -20.0, 1.0}};

Nanoseconds stamp(double t_s) {
  return kStart_ns + from_seconds(t_s);
}

/// Once round a figure of eight in 120 s.
Pose truth_at(double t_s) {
  const double a = 2.0 * std::numbers::pi * t_s / 120.0;
  const Eigen::Vector3d p(90.0 * std::sin(a), 45.0 * std::sin(2.0 * a), 2.0 * std::sin(a));
  return {from_yaw(std::atan2(90.0 * std::cos(2.0 * a), 90.0 * std::cos(a))), p};
}

bool in_outage(double t_s) {
  return t_s > kOutageBegin_s && t_s < kOutageEnd_s;
}

double outage_share(double t_s) {
  return in_outage(t_s) ? (t_s - kOutageBegin_s) / (kOutageEnd_s - kOutageBegin_s) : 0.0;
}

void write_trajectories(const std::string& folder, bool with_truth) {
  exporter::TrajectoryWriter fused(path_in(folder, file::kFused), "base_link in map");
  exporter::TrajectoryWriter lio(path_in(folder, file::kLio), "base_link in odom");
  exporter::TrajectoryWriter gps(path_in(folder, file::kGps), "base_link in map");
  for (int i = 0; i <= kScans; ++i) {
    const double t_s = 0.1 * i;
    const Pose truth = truth_at(t_s);
    if (t_s >= 10.0) {
      Pose pose = truth;
      pose.p.x() += in_outage(t_s) ? kOutageEndError_m * outage_share(t_s) : kFusedEastError_m;
      fused.append(stamp(t_s), pose);
    }
    Pose drifted = truth;
    drifted.p.z() += 0.01 * t_s;
    lio.append(stamp(t_s), kT_map_odom.inverse() * drifted);
    Pose noisy = truth;
    noisy.p +=
        0.15 * Eigen::Vector3d(std::sin(7.0 * t_s), std::cos(5.0 * t_s), std::sin(3.0 * t_s));
    noisy.p.y() += 25.0 * outage_share(t_s) * outage_share(t_s);
    gps.append(stamp(t_s), noisy);
  }
  if (with_truth) {
    exporter::TrajectoryWriter writer(path_in(folder, file::kTruth), "base_link in map");
    for (int i = 0; i <= 2400; ++i) {
      writer.append(stamp(0.05 * i), truth_at(0.05 * i));
    }
  }
}

/// 1 Hz; every fifth is withheld.
void write_fixes(const std::string& folder) {
  exporter::FixLog log(path_in(folder, file::kFixes));
  exporter::GpsStatusLog statuses(path_in(folder, file::kGpsStatus));
  const geodesy::LocalFrame frame(kDatum);
  for (int t_s = 0; t_s <= 120; ++t_s) {
    if (in_outage(t_s)) {
      continue;
    }
    const auto place = frame.to_geographic(truth_at(t_s) * kAntenna_base_m);
    GnssFix fix;
    fix.stamp_ns = stamp(t_s);
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.altitude_m = place.height_m;
    fix.status = FixStatus::kFix;
    fix.covariance_type = CovarianceType::kDiagonalKnown;
    fix.covariance_enu_m2 = 0.01 * Eigen::Matrix3d::Identity();
    const bool withheld = t_s % 5 == 4;
    log.append(fix, fix.stamp_ns + 80'000'000, withheld);
    if (!withheld) {
      GpsStatus status;
      status.stamp_ns = fix.stamp_ns;
      status.last_accepted_fix_ns = fix.stamp_ns;
      status.health = GpsHealth::kOk;
      statuses.append(status);
    }
  }
}

FusionStatus gate_status(double t_s) {
  FusionStatus status;
  status.stamp_ns = stamp(t_s);
  status.mode = "hard";
  status.aligned = t_s >= 10.0;
  status.T_map_odom = {0.6, kT_map_odom.p};
  status.yaw_sigma_rad = 0.002;
  status.position_sigma_m = {0.05, 0.04, 0.10};
  const double sigma_m = 0.05 + 12.0 * outage_share(t_s);
  const std::array<double, 3> thresholds_m{0.5, 0.5, 1.0};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const bool is_good = sigma_m <= thresholds_m[axis];
    status.axes[axis] = {!status.aligned ? AxisSource::kNone
                         : is_good       ? AxisSource::kFused
                                         : AxisSource::kLio,
                         sigma_m,
                         thresholds_m[axis],
                         is_good ? "" : "sigma above threshold"};
  }
  status.fixes_seen = 81;
  status.fixes_used = 72;
  status.verdicts = {{"used", 72}, {"stale", 9}};
  return status;
}

void write_logs(const std::string& folder) {
  exporter::GateLog gate(path_in(folder, file::kGate));
  exporter::ScanLog scans(path_in(folder, file::kScans));
  for (int i = 0; i <= kScans; ++i) {
    if (i % 2 == 0) {
      gate.append(gate_status(0.1 * i));
    }
    LioStatus status;
    status.stamp_ns = stamp(0.1 * i);
    status.health = LioHealth::kOk;
    status.scan_ms = 1.0 + i % 100;  // 1 to 100 ms: median 50 (nearest rank), p99 99
    scans.append(status, 4000);
  }
}

void write_records(const std::string& folder) {
  exporter::write_text(path_in(folder, file::kConfig),
                       "robot:\n  antenna_position_base_m: [-0.5, 0.2, 1.5]\n");
  exporter::write_datum(path_in(folder, file::kDatum), kDatum);
  exporter::write_run(path_in(folder, file::kRun),
                      {"campus.yaml", "offline", "hard", "ekf15", 120.0, 30.0});
  exporter::AlignmentRecord record;
  record.alignment.T_map_odom = {0.6, kT_map_odom.p};
  record.alignment.covariance = Eigen::Vector4d(4e-6, 0.0025, 0.0016, 0.01).asDiagonal();
  record.admitted = true;
  exporter::write_alignment(path_in(folder, file::kAlignment), record);
  exporter::CountsWriter(folder, "player")
      .write({{"points.in_log", 1201},
              {"points.published", 1201},
              {"imu.in_log", 24000},
              {"imu.published", 24000},
              {"fix.in_log", 102},
              {"fix.withheld", 21},
              {"fix.published", 81}});
  exporter::CountsWriter(folder, "lio_mapper")
      .write({{"points.received", 1201}, {"points.used", 1201}, {"imu.received", 24000}});
  exporter::CountsWriter(folder, "gps_odometry")
      .write({{"fix.received", 81}, {"fix.used", 81}, {"imu.received", 24000}});
  exporter::CountsWriter(folder, "fusion_gate")
      .write({{"fix.judged", 81},
              {"fix.used", 72},
              {"fix.verdict.used", 72},
              {"fix.verdict.stale", 9}});
}

/// Ground along the road, and facades 8 m to its left, 6 m high.
void write_map(const std::string& folder) {
  PointCloud cloud;
  for (double t_s = 0.0; t_s < 120.0; t_s += 0.02) {
    const Pose truth = truth_at(t_s);
    const auto add = [&](double left_m, double up_m) {
      const Eigen::Vector3f p = (truth * Eigen::Vector3d(0.0, left_m, up_m)).cast<float>();
      cloud.push_back({p.x(), p.y(), p.z(), 1.0F});
    };
    for (double left_m = -4.0; left_m <= 4.0; left_m += 0.5) {
      add(left_m, -1.5);
    }
    for (double up_m = -1.5; std::fmod(t_s, 5.0) < 3.0 && up_m < 6.0; up_m += 0.25) {
      add(8.0, up_m);
    }
  }
  exporter::write_pcd(path_in(folder, file::kMap), cloud);
}

}  // namespace

void make_session(const std::string& folder, bool with_truth) {
  exporter::create_session_folder(folder);
  write_trajectories(folder, with_truth);
  write_fixes(folder);
  write_logs(folder);
  write_records(folder);
  write_map(folder);
}

}  // namespace trigpoint::evaluation::test
