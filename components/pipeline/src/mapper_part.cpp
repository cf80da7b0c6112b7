// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

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

}  // namespace trigpoint::pipeline
