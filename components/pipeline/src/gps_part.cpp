// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

#include "damaged_files.hpp"

#include <utility>

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

GpsPart::GpsPart(const std::string& session, exporter::Opening opening)
    : session_(session),
      trajectory_(path_in(session, file::kGps), "base_link in map, GPS odometry", opening),
      statuses_(path_in(session, file::kGpsStatus), opening),
      counts_(open_counts(session, "gps_odometry", opening, events_)) {}

Events GpsPart::take_events() {
  return std::exchange(events_, {});
}

void GpsPart::on_odometry(const Odometry& odometry) {
  trajectory_.append(odometry.stamp_ns, odometry.T_frame_child);
}

void GpsPart::on_status(const GpsStatus& status) {
  statuses_.append(status);
}

void GpsPart::on_datum(const Datum& datum) {
  exporter::write_datum(path_in(session_, file::kDatum), datum);
}

void GpsPart::keep_counts(const GpsStatus& status) {
  counts_.write(exporter::counts_of(status));
}

}  // namespace trigpoint::pipeline
