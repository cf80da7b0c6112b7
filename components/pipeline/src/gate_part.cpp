// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

namespace {

constexpr double kRewriteAfter_s = 3.0;

}  // namespace

GatePart::GatePart(const std::string& session, exporter::Opening opening)
    : session_(session),
      trajectory_(path_in(session, file::kFused), "base_link in map, as published online", opening),
      gate_log_(path_in(session, file::kGate), opening),
      counts_(session, "fusion_gate", opening) {}

void GatePart::on_fused(const Odometry& odometry) {
  trajectory_.append(odometry.stamp_ns, odometry.T_frame_child);
}

void GatePart::on_status(const FusionStatus& status) {
  gate_log_.append(status);
  last_ = status;
}

void GatePart::on_alignment(const Alignment& alignment, bool admitted) {
  newest_alignment_ = {alignment, admitted, admitted ? "" : "not admitted by the gate"};
  const bool new_verdict = !written_alignment_ || written_alignment_->admitted != admitted;
  const bool due = to_seconds(last_.stamp_ns - written_ns_) >= kRewriteAfter_s;
  if (new_verdict ||
      (due && exporter::differs_substantially(*newest_alignment_, *written_alignment_))) {
    write_alignment(*newest_alignment_);
  }
}

void GatePart::write_alignment(const exporter::AlignmentRecord& record) {
  exporter::write_alignment(path_in(session_, file::kAlignment), record);
  written_alignment_ = record;
  written_ns_ = last_.stamp_ns;
}

void GatePart::keep_counts() {
  counts_.write(exporter::counts_of(last_));
}

void GatePart::close() {
  if (newest_alignment_) {
    write_alignment(*newest_alignment_);
  }
  keep_counts();
}

}  // namespace trigpoint::pipeline
