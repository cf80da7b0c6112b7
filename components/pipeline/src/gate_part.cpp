// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

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

}  // namespace trigpoint::pipeline
