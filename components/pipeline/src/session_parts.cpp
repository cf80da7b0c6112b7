// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

#include <variant>

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

GpsPart::GpsPart(const std::string& session)
    : session_(session),
      trajectory_(path_in(session, file::kGps), "base_link in map, GPS odometry"),
      statuses_(path_in(session, file::kGpsStatus)),
      counts_(session, "gps_odometry") {}

void GpsPart::on_odometry(const Odometry& odometry) {
  trajectory_.append(odometry.stamp_ns, odometry.T_frame_child);
}

void GpsPart::on_status(const GpsStatus& status) {
  statuses_.append(status);
  last_ = status;
}

void GpsPart::on_datum(const Datum& datum) {
  exporter::write_datum(path_in(session_, file::kDatum), datum);
}

void GpsPart::close() {
  counts_.write(exporter::counts_of(last_));
}

MapperPart::MapperPart(const std::string& session)
    : trajectory_(path_in(session, file::kLio), "base_link in odom, LiDAR-inertial odometry"),
      scans_(path_in(session, file::kScans)),
      keyframes_(path_in(session, file::kKeyframes)),
      counts_(session, "lio_mapper") {}

void MapperPart::on_scan(const lio_mapper::ScanResult& scan) {
  trajectory_.append(scan.odometry.stamp_ns, scan.odometry.T_frame_child);
  scans_.append(scan.status, scan.points_odom.size());
  if (scan.keyframe) {
    keyframes_.append(*scan.keyframe);
  }
}

void MapperPart::close(const LioStatus& status) {
  counts_.write(exporter::counts_of(status));
}

GatePart::GatePart(const std::string& session)
    : session_(session),
      trajectory_(path_in(session, file::kFused), "base_link in map, as published online"),
      gate_log_(path_in(session, file::kGate)),
      counts_(session, "fusion_gate") {}

void GatePart::on_fused(const Odometry& odometry) {
  trajectory_.append(odometry.stamp_ns, odometry.T_frame_child);
}

void GatePart::on_status(const FusionStatus& status) {
  gate_log_.append(status);
  last_ = status;
}

void GatePart::on_alignment(const Alignment& alignment, bool admitted) {
  exporter::write_alignment(path_in(session_, file::kAlignment),
                            {alignment, admitted, admitted ? "" : "not admitted by the gate"});
}

void GatePart::close() {
  counts_.write(exporter::counts_of(last_));
}

LogPart::LogPart(const std::string& session)
    : fixes_(path_in(session, file::kFixes)), counts_(session, "log") {}

void LogPart::on_entry(const recording::LogEntry& entry) {
  if (first_ns_ == 0) {
    first_ns_ = entry.receive_ns;
  }
  last_ns_ = entry.receive_ns;
  if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
    fixes_.append(*fix, entry.receive_ns, entry.withheld);
    ++(entry.withheld ? fixes_withheld_ : fixes_fed_);
  } else if (std::holds_alternative<ImuSample>(entry.measurement)) {
    ++imu_;
  } else {
    ++sweeps_;
  }
}

void LogPart::close() {
  counts_.write({{"points.in_log", sweeps_},
                 {"points.published", sweeps_},
                 {"imu.in_log", imu_},
                 {"imu.published", imu_},
                 {"fix.in_log", fixes_fed_ + fixes_withheld_},
                 {"fix.withheld", fixes_withheld_},
                 {"fix.published", fixes_fed_}});
}

}  // namespace trigpoint::pipeline
